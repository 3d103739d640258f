"""The kd-tree."""

from __future__ import annotations

import math

import numpy as np

from sightray._jit import implements, kernel
from sightray.accelerators.base import blocked, closest
from sightray.accelerators.cuts import Heuristic, cut_space
from sightray.accelerators.item import ItemHit
from sightray.accelerators.primitives import (
    ORDER,
    OWN,
    Primitives,
    _OverPrimitives,
    nearest_listed,
    nearest_unbounded,
    no_item,
)
from sightray.accelerators.world_ray import meet_box, world_ray
from sightray.bvh.triangles import axis_of
from sightray.fields import integer, number
from sightray.mathlib.rays import is_ray
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import (
    Space,
    Table,
    f64_at,
    f64_put,
    i64_at,
    i64_put,
    is_null,
    link,
    scratch,
    table_at,
    vec3_at,
)
from sightray.mathlib.tally import NODES, tally
from sightray.mathlib.vec import Vec3

PLANE, AXIS, TO, COUNT, NODE_WORDS = 0, 1, 2, 3, 4  # axis -1: a leaf; first child or primitive; primitives
TABLE, LOWER, UPPER = OWN, OWN + 4, OWN + 8
MAX_DEPTH = 60


class KdTree(_OverPrimitives):
    """Kd-tree: space is cut by planes across the axes, each where a ray is expected to ask least.

    A cell is cut in two, not in eight, and not in the middle but where surface area x number of primitives, summed over
    both sides, is least (see `Bvh2` for why). A plane that leaves one side empty is preferred beyond that: a ray
    through empty space is done with. A cell stays whole when no cut is expected to pay.

    A ray meets the plane of a node at one t, which tells whether it passes the near side, the far side, or one after
    the other; the far one waits on a stack. Leaves come in order along the ray, so the first hit that lies in its own
    leaf is the nearest. Primitives across a plane stand on both sides, and may be asked twice.

    References
    ----------
    J. Bentley, "Multidimensional binary search trees" (CACM 1975); M. Kaplan, "Space-tracing" (1985); V. Havran,
    "Heuristic ray shooting algorithms" (2000): empty space, depth, traversal; I. Wald, V. Havran, "On building fast
    kd-trees for ray tracing, and on doing that in O(N log N)" (RT 2006). Planes are sought among bins, not at all ends.
    """

    traversal_cost: float = number("of visiting a node, in primitive tests", default=0.5, at_least=0)
    empty_bonus: float = number("by which part cutting off empty space is cheaper", default=0.3, at_least=0, below=1)
    leaf_size: int = integer("primitives up to which a cell is not cut", default=1, at_least=1)

    def grow(self, space: Space, row: Table, primitives: Primitives) -> np.ndarray:
        if not len(primitives.number):
            return primitives.number
        heuristic = Heuristic(self.traversal_cost, self.empty_bonus, self.leaf_size)
        cut = cut_space(primitives.lower, primitives.upper, [(0, 1, 2)], heuristic, depth_limit(len(primitives.number)))
        nodes = np.zeros((len(cut.at), NODE_WORDS))
        nodes[:, PLANE] = cut.at
        whole = nodes.view(np.int64)
        whole[:, AXIS], whole[:, TO], whole[:, COUNT] = cut.normal, cut.to, cut.size
        link(row, TABLE, space.array(nodes))
        numbers = row.view(np.float64)
        numbers[LOWER : LOWER + 3] = primitives.lower.min(axis=0)
        numbers[UPPER : UPPER + 3] = primitives.upper.max(axis=0)
        return primitives.number[cut.order]


def depth_limit(n: int) -> int:
    """Levels of cuts for n primitives (V. Havran, 2000)."""
    return min(MAX_DEPTH, 8 + math.ceil(1.3 * math.log2(n + 1)))


@kernel
def walk_kdtree(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64, any: bool) -> ItemHit:
    """Nearest hit, or with `any` whichever is found first."""
    nodes = table_at(tree, TABLE)
    if not is_ray(o, d):
        return no_item()
    ray = world_ray(o, d)
    best = nearest_unbounded(tree, ray, t_min, t_max)
    if is_null(nodes) or (any and best.item >= 0):
        return best
    span = meet_box(vec3_at(tree, LOWER), vec3_at(tree, UPPER), ray, t_min, min(t_max, best.t))
    near, far = span.near, span.far
    if near > far:
        return best
    stack = scratch(192)  # of (node, near, far)
    top, node = 0, 0
    while True:
        # Go down to the leaf where the ray enters; put off what it passes later.
        tally(NODES)
        axis = i64_at(nodes, NODE_WORDS * node + AXIS)
        while axis >= 0:
            plane, child = f64_at(nodes, NODE_WORDS * node + PLANE), i64_at(nodes, NODE_WORDS * node + TO)
            r = axis_of(ray.r, axis)
            t = (plane - axis_of(o, axis)) * r
            doubt = ray.slack * abs(r)  # where in t the plane may be, for all that is known of a far origin
            first = 0 if r >= 0.0 else 1  # the side that the ray comes from
            if t - doubt > far:
                node = child + first
            elif t + doubt < near:
                node = child + 1 - first
            else:
                i64_put(stack, 3 * top, child + 1 - first)
                f64_put(stack, 3 * top + 1, max(near, t - doubt))
                f64_put(stack, 3 * top + 2, far)
                top += 1
                node, far = child + first, min(far, t + doubt)
            tally(NODES)
            axis = i64_at(nodes, NODE_WORDS * node + AXIS)

        # Ask the leaf; what is left on the stack lies behind it.
        to, count = i64_at(nodes, NODE_WORDS * node + TO), i64_at(nodes, NODE_WORDS * node + COUNT)
        best = nearest_listed(tree, table_at(tree, ORDER), to, count, ray, t_min, t_max, best)
        if top == 0 or (any and best.item >= 0):
            return best
        top -= 1
        node, near, far = i64_at(stack, 3 * top), f64_at(stack, 3 * top + 1), f64_at(stack, 3 * top + 2)
        if near > best.t:
            return best


@implements(closest, KdTree)
def closest_in_kdtree(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> ItemHit:
    return walk_kdtree(tree, o, d, t_min, t_max, False)


@implements(blocked, KdTree)
def blocked_in_kdtree(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> bool:
    return walk_kdtree(tree, o, d, t_min, t_max, True).item >= 0
