"""Building the tree that `bvh8` walks, by the surface area heuristic over sixteen bins an axis.

A node begins with one child, its whole range of items, and splits the child of the largest surface until there are eight
or only leaves are left. A split puts the items' centres into bins along each axis and takes the border between bins that
minimises area x number of leaves, summed over both sides: the expected work of a ray that meets the parent.

Ranges with nothing to choose (all centres coincide) are halved as they lie, and so is everything below `SAH_LEVELS`:
after that each level at least halves a range, so that a tree over 2^26 items has at most `MAX_LEVELS` levels and no
traversal stack overflows, whatever the input.

While building, a box is eight floats: its lower corner and 0, its negated upper corner and 0. So the union of two boxes is
one minimum. A *range* of items (a child in the making, or what fell into a bin) is a row of its box and a count.

Nothing is fused or reordered in the comparison of costs: Python and machine code build the same tree.

References: I. Wald, "On fast construction of SAH-based bounding volume hierarchies" (RT 2007); H. Dammertz, J. Hanika,
A. Keller, "Shallow bounding volume hierarchies" (EGSR 2008).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from sightray._jit import is_compiled, kernel, native
from sightray.bvh.bvh8 import CENTER, CHILDREN, HALF, LEAF, MAX_LEVELS, NODE_FLOATS, NODES, SCALE, int_at
from sightray.mathlib.lanes import (
    F32x4,
    F32x8,
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
    f32_at,
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
SAH_LEVELS = 26
MAX_ITEMS = 1 << 26
FEW = 64  # items that Python handles in a tenth of a second
assert SAH_LEVELS + 28 <= MAX_LEVELS

FIRST, COUNT, RANGE_WORDS = 4, 5, 8  # words of a range after those of its box


class Bvh8(NamedTuple):
    """A tree over boxes; see `bvh8` for what it means."""

    nodes: np.ndarray  # (m, 64) float32 on a cache line; children are integers
    order: np.ndarray  # (n,) int32: leaves are ranges of this permutation of the items
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
    # A node whose children are all leaves has more than leaf_size items below it; any other has eight children.
    capacity = 2 + n // 7 + 6 * n // (7 * (leaf_size + 1))
    nodes = aligned((capacity, NODE_FLOATS), np.float32)
    order = np.arange(n, dtype=np.int32)
    used = runnable(build_nodes, n)(Table(boxes), Table(order), n, leaf_size, Table(nodes))
    fitting = aligned((used, NODE_FLOATS), np.float32)
    fitting[:] = nodes[:used]
    return fitting, order


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
def build_nodes(boxes: Table, order: Table, n: i64, leaf_size: i64, nodes: Table) -> i64:
    """Fill `nodes` and permute `boxes` and `order`; the number of nodes."""
    todo = scratch(1536)  # nodes to fill: number, first item, count, level; as high as a traversal stack gets
    children = scratch(64)
    i64_put(todo, 0, 0)
    i64_put(todo, 1, 0)
    i64_put(todo, 2, n)
    i64_put(todo, 3, 0)
    top, used = 1, 1
    while top > 0:
        top -= 1
        node, level = i64_at(todo, 4 * top), i64_at(todo, 4 * top + 3)
        set_range(boxes, children, i64_at(todo, 4 * top + 1), i64_at(todo, 4 * top + 2))
        number = 1
        while number < 8:
            widest = widest_child(children, number, leaf_size)
            if widest < 0:
                break
            child, other = advance(children, widest * RANGE_WORDS), advance(children, number * RANGE_WORDS)
            split(boxes, order, child, other, leaf_size, level < SAH_LEVELS)
            number += 1
        for k in range(8):
            child = advance(children, k * RANGE_WORDS)
            count = i64_at(child, COUNT) if k < number else 0
            code = 0
            if count > leaf_size:  # a node, to be filled later
                i64_put(todo, 4 * top, used)
                i64_put(todo, 4 * top + 1, i64_at(child, FIRST))
                i64_put(todo, 4 * top + 2, count)
                i64_put(todo, 4 * top + 3, level + 1)
                code = used
                top += 1
                used += 1
            elif count > 0:
                code = LEAF + 8 * i64_at(child, FIRST) + count
            put_child(nodes, node * NODE_FLOATS + k, child, code)
    return used


@kernel
def put_child(nodes: Table, at: i64, child: Table, code: i64) -> None:
    """Write a child's box and code to its lane of a node; an empty box if it has no code."""
    for axis in range(3):
        f32_put(nodes, at + 16 * axis, float(f32_at(child, axis)) if code > 0 else math.inf)
        f32_put(nodes, at + 16 * axis + 8, -float(f32_at(child, 4 + axis)) if code > 0 else -math.inf)
    i32_put(nodes, at + CHILDREN, code)


@kernel
def widest_child(children: Table, number: i64, leaf_size: i64) -> i64:
    """Which child to split: that of the largest surface that is no leaf yet; -1 if all are."""
    widest, area = -1, -1.0
    for k in range(number):
        child = advance(children, k * RANGE_WORDS)
        its = half_area(load8(child, 0))
        if i64_at(child, COUNT) > leaf_size and its > area:
            widest, area = k, its
    return widest


@kernel(exact=True)
def half_area(box: F32x8) -> f64:
    """Half the surface of a box."""
    e = low4(box) + high4(box)  # negated extents
    x, y, z = extract4(e, 0), extract4(e, 1), extract4(e, 2)
    return x * y + y * z + z * x


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
def split(boxes: Table, order: Table, child: Table, other: Table, leaf_size: i64, by_area: bool) -> None:
    """Divide the range `child` into itself and `other`."""
    first, count = i64_at(child, FIRST), i64_at(child, COUNT)
    left = count // 2
    if by_area:
        bins = scratch(384)
        grid = fill_bins(boxes, first, count, bins)
        border = best_border(bins, leaf_size)
        if border > 0:
            axis = border // BINS
            left = partition(boxes, order, first, count, grid, axis, border - axis * BINS)
    set_range(boxes, child, first, left)
    set_range(boxes, other, first + left, count - left)


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
