"""The readable binary bounding volume hierarchy."""

from __future__ import annotations

import numpy as np

from sightray._jit import implements, kernel
from sightray.accelerators.base import blocked, closest
from sightray.accelerators.grow import MAX_DEPTH, MEDIAN_FROM, Level, grow_tree, halve
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

TO, COUNT, NODE_WORDS = 6, 7, 8  # after two corners: first child, or first primitive; primitives, 0 for inner nodes
TABLE = OWN
STACK = 128  # words: two for each level
assert 2 * MAX_DEPTH <= STACK


class Bvh2(_OverPrimitives):
    """Binary bounding volume hierarchy by the surface area heuristic, nearer child first.

    A random ray that meets a convex volume meets a smaller one inside it with the ratio of their surfaces as
    probability (L. Santalo's integral geometry). So a node cut into L and R is expected to cost

        traversal_cost + (area(L) count(L) + area(R) count(R)) / area(node)

    primitive tests, against count(node) for a leaf. Of all cuts between bins of centres along the three axes, the
    cheapest is taken: large empty spaces are cut off, and primitives that crowd together end up in tight boxes.

    The ray visits the nearer child first and keeps the other on a stack with the distance to its box; once a hit is
    nearer than that, the whole box is dropped unseen.

    The default, `Bvh`, is this idea with eight children a node, in single precision, and with single-precision filters.

    References
    ----------
    J. Goldsmith, J. Salmon, "Automatic creation of object hierarchies for ray tracing" (IEEE CG&A 1987); D. MacDonald,
    K. Booth, "Heuristics for ray tracing using space subdivision" (Visual Computer 1990); I. Wald, "On fast
    construction of SAH-based bounding volume hierarchies" (RT 2007): the bins.
    """

    bins: int = integer("places along each axis between which a cut may be", default=16, at_least=2, at_most=256)
    traversal_cost: float = number("of visiting a node, in primitive tests", default=1.0, at_least=0)
    leaf_size: int = integer("primitives in a leaf, at most", default=8, at_least=1)

    def grow(self, space: Space, row: Table, primitives: Primitives) -> np.ndarray:
        if not len(primitives.number):
            return primitives.number
        tree = grow_tree(primitives.lower, primitives.upper, self._divide)
        nodes = np.zeros((len(tree.child), NODE_WORDS))
        nodes[:, 0:3], nodes[:, 3:6] = tree.lower, tree.upper
        whole = nodes.view(np.int64)
        whole[:, TO], whole[:, COUNT] = np.where(tree.leaf, tree.first, tree.child), np.where(tree.leaf, tree.size, 0)
        link(row, TABLE, space.array(nodes))
        return primitives.number[tree.order]

    def _divide(self, level: Level, depth: int) -> tuple[np.ndarray, np.ndarray]:
        median, left = halve(level, self.leaf_size)
        if depth >= MEDIAN_FROM:
            return median, left
        cost, axis, border, bin = self._cheapest(level)
        area = half_area(level.box_lower, level.box_upper)
        expected = self.traversal_cost + cost / np.where(area > 0, area, 1.0)
        cut = np.isfinite(cost) & (level.size > 1) & ~((expected >= level.size) & (level.size <= self.leaf_size))
        above = bin[np.arange(len(level.node)), axis[level.node]] >= border[level.node]
        below = np.bincount(level.node, ~above, len(level.size)).astype(np.int64)
        # Where all centres coincide nothing can be chosen: what is too large for a leaf is halved.
        fallback = ~np.isfinite(cost)
        key = np.where(fallback[level.node], median, above)
        return key, np.where(cut, below, np.where(fallback, left, 0))

    def _cheapest(self, level: Level) -> tuple[np.ndarray, ...]:
        """For each node the least area x count, its axis and the first bin above the cut; for each primitive its bins."""
        k, bins = len(level.size), self.bins
        center = level.centers()
        low, high = np.minimum.reduceat(center, level.start), np.maximum.reduceat(center, level.start)
        extent = high - low
        scale = np.where(extent > 0, 0.999 * bins / np.where(extent > 0, extent, 1.0), 0.0)
        bin = ((center - low[level.node]) * scale[level.node]).astype(np.int64).clip(0, bins - 1)
        best, at, border = np.full(k, np.inf), np.zeros(k, np.int64), np.ones(k, np.int64)
        for axis in range(3):
            slot = level.node * bins + bin[:, axis]
            count = np.bincount(slot, minlength=k * bins).reshape(k, bins)
            lower, upper = np.full((k, bins, 3), np.inf), np.full((k, bins, 3), -np.inf)
            np.minimum.at(lower.reshape(-1, 3), slot, level.lower)
            np.maximum.at(upper.reshape(-1, 3), slot, level.upper)

            # Sweep from both ends: cost of what is below each border, and above.
            below = sweep(lower, upper, count)[:, :-1]
            above = sweep(lower[:, ::-1], upper[:, ::-1], count[:, ::-1])[:, ::-1][:, 1:]
            cost = below + above
            lowest = cost.argmin(axis=1)
            found = cost[np.arange(k), lowest]
            better = found < best
            best[better], at[better], border[better] = found[better], axis, lowest[better] + 1
        return best, at, border, bin


