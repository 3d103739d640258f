"""The tree over a scene's items: single precision finds whom to ask, and every item answers in double precision.

Items without finite bounds, such as planes, are listed apart and asked first: what they answer shortens the ray. Where
there are but a few items, all stand in that list: asking them takes less time than bringing the ray to a tree.
"""

from __future__ import annotations

import math

import numpy as np

from sightray._jit import implements, kernel
from sightray.accelerators.base import Accelerator, blocked, closest
from sightray.accelerators.item import ITEM_WORDS, MET, ItemHit, better, intersect_item, item_at, occluded_item, worth
from sightray.bvh.binned_sah import Bvh8, build, pack_tree
from sightray.bvh.bvh8 import (
    BOTTOM,
    CHILD,
    LEAF,
    NODES,
    STACK_WORDS,
    TREE_WORDS,
    box_ray,
    int_at,
    push_children,
    unit_ray,
    visit_last,
)
from sightray.mathlib.hit import is_hit
from sightray.mathlib.lanes import sort_key
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Space, Table, aligned, i64_at, i64_put, link, scratch, table_at
from sightray.mathlib.tally import TESTS, tally
from sightray.mathlib.vec import Vec3

# The row of a tree over items, after the head that all trees have.
ORDER = TREE_WORDS  # pointer to item numbers as 32-bit integers: leaves are ranges of these
ITEMS = TREE_WORDS + 1  # pointer to the items' rows
UNBOUNDED = TREE_WORDS + 2  # pointer to the numbers of the items outside the tree
UNBOUNDED_COUNT, BOUNDED_COUNT = TREE_WORDS + 3, TREE_WORDS + 4
LEAVES = TREE_WORDS + 5  # pointer to rows of `LEAF_FLOATS`, an item each, in the tree's order
ITEM_TREE_WORDS = TREE_WORDS + 6
# A leaf's row is a cache line: the item's box in the unit frame, lower corner and upper; the item's number as an integer;
# and the pointer to what rays meet, as in the item's row.
LEAF_FLOATS, LEAF_ITEM, LEAF_MET = 16, 6, 4
FEW = 3  # items for which no tree is walked


class Bvh(Accelerator):
    """8-wide bounding volume hierarchy built by the binned surface area heuristic; the default.

    References: I. Wald, "On fast construction of SAH-based bounding volume hierarchies" (RT 2007); I. Wald, C. Benthin,
    S. Boulos, "Getting rid of packets" (RT 2008).
    """

    merges_meshes = True
    steps_aside = True

    def build(self, space: Space, items: Table, lower: np.ndarray, upper: np.ndarray) -> Table:
        return pack_items(space, items, lower, upper)


def pack_items(space: Space, items: Table, lower: np.ndarray, upper: np.ndarray) -> Table:
    """The row of a tree over items with these bounds, each (n, 3) float64; those without bounds are infinite."""
    finite = np.isfinite(lower).all(axis=1) & np.isfinite(upper).all(axis=1)
    infinite = ~finite & (lower <= upper).all(axis=1)
    if finite.sum() <= FEW:
        finite, infinite = np.zeros_like(finite), finite | infinite
    bounded, unbounded = np.flatnonzero(finite).astype(np.int32), np.flatnonzero(infinite).astype(np.int32)
    # Bounds of moved shapes carry rounding errors of the size of their distance from the world's origin.
    error = 2.0**-48 * np.maximum(np.abs(lower[bounded]), np.abs(upper[bounded])).max(axis=1, initial=0.0)[:, None]
    tree = build(lower[bounded] - error, upper[bounded] + error, leaf_size=1)
    row = space.row(ITEM_TREE_WORDS)
    pack_tree(space, row, tree)
    link(row, ORDER, space.array(bounded[tree.order]))
    link(row, LEAVES, space.array(leaves_of(tree, lower[bounded] - error, upper[bounded] + error, items, bounded)))
    link(row, ITEMS, items)
    link(row, UNBOUNDED, space.array(unbounded))
    row.view(np.int64)[[UNBOUNDED_COUNT, BOUNDED_COUNT]] = len(unbounded), len(bounded)
    return row


