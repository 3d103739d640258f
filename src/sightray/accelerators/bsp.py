"""The binary space partition with oblique planes."""

from __future__ import annotations

import numpy as np

from sightray._jit import implements, kernel
from sightray.accelerators.base import blocked, closest
from sightray.accelerators.cuts import Heuristic, cut_space
from sightray.accelerators.item import ItemHit
from sightray.accelerators.kdtree import depth_limit
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
from sightray.fields import choice, integer, number
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
from sightray.mathlib.vec import Vec3, dot

# The normals: three axes, and six across the edges of a cube.
S = 2.0**-0.5
AXES = np.eye(3)
EDGES = S * np.array([(0, 1, 1), (0, 1, -1), (1, 0, 1), (1, 0, -1), (1, 1, 0), (1, -1, 0)])
FRAMES = [(0, 1, 2), (0, 3, 4), (1, 5, 6), (2, 7, 8)]

PLANE, TO, COUNT, NODE_WORDS = 3, 4, 5, 6  # after the normal (zero for a leaf): place, first child or primitive, number
TABLE, LOWER, UPPER = OWN, OWN + 4, OWN + 8


class Bsp(_OverPrimitives):
    """Binary space partition: as a kd-tree, but planes may stand obliquely.

    H. Fuchs, Z. Kedem and B. Naylor cut along the polygons of the scene themselves; for rays, T. Ize, I. Wald and
    S. Parker choose among planes of all kinds by the surface area heuristic. Oblique planes pass through gaps that axes
    would cross: long thin things along a diagonal are parted in a few cuts. Each node then costs a scalar product where
    a kd-tree reads one component, and cells become polyhedra.

    Here normals come from a fixed set, as in the restricted trees of Kammaje and Mora: the three axes (``axes``) and
    the six directions across the edges of a cube (``edges``). Extents along each are known beforehand, and the surface
    of a cell is taken for that of the smallest box around it in the four frames that these normals form.

    References
    ----------
    H. Fuchs, Z. Kedem, B. Naylor, "On visible surface generation by a priori tree structures" (SIGGRAPH 1980);
    R. Kammaje, B. Mora, "A study of restricted BSP trees for ray tracing" (RT 2007); T. Ize, I. Wald, S. Parker, "Ray
    tracing with the BSP tree" (RT 2008).
    """

    normals: str = choice("across which planes may stand", ["axes", "edges"], default="edges")
    traversal_cost: float = number("of visiting a node, in primitive tests", default=0.5, at_least=0)
    empty_bonus: float = number("by which part cutting off empty space is cheaper", default=0.3, at_least=0, below=1)
    leaf_size: int = integer("primitives up to which a cell is not cut", default=1, at_least=1)

    def grow(self, space: Space, row: Table, primitives: Primitives) -> np.ndarray:
        if not len(primitives.number):
            return primitives.number
        oblique = self.normals == "edges"
        normals, frames = (np.concatenate([AXES, EDGES]), FRAMES) if oblique else (AXES, FRAMES[:1])
        low, high = primitives.extents(normals)
        heuristic = Heuristic(self.traversal_cost, self.empty_bonus, self.leaf_size)
        limit = depth_limit(len(primitives.number))
        cut = cut_space(low, high, frames, heuristic, limit, tighten if oblique else None)
        nodes = np.zeros((len(cut.at), NODE_WORDS))
        nodes[:, :3], nodes[:, PLANE] = np.where(cut.normal[:, None] >= 0, normals[cut.normal], 0.0), cut.at
        whole = nodes.view(np.int64)
        whole[:, TO], whole[:, COUNT] = cut.to, np.where(cut.normal >= 0, -1, cut.size)
        link(row, TABLE, space.array(nodes))
        numbers = row.view(np.float64)
        numbers[LOWER : LOWER + 3] = primitives.lower.min(axis=0)
        numbers[UPPER : UPPER + 3] = primitives.upper.max(axis=0)
        return primitives.number[cut.order]


def tighten(low: np.ndarray, high: np.ndarray) -> None:
    """What intervals along two axes say about those along their diagonals, and the other way: (n, 9) each, in place."""
    for first in FRAMES[1:]:
        (i, j), plus, minus = [axis for axis in range(3) if axis != first[0]], first[1], first[2]
        for k, a, b, sign in ((plus, i, j, 1), (minus, i, j, -1), (i, plus, minus, 1), (j, plus, minus, -1)):
            least, most = (low[:, b], high[:, b]) if sign > 0 else (-high[:, b], -low[:, b])
            low[:, k] = np.maximum(low[:, k], S * (low[:, a] + least))
            high[:, k] = np.minimum(high[:, k], S * (high[:, a] + most))


@kernel
def walk_bsp(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64, any: bool) -> ItemHit:
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
        while i64_at(nodes, NODE_WORDS * node + COUNT) < 0:
            at = NODE_WORDS * node
            normal, child = vec3_at(nodes, at), i64_at(nodes, at + TO)
            above, rise = dot(normal, o) - f64_at(nodes, at + PLANE), dot(normal, d)
            # The ray is below the plane where above + t rise < 0. Signs at both ends, less what is in doubt, decide.
            doubt = 4.0 * ray.slack + 2.0**-50 * abs(f64_at(nodes, at + PLANE))
            low, high = above + rise * near, above + rise * min(far, best.t)
            if low < -doubt and high < -doubt:
                node = child
            elif low > doubt and high > doubt:
                node = child + 1
            else:
                t = -above / rise if rise != 0.0 else near
                wide = doubt / abs(rise) if rise != 0.0 else far
                first = 0 if rise >= 0.0 else 1  # the side that the ray comes from
                i64_put(stack, 3 * top, child + 1 - first)
                f64_put(stack, 3 * top + 1, max(near, t - wide))
                f64_put(stack, 3 * top + 2, far)
                top += 1
                node, far = child + first, min(far, t + wide)
            tally(NODES)

        # Ask the leaf; what is left on the stack lies behind it.
        to, count = i64_at(nodes, NODE_WORDS * node + TO), i64_at(nodes, NODE_WORDS * node + COUNT)
        best = nearest_listed(tree, table_at(tree, ORDER), to, count, ray, t_min, t_max, best)
        if top == 0 or (any and best.item >= 0):
            return best
        top -= 1
        node, near, far = i64_at(stack, 3 * top), f64_at(stack, 3 * top + 1), f64_at(stack, 3 * top + 2)
        if near > best.t:
            return best


@implements(closest, Bsp)
def closest_in_bsp(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> ItemHit:
    return walk_bsp(tree, o, d, t_min, t_max, False)


@implements(blocked, Bsp)
def blocked_in_bsp(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> bool:
    return walk_bsp(tree, o, d, t_min, t_max, True).item >= 0