def half_area(lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Half the surface of boxes; of empty ones nothing that means anything."""
    x, y, z = np.moveaxis(upper - lower, -1, 0)
    return x * y + y * z + z * x


def sweep(lower: np.ndarray, upper: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Area x count of the first bins, up to each one; infinite where they hold nothing."""
    low, high, n = np.minimum.accumulate(lower, 1), np.maximum.accumulate(upper, 1), np.cumsum(count, 1)
    filled = n > 0
    return np.where(filled, half_area(np.where(filled[..., None], low, 0.0), np.where(filled[..., None], high, 0.0)) * n,
                    np.inf)  # fmt: skip


@kernel
def walk_bvh2(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64, any: bool) -> ItemHit:
    """Nearest hit, or with `any` whichever is found first."""
    nodes = table_at(tree, TABLE)
    if not is_ray(o, d):
        return no_item()
    ray = world_ray(o, d)
    best = nearest_unbounded(tree, ray, t_min, t_max)
    if is_null(nodes) or (any and best.item >= 0):
        return best
    root = meet_box(vec3_at(nodes, 0), vec3_at(nodes, 3), ray, t_min, min(t_max, best.t))
    if root.near > root.far:
        return best
    stack = scratch(128)  # of (node, t where the ray enters it)
    top, node = 0, 0
    while True:
        tally(NODES)
        at = NODE_WORDS * node
        to, count = i64_at(nodes, at + TO), i64_at(nodes, at + COUNT)
        descend = False
        if count > 0:
            best = nearest_listed(tree, table_at(tree, ORDER), to, count, ray, t_min, t_max, best)
            if any and best.item >= 0:
                return best
        else:
            # Meet both children; go on with the nearer and keep the other.
            end, left, right = min(t_max, best.t), NODE_WORDS * to, NODE_WORDS * to + NODE_WORDS
            a = meet_box(vec3_at(nodes, left), vec3_at(nodes, left + 3), ray, t_min, end)
            b = meet_box(vec3_at(nodes, right), vec3_at(nodes, right + 3), ray, t_min, end)
            if a.near <= a.far and b.near <= b.far:
                nearer = 0 if a.near <= b.near else 1
                node = to + nearer
                i64_put(stack, 2 * top, to + 1 - nearer)
                f64_put(stack, 2 * top + 1, max(a.near, b.near))
                top += 1
                descend = True
            elif a.near <= a.far or b.near <= b.far:
                node = to if a.near <= a.far else to + 1
                descend = True
        while not descend:
            if top == 0:
                return best
            top -= 1
            node = i64_at(stack, 2 * top)
            descend = f64_at(stack, 2 * top + 1) <= best.t


@implements(closest, Bvh2)
def closest_in_bvh2(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> ItemHit:
    return walk_bvh2(tree, o, d, t_min, t_max, False)


@implements(blocked, Bvh2)
def blocked_in_bvh2(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> bool:
    return walk_bvh2(tree, o, d, t_min, t_max, True).item >= 0
