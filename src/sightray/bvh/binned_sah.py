"""Building the tree that `bvh8` walks, by the surface area heuristic over sixteen bins an axis.

All items are one range, which is split in two, and so on until at most `leaf_size` items are left. A split puts the items'
centres into bins along each axis and takes the border between bins that minimises area x number of leaves, summed over
both sides: the expected work of a ray that meets the range. Then `reinsertion` moves ranges that lie badly, and `collapse`
makes nodes of eight of them.

Ranges with nothing to choose (all centres coincide) are halved as they lie. So are all below a number of levels, if a tree
would otherwise be so deep that a ray's stack overflows, whatever the input: halving alone makes at most 26 levels. Before
that, such a tree is tried without moving ranges.

While building, a box is eight floats: its lower corner and 0, its negated upper corner and 0. So the union of two boxes is
one minimum. A *range* of items (a child in the making, or what fell into a bin) is a row of its box and a count.

Nothing is fused or reordered in the comparison of costs: Python and machine code build the same tree.

References: I. Wald, "On fast construction of SAH-based bounding volume hierarchies" (RT 2007); H. Dammertz, J. Hanika,
A. Keller, "Shallow bounding volume hierarchies" (EGSR 2008).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from sightray._jit import is_compiled, kernel, native
from sightray.bvh.bvh8 import CENTER, HALF, NODE_FLOATS, NODES, SCALE, int_at
from sightray.bvh.collapse import (
    COUNT,
    FIRST,
    HALVES,
    PLAN_WORDS,
    RANGE_WORDS,
    collapse,
    half_area,
    plan_ranges,
)
from sightray.bvh.reinsertion import reinsert
from sightray.mathlib.cores import core_count
from sightray.mathlib.lanes import (
    F32x4,
    extract4,
    high4,
    load4,
    load8,
    low4,
    splat4,
    splat8,
    store8,
    vmax4,
    vmin4,
    vmin8,
)
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import (
    Space,
    Table,
    advance,
    aligned,
    f32_put,
    f64_at,
    f64_put,
    i32_put,
    i64_at,
    i64_put,
    link,
    scratch,
)

BINS = 16
# Levels divided by area, and whether ranges are moved; the next if a ray might need too high a stack.
TRIES = ((48, True), (48, False), (24, False), (0, False))
MAX_ITEMS = 1 << 26
FEW = 64  # items that Python handles in a tenth of a second
SHARED_FROM = 1 << 15  # items that several threads divide
MOVED_FROM, MANY = 1 << 12, 1 << 16  # items: of fewer no ranges are moved, which takes half a second to compile, once
SHARE, SHARE_OF_MANY = 0.1, 0.3  # ranges of less of the mean surface are not moved; among more than `MANY` items


class Bvh8(NamedTuple):
    """A tree over boxes; see `bvh8` for what it means."""

    nodes: np.ndarray  # (m, 64) float32 on a cache line; children are integers
    order: np.ndarray  # (n,) int32: leaves are ranges of this permutation of the items; empty if they name blocks
    center: np.ndarray  # (3,) float64
    half: np.ndarray  # (3,) float64, in the unit frame
    scale: float


def build(lower: np.ndarray, upper: np.ndarray, leaf_size: int = 1) -> Bvh8:
    """Build a tree over finite boxes.

    Parameters
    ----------
    lower, upper : (n, 3) float64
        Corners of the items' boxes.
    leaf_size : 1, 2 or 4
        How many items a leaf holds at most; its cost counts as one for up to that many.
    """
    n = len(lower)
    corners = (lower.min(axis=0), upper.max(axis=0)) if n else (np.zeros(3), np.zeros(3))
    center, half, scale = unit_frame(*corners)
    boxes = aligned((n, 8), np.float32)
    boxes[:, 0:3] = (lower - center) * scale
    boxes[:, 4:7] = (center - upper) * scale
    nodes, order = build_tree(boxes, leaf_size)
    return Bvh8(nodes, order, center, half, scale)


def unit_frame(lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Of the frame in which a box is about one large: centre, half extents there, and scale."""
    center = 0.5 * lower + 0.5 * upper
    half = np.maximum(upper - center, center - lower)
    largest = float(half.max())
    if not math.isfinite(largest):
        raise ValueError(f"a tree needs finite boxes; got corners {lower.tolist()} and {upper.tolist()}")
    scale = math.ldexp(1.0, -max(-1000, math.frexp(largest)[1])) if largest > 0.0 else 1.0
    return center, half * scale, scale


