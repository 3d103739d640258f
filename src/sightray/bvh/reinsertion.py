"""Better trees by reinsertion: ranges that lie badly are taken out of the binary tree and put where they cost least.

A split looks no further than its own two halves, so what is large, or far from its neighbours, may end up where it makes
all ranges around it large. Here each range in turn, with all below it, is removed with its parent, whose other half takes
the parent's place, and becomes the sibling of another range, below a parent that is new. That changes the surfaces of ranges
above the two places only, and is done where their sum, the work expected of rays in a binary tree, falls most.

The best place is found by branch and bound, from the range upwards: beside each of its ancestors, and below each ancestor's
other half. On the way down the ranges passed grow by what is put below them; since the new parent is at least as large as
the range itself, whatever cannot gain more than the best place so far is passed over.

Two rounds, the last ranges first, give most of what can be had (after four nothing gains any more). Ranges that are small
beside the others need not be tried: nearly all of the gain is without them, for less of the time.
Trees of even meshes gain next to nothing. They stay as they are: to rays it would be a matter of chance.

Where boxes overlap without end a search would look at all of them, and nested boxes make trees of any depth. So the ranges
looked at are counted, and no range moves that is so deep that rays' stacks overflow anyway.

Parents are kept in the last word of a range. The pair of rows that held a range and its sibling is used again for the range
and its new sibling, so that siblings stay neighbours; in the end all are numbered anew, from the root on, level by level.

References: J. Bittner, M. Hapala, V. Havran, "Fast insertion-based optimization of bounding volume hierarchies" (Computer
Graphics Forum, 2013); D. Meister, J. Bittner, "Parallel reinsertion for bounding volume hierarchy optimization" (Computer
Graphics Forum, 2018), whose search from below this is.
"""

from __future__ import annotations

from typing import NamedTuple

from sightray._jit import kernel
from sightray.bvh.bvh8 import STACK_WORDS
from sightray.bvh.collapse import HALVES, PARENT, RANGE_WORDS, half_area
from sightray.mathlib.lanes import F32x8, load8, load16, store8, store16, vmin8
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, advance, f64_at, f64_put, i64_at, i64_put, scratch

ROUNDS = 2
ROOM = 128  # ranges that a search has open at most: where a tree is so deep, it looks no further down
LOOKS, MOST_LOOKS = 32, 512  # at ranges: for each range that there is, and on the way down in one search
WORTH = 0.01  # of the surface, that all moves together save at least; otherwise the tree stays as it was
LEAST_GAIN = 1e-9  # of surface, in the unit frame, that is worth a move


@kernel
def reinsert(ranges: Table, used: i64, share: f64, result: Table) -> i64:
    """Move ranges of at least `share` of the mean surface to better places, and write the tree to `result`; moves made."""
    total, inner, gained, moves = 0.0, 0.0, 0.0, 0
    for r in range(used):
        copy_row(ranges, r, result, r)
        area = half_area(box_of(ranges, r))
        total += area
        inner += area if half_of(ranges, r) > 0 else 0.0
        adopt_halves(ranges, r)
    least, looks = share * total / float(used), LOOKS * used
    for _ in range(ROUNDS):
        for done in range(used - 1):
            x = used - 1 - done
            if looks > 0 and half_area(box_of(ranges, x)) >= least:
                place = find_place(ranges, x)
                looks -= place.looks
                if place.sibling >= 0:
                    move(ranges, x, place.sibling)
                    moves += 1
                    gained += place.gain
    if gained > WORTH * inner:
        renumber(ranges, used, result)
    return moves


class Place(NamedTuple):
    """Where a range lies best."""

    sibling: i64  # beside this range; -1 if it may as well stay where it is
    gain: f64  # surface that this saves
    looks: i64  # ranges looked at to find it