def leaves_of(tree: Bvh8, lower: np.ndarray, upper: np.ndarray, items: Table, bounded: np.ndarray) -> np.ndarray:
    """The rows that `LEAVES` names, of a tree over the boxes of the items with the numbers `bounded`."""
    leaves, number = aligned((len(bounded), LEAF_FLOATS), np.float32), bounded[tree.order]
    leaves[:, 0:3] = ((lower - tree.center) * tree.scale)[tree.order]
    leaves[:, 3:6] = ((upper - tree.center) * tree.scale)[tree.order]
    leaves.view(np.int32)[:, LEAF_ITEM] = number
    leaves.view(np.int64)[:, LEAF_MET] = items.view(np.int64)[number.astype(np.int64) * ITEM_WORDS + MET]
    return leaves


@implements(closest, Bvh)
def closest_item(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> ItemHit:
    """Nearest hit of the ray o + t d with any item, t_min < t < t_max."""
    best = ItemHit(math.inf, -1, -1, 0.0, 0.0)
    for i in range(i64_at(tree, UNBOUNDED_COUNT)):
        best = nearer(tree, int_at(table_at(tree, UNBOUNDED), i), o, d, t_min, t_max, best)
    if i64_at(tree, BOUNDED_COUNT) == 0:
        return best
    unit = unit_ray(tree, o, d, t_min, min(t_max, best.t))
    reach = unit.reach
    if not reach >= 0.0:
        return best
    boxes = box_ray(unit)
    stack = scratch(STACK_WORDS)
    i64_put(stack, 0, 0)  # the root at no distance
    top = 1
    while top > 0:
        top -= 1
        key = i64_at(stack, top)
        child = key & CHILD
        if key > sort_key(reach):  # farther than the best hit
            continue
        if child < LEAF:
            top = push_children(table_at(tree, NODES), child, boxes, reach, stack, top)
            continue
        first, count = (child - LEAF) >> 3, child & 7
        for i in range(first, first + count):
            best = nearer(tree, int_at(table_at(tree, ORDER), i), o, d, t_min, t_max, best)
        reach = min(reach, best.t * unit.speed - unit.start + unit.slack)
    return best


@kernel
def nearer(tree: Table, index: i64, o: Vec3, d: Vec3, t_min: f64, t_max: f64, best: ItemHit) -> ItemHit:
    """The hit of an item if it is nearer than the best one so far, or else that one."""
    tally(TESTS)
    hit = intersect_item(item_at(table_at(tree, ITEMS), index), o, d, t_min, worth(best, t_max))
    found = ItemHit(hit.t, index, hit.prim, hit.u, hit.v)
    return found if is_hit(hit) and better(found, best) else best


@implements(blocked, Bvh)
def any_item(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> bool:
    """Whether any item stands between t_min and t_max."""
    items = table_at(tree, ITEMS)
    for i in range(i64_at(tree, UNBOUNDED_COUNT)):
        if occluded_item(item_at(items, int_at(table_at(tree, UNBOUNDED), i)), o, d, t_min, t_max):
            return True
    if i64_at(tree, BOUNDED_COUNT) == 0:
        return False
    unit = unit_ray(tree, o, d, t_min, t_max)
    if not unit.reach >= 0.0:
        return False
    boxes, nodes, stack = box_ray(unit), table_at(tree, NODES), scratch(STACK_WORDS)
    i64_put(stack, 0, BOTTOM)
    child, top = 0, 1
    while top > 0:
        if child < LEAF:
            next = visit_last(nodes, child, boxes, unit.reach, stack, top)
            if next.met:
                child, top = next.key, next.top
                continue
        else:
            first, count = (child - LEAF) >> 3, child & 7
            for i in range(first, first + count):
                if occluded_item(item_at(items, int_at(table_at(tree, ORDER), i)), o, d, t_min, t_max):
                    return True
        top -= 1
        child = i64_at(stack, top)
    return False