def build_tree(boxes: np.ndarray, leaf_size: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and order of the tree over boxes in the unit frame, (n, 8) float32, which are permuted."""
    n = len(boxes)
    if n > MAX_ITEMS:
        raise ValueError(f"got {n} items; allowed: up to {MAX_ITEMS} in one tree")
    if leaf_size not in (1, 2, 4):
        raise ValueError(f"leaf size: got {leaf_size}; allowed: 1, 2, 4")
    order = np.arange(n, dtype=np.int32)
    for sah_levels, moving in TRIES:
        ranges = tree = divide_items(boxes, order, leaf_size, sah_levels)
        used = len(ranges)
        if moving and n >= MOVED_FROM:
            tree = aligned((used, RANGE_WORDS), np.int64)
            runnable(reinsert, n)(Table(ranges), used, SHARE_OF_MANY if n > MANY else SHARE, Table(tree))
        plans = aligned((used, PLAN_WORDS), np.int64)
        runnable(plan_ranges, n)(Table(tree), used, Table(plans))
        nodes = aligned((1 + used // 2, NODE_FLOATS), np.float32)
        filled = runnable(collapse, n)(Table(tree), Table(plans), leaf_size, Table(nodes))
        if filled > 0:
            break
    fitting = aligned((filled, NODE_FLOATS), np.float32)
    fitting[:] = nodes[:filled]
    return fitting, order


def divide_items(boxes: np.ndarray, order: np.ndarray, leaf_size: int, sah_levels: int) -> np.ndarray:
    """Divide all items into ranges, (m, 8) int64, permuting them; where they are many, parts by several threads."""
    n, threads = len(boxes), core_count() if len(boxes) >= SHARED_FROM else 1
    ranges = divide_part(boxes, order, leaf_size, n // (2 * threads) if threads > 1 else leaf_size, sah_levels)
    if threads == 1:
        return ranges
    levels = np.zeros(len(ranges), np.int64)
    for r in np.flatnonzero(ranges[:, HALVES]):
        levels[ranges[r, HALVES] : ranges[r, HALVES] + 2] = levels[r] + 1
    parts = np.flatnonzero((ranges[:, HALVES] == 0) & (ranges[:, COUNT] > leaf_size))
    parts = parts[np.argsort(-ranges[parts, COUNT], kind="stable")]  # the largest first, so that all end together

    def finish(r: int) -> np.ndarray:
        items = slice(ranges[r, FIRST], ranges[r, FIRST] + ranges[r, COUNT])
        return divide_part(boxes[items], order[items], leaf_size, leaf_size, max(sah_levels - int(levels[r]), 0))

    with ThreadPoolExecutor(threads) as pool:
        return join_parts(ranges, dict(zip(parts.tolist(), pool.map(finish, parts), strict=True)))


def divide_part(boxes: np.ndarray, order: np.ndarray, leaf_size: int, small: int, sah_levels: int) -> np.ndarray:
    """Divide items into ranges of at most `small`."""
    n = len(boxes)
    ranges = aligned((max(2 * n, 2), RANGE_WORDS), np.int64)
    inputs = Table(boxes), Table(order), n, leaf_size, small, sah_levels
    return ranges[: runnable(divide, n)(*inputs, Table(ranges))]


def join_parts(top: np.ndarray, parts: dict[int, np.ndarray]) -> np.ndarray:
    """One tree of its uppermost ranges and of what some of these were divided into, numbered as `divide` would do."""
    ranges = aligned((len(top) + sum(len(part) - 1 for part in parts.values()), RANGE_WORDS), np.int64)
    ranges[0], used, todo = top[0], 1, [(0, 0)]
    while todo:
        r, number = todo.pop()
        if (part := parts.get(r)) is not None:
            rest = ranges[used : used + len(part) - 1]
            rest[:] = part[1:]
            rest[:, FIRST] += top[r, FIRST]
            rest[:, HALVES] += np.where(rest[:, HALVES] > 0, used - 1, 0)
            ranges[number, HALVES] = used
            used += len(rest)
        elif top[r, HALVES] > 0:
            lower = int(top[r, HALVES])
            ranges[used : used + 2], ranges[number, HALVES] = top[lower : lower + 2], used
            todo += [(lower, used), (lower + 1, used + 1)]
            used += 2
    return ranges


def runnable(function: Callable, n: int) -> Callable:
    """A kernel as machine code, or as Python where so few items are not worth the seconds of compiling it."""
    return function if n <= FEW and not is_compiled(function) else native(function)


def pack_tree(space: Space, row: Table, tree: Bvh8) -> None:
    """Write a tree into the head of a row."""
    words = row.view(np.float64)
    link(row, NODES, space.array(tree.nodes))
    words[SCALE] = tree.scale
    words[CENTER : CENTER + 3] = tree.center
    words[HALF : HALF + 3] = tree.half


# ------------------------------------------------------------------------------------------------------------- kernels


@kernel
def divide(
    boxes: Table, order: Table, n: i64, leaf_size: i64, small: i64, sah_levels: i64, ranges: Table
) -> i64:  # fmt: skip
    """Divide n items into ranges of at most `small` (see `collapse`), permuting them; the number of ranges."""
    todo = scratch(256)  # ranges to divide, and their levels
    set_range(boxes, ranges, 0, n)
    i64_put(todo, 0, 0)
    i64_put(todo, 1, 0)
    top, used = 1, 1
    while top > 0:
        top -= 1
        row, level = advance(ranges, i64_at(todo, 2 * top) * RANGE_WORDS), i64_at(todo, 2 * top + 1)
        if i64_at(row, COUNT) <= small:
            i64_put(row, HALVES, 0)
            continue
        i64_put(row, HALVES, used)
        split(boxes, order, row, advance(ranges, used * RANGE_WORDS), leaf_size, level < sah_levels)
        for half in range(2):
            i64_put(todo, 2 * top, used + half)
            i64_put(todo, 2 * top + 1, level + 1)
            top += 1
        used += 2
    return used


@kernel
def set_range(boxes: Table, child: Table, first: i64, count: i64) -> None:
    """Make `child` the range of `count` items from `first` on, and find its box."""
    box = splat8(math.inf)
    for i in range(first, first + count):
        box = vmin8(box, load8(boxes, 8 * i))
    store8(child, 0, box)
    i64_put(child, FIRST, first)
    i64_put(child, COUNT, count)


@kernel
def split(boxes: Table, order: Table, whole: Table, halves: Table, leaf_size: i64, by_area: bool) -> None:
    """Divide a range into two, the rows of `halves`."""
    first, count = i64_at(whole, FIRST), i64_at(whole, COUNT)
    upper = advance(halves, RANGE_WORDS)
    if by_area:
        bins = scratch(384)
        grid = fill_bins(boxes, first, count, bins)
        border = best_border(bins, leaf_size)
        if border > 0:
            axis = border // BINS
            left = partition(boxes, order, first, count, grid, axis, border - axis * BINS)
            join_bins(bins, axis * BINS, border, first, halves)
            join_bins(bins, border, axis * BINS + BINS, first + left, upper)
            return
    set_range(boxes, halves, first, count // 2)
    set_range(boxes, upper, first + count // 2, count - count // 2)


@kernel
def join_bins(bins: Table, begin: i64, end: i64, first: i64, target: Table) -> None:
    """Make `target` the range of what fell into the bins from `begin` to before `end`, items from `first` on."""
    box, count = splat8(math.inf), 0
    for b in range(begin, end):
        box = vmin8(box, load8(bins, 16 * b))
        count += i64_at(bins, 8 * b + COUNT)
    store8(target, 0, box)
    i64_put(target, FIRST, first)
    i64_put(target, COUNT, count)


class Grid(NamedTuple):
    """Where bins lie along the three axes: those of twice the centre c are (c - low) * per_length."""

    low: F32x4
    per_length: F32x4


@kernel
def fill_bins(boxes: Table, first: i64, count: i64, bins: Table) -> Grid:
    """Lay `BINS` bins an axis between the outermost centres of a range, and put every item in one of each axis."""
    low, high = splat4(math.inf), splat4(-math.inf)
    for i in range(first, first + count):
        c = load4(boxes, 8 * i) - load4(boxes, 8 * i + 4)
        low, high = vmin4(low, c), vmax4(high, c)
    scale = scratch(2)
    for axis in range(3):
        extent = extract4(high, axis) - extract4(low, axis)
        f32_put(scale, axis, 0.999 * BINS / extent if extent > 1e-30 else 0.0)  # all into the first: no border
    grid = Grid(low, load4(scale, 0))
    for b in range(3 * BINS):
        store8(bins, 16 * b, splat8(math.inf))
        i64_put(bins, 8 * b + COUNT, 0)
    for i in range(first, first + count):
        box = load8(boxes, 8 * i)
        where = (low4(box) - high4(box) - grid.low) * grid.per_length
        for axis in range(3):
            b = axis * BINS + int(extract4(where, axis))
            store8(bins, 16 * b, vmin8(load8(bins, 16 * b), box))
            i64_put(bins, 8 * b + COUNT, i64_at(bins, 8 * b + COUNT) + 1)
    return grid


@kernel(exact=True)
def best_border(bins: Table, leaf_size: i64) -> i64:
    """The first bin (of those of all axes) on the upper side of the cheapest split; 0 if nothing can be split."""
    best, lowest = 0, math.inf
    costs = scratch(16)  # of the upper side
    for axis in range(3):
        box, count = splat8(math.inf), 0
        for b in range(BINS - 1, 0, -1):
            bin = advance(bins, (axis * BINS + b) * RANGE_WORDS)
            box = vmin8(box, load8(bin, 0))
            count += i64_at(bin, COUNT)
            f64_put(costs, b, half_area(box) * leaves(count, leaf_size) if count > 0 else math.inf)
        box, count = splat8(math.inf), 0
        for b in range(1, BINS):
            bin = advance(bins, (axis * BINS + b - 1) * RANGE_WORDS)
            box = vmin8(box, load8(bin, 0))
            count += i64_at(bin, COUNT)
            cost = f64_at(costs, b) + half_area(box) * leaves(count, leaf_size) if count > 0 else math.inf
            if cost < lowest:
                best, lowest = axis * BINS + b, cost
    return best


@kernel
def leaves(count: i64, leaf_size: i64) -> f64:
    """Places in the leaves that `count` items need; the leaf size is a power of two."""
    return float((count + leaf_size - 1) & -leaf_size)


@kernel
def partition(boxes: Table, order: Table, first: i64, count: i64, grid: Grid, axis: i64, border: i64) -> i64:
    """Sort a range into the items below the border and those above, in place; the number of the first (Hoare, 1961)."""
    i, j = first, first + count - 1
    while i <= j:
        box = load8(boxes, 8 * i)
        where = (low4(box) - high4(box) - grid.low) * grid.per_length
        if int(extract4(where, axis)) < border:
            i += 1
        else:
            store8(boxes, 8 * i, load8(boxes, 8 * j))
            store8(boxes, 8 * j, box)
            item = int_at(order, i)
            i32_put(order, i, int_at(order, j))
            i32_put(order, j, item)
            j -= 1
    return i - first