@kernel
def find_place(ranges: Table, x: i64) -> Place:
    """Find the range as whose sibling x (not the root) saves most surface."""
    box = box_of(ranges, x)
    own, best, most = half_area(box), -1, LEAST_GAIN
    open = scratch(256)  # ranges to look at, and what is saved if those above them grow by x
    parent, sibling = parent_of(ranges, x), sibling_of(x)
    pivot, beside = parent, sibling  # an ancestor of x, and its half that x is not in
    rest = box_of(ranges, sibling)  # of the pivot, without x
    saved = half_area(box_of(ranges, parent))  # by taking x out of all below the pivot
    looks, levels = 0, 0
    while levels < STACK_WORDS:
        levels += 1
        # Look below the half of the pivot that x is not in.
        i64_put(open, 0, beside)
        f64_put(open, 1, saved)
        top = 1
        while top > 0:
            top -= 1
            looks += 1
            y, left = i64_at(open, 2 * top), f64_at(open, 2 * top + 1)
            if left - own <= most:
                continue
            there = box_of(ranges, y)
            gain = left - half_area(vmin8(there, box))
            if gain > most and y != sibling:
                best, most = y, gain
            below, lower = gain + half_area(there), half_of(ranges, y)
            if lower > 0 and below - own > most and top + 2 <= ROOM and looks < MOST_LOOKS:
                for half in range(2):
                    i64_put(open, 2 * top, lower + half)
                    f64_put(open, 2 * top + 1, below)
                    top += 1

        # Go up: beside the pivot is a place as well, and for all others it shrinks.
        if pivot != parent:
            gain = saved - half_area(rest)
            if gain > most:
                best, most = pivot, gain
            saved = gain + half_area(box_of(ranges, pivot))
        if pivot == 0:
            return Place(best, most, looks)
        beside, pivot = sibling_of(pivot), parent_of(ranges, pivot)
        rest = vmin8(rest, box_of(ranges, beside))
    return Place(-1, 0.0, looks)


@kernel
def move(ranges: Table, x: i64, y: i64) -> None:
    """Make the range x the sibling of y, which is neither below it nor its parent or sibling."""
    parent, sibling = parent_of(ranges, x), sibling_of(x)
    pair = half_of(ranges, parent)
    taken = scratch(8)
    copy_row(ranges, x, taken, 0)
    put_range(ranges, parent, advance(ranges, sibling * RANGE_WORDS))
    enclose_halves(ranges, parent)
    put_range(ranges, pair, advance(ranges, y * RANGE_WORDS))
    put_range(ranges, pair + 1, taken)
    i64_put(ranges, y * RANGE_WORDS + HALVES, pair)
    adopt_halves(ranges, y)
    enclose_halves(ranges, y)


@kernel
def enclose_halves(ranges: Table, start: i64) -> None:
    """Compute the boxes of a range and all its ancestors from their halves; a leaf keeps its own."""
    r = start
    while True:
        lower = half_of(ranges, r)
        if lower > 0:
            store8(ranges, 2 * RANGE_WORDS * r, vmin8(box_of(ranges, lower), box_of(ranges, lower + 1)))
        if r == 0:
            return
        r = parent_of(ranges, r)


@kernel
def renumber(ranges: Table, used: i64, result: Table) -> None:
    """Copy a tree level by level: halves get larger numbers than their range."""
    copy_row(ranges, 0, result, 0)
    next = 1
    for r in range(used):
        lower = half_of(result, r)
        if lower > 0:
            copy_row(ranges, lower, result, next)
            copy_row(ranges, lower + 1, result, next + 1)
            i64_put(result, r * RANGE_WORDS + HALVES, next)
            next += 2


# ---------------------------------------------------------------------------------------------------- ranges and kin


@kernel
def box_of(ranges: Table, r: i64) -> F32x8:
    """The box of a range."""
    return load8(ranges, 2 * RANGE_WORDS * r)


@kernel
def half_of(ranges: Table, r: i64) -> i64:
    """The lower half of a range, 0 for a leaf."""
    return i64_at(ranges, r * RANGE_WORDS + HALVES)


@kernel
def parent_of(ranges: Table, r: i64) -> i64:
    """The range of which this is a half."""
    return i64_at(ranges, r * RANGE_WORDS + PARENT)


@kernel
def sibling_of(r: i64) -> i64:
    """The other half: lower halves have odd numbers."""
    return r + 1 if r & 1 == 1 else r - 1


@kernel
def adopt_halves(ranges: Table, r: i64) -> None:
    """Tell the halves of a range whose they are."""
    lower = half_of(ranges, r)
    if lower > 0:
        i64_put(ranges, lower * RANGE_WORDS + PARENT, r)
        i64_put(ranges, (lower + 1) * RANGE_WORDS + PARENT, r)


@kernel
def put_range(ranges: Table, r: i64, row: Table) -> None:
    """Make range r what a row says, but for its parent."""
    parent = parent_of(ranges, r)
    copy_row(row, 0, ranges, r)
    i64_put(ranges, r * RANGE_WORDS + PARENT, parent)
    adopt_halves(ranges, r)


@kernel
def copy_row(source: Table, r: i64, target: Table, to: i64) -> None:
    """Copy a row as it is."""
    store16(target, 2 * RANGE_WORDS * to, load16(source, 2 * RANGE_WORDS * r))
