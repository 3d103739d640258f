"""A plain hierarchy of bounding volumes."""

from __future__ import annotations

import numpy as np

from sightray._jit import implements, kernel
from sightray.accelerators.base import blocked, closest
from sightray.accelerators.grow import Tree, grow_tree, halve
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
from sightray.accelerators.world_ray import WorldRay, meet_box, world_ray
from sightray.fields import choice, integer
from sightray.mathlib.rays import is_ray
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Space, Table, f64_at, i64_at, link, table_at, vec3_at
from sightray.mathlib.tally import NODES, tally
from sightray.mathlib.vec import Vec3, dot

# A node: two corners (6 words), or a centre and a radius (4); then these.
SKIP, FIRST, COUNT, NODE_WORDS = 6, 7, 8, 10
TABLE, NODE_COUNT, SPHERES = OWN, OWN + 1, OWN + 2


class Bounds(_OverPrimitives):
    """Hierarchy of bounding volumes, halved at the median: if a ray misses a volume, it misses all that is in it.

    Put a box around the whole scene, sort the primitives along its longest side, and give each half a box of its own;
    go on until few are left. A ray that misses a box skips everything in it: one test in place of thousands. Spheres
    are cheaper to meet than boxes and fit worse; which wins is for the counts to say.

    Nodes are stored depth first, each with the number of the node to go on with if its volume is missed, so that the
    traversal is one loop without recursion or stack. It is in no order along the ray, and knows nothing of costs: the
    starting point that `Bvh2` improves on.

    References
    ----------
    J. Clark, "Hierarchical geometric models for visible surface algorithms" (CACM 1976); S. Rubin, T. Whitted,
    "A 3-dimensional representation for fast rendering of complex scenes" (SIGGRAPH 1980); T. Kay, J. Kajiya, "Ray
    tracing complex scenes" (SIGGRAPH 1986); B. Smits, "Efficiency issues for ray tracing" (JGT 1998): the skip links.
    """

    volume: str = choice("what surrounds the primitives of a node", ["box", "sphere"], default="box")
    leaf_size: int = integer("primitives in a leaf, at most", default=2, at_least=1)

    def grow(self, space: Space, row: Table, primitives: Primitives) -> np.ndarray:
        if not len(primitives.number):
            return primitives.number
        tree = grow_tree(primitives.lower, primitives.upper, lambda level, _: halve(level, self.leaf_size))
        place, size = depth_first(tree)
        nodes = np.zeros((len(place), NODE_WORDS))
        if self.volume == "box":
            nodes[place, 0:3], nodes[place, 3:6] = tree.lower, tree.upper
        else:
            nodes[place, 0:3] = 0.5 * (tree.lower + tree.upper)
            nodes[place, 3] = radii(tree, primitives)
        whole = nodes.view(np.int64)
        whole[place, SKIP] = place + size
        whole[place, FIRST], whole[place, COUNT] = tree.first, np.where(tree.leaf, tree.size, 0)
        link(row, TABLE, space.array(nodes))
        words = row.view(np.int64)
        words[NODE_COUNT], words[SPHERES] = len(nodes), self.volume == "sphere"
        return primitives.number[tree.order]


def depth_first(tree: Tree) -> tuple[np.ndarray, np.ndarray]:
    """For each node its place in depth-first order, and how many nodes it and all below it are."""
    size = np.ones(len(tree.child), np.int64)
    place = np.zeros(len(tree.child), np.int64)
    inner = np.flatnonzero(~tree.leaf).tolist()
    for node in reversed(inner):  # children stand behind their parents
        size[node] += size[tree.child[node]] + size[tree.child[node] + 1]
    for node in inner:
        left = tree.child[node]
        place[left] = place[node] + 1
        place[left + 1] = place[left] + size[left]
    return place, size


def radii(tree: Tree, primitives: Primitives) -> np.ndarray:
    """Of spheres about the centres of the nodes' boxes that contain the boxes of their primitives."""
    lower, upper = primitives.lower[tree.order], primitives.upper[tree.order]
    center, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    found = np.empty(len(tree.child))
    for node, (first, count) in enumerate(zip(tree.first.tolist(), tree.size.tolist(), strict=True)):
        middle, its = 0.5 * (tree.lower[node] + tree.upper[node]), slice(first, first + count)
        farthest = np.abs(center[its] - middle) + half[its]
        found[node] = np.sqrt((farthest**2).sum(axis=1).max())
    return found * (1.0 + 2.0**-40)


@kernel
def meets_volume(nodes: Table, at: i64, spheres: bool, ray: WorldRay, t_min: f64, t_max: f64) -> bool:
    """Whether the ray meets the volume of a node between t_min and t_max."""
    if not spheres:
        span = meet_box(vec3_at(nodes, at), vec3_at(nodes, at + 3), ray, t_min, t_max)
        return span.near <= span.far
    # The point of the ray between t_min and t_max that is nearest to the centre.
    center, radius = vec3_at(nodes, at), f64_at(nodes, at + 3) + 4.0 * ray.slack
    t = min(max(dot(center - ray.o, ray.d) / dot(ray.d, ray.d), t_min), t_max)
    to = ray.o + ray.d * t - center
    return dot(to, to) <= radius * radius


@kernel
def walk_bounds(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64, any: bool) -> ItemHit:
    """Nearest hit, or with `any` whichever is found first."""
    if not is_ray(o, d):
        return no_item()
    ray = world_ray(o, d)
    best = nearest_unbounded(tree, ray, t_min, t_max)
    nodes, spheres = table_at(tree, TABLE), i64_at(tree, SPHERES) != 0
    node, end = 0, i64_at(tree, NODE_COUNT)
    while node < end and not (any and best.item >= 0):
        tally(NODES)
        at = node * NODE_WORDS
        if meets_volume(nodes, at, spheres, ray, t_min, min(t_max, best.t)):
            first, count = i64_at(nodes, at + FIRST), i64_at(nodes, at + COUNT)
            best = nearest_listed(tree, table_at(tree, ORDER), first, count, ray, t_min, t_max, best)
            node += 1
        else:
            node = i64_at(nodes, at + SKIP)
    return best


@implements(closest, Bounds)
def closest_in_bounds(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> ItemHit:
    return walk_bounds(tree, o, d, t_min, t_max, False)


@implements(blocked, Bounds)
def blocked_in_bounds(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> bool:
    return walk_bounds(tree, o, d, t_min, t_max, True).item >= 0
