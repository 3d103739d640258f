"""From a tree of two children a node to one of eight, of least expected cost for rays.

A **range** of items is a row of `RANGE_WORDS` words: its box (eight floats: lower corner and 0, negated upper corner and 0),
its first item and how many it has, and the number of its lower half; the upper half follows. A leaf has no halves. What a
range with halves says of items holds only until `reinsertion` moves ranges: theirs need not follow each other after that.

A node of eight takes in the halves of its range, halves of halves and so on. Which of them are to be nodes of their own is
decided by dynamic programming. Let C(r, i) be the least cost of range r as at most i children of a node: for one child it is
the surface of r, for visiting it, and the best distribution C(lower, k) + C(upper, 8 - k) of eight places over its halves;
for more it is the best distribution of i places, or C(r, i - 1). A leaf costs its surface. So few nodes have empty lanes.

Rays keep what they have yet to visit on a stack of `STACK_WORDS` words. A tree that may need more is given up.

Reference: H. Ylitie, T. Karras, S. Laine, "Efficient incoherent ray traversal on GPUs through compressed wide BVHs"
(HPG 2017), section 3.1.
"""

from __future__ import annotations

import math

from sightray._jit import kernel
from sightray.bvh.bvh8 import CHILDREN, LEAF, NODE_FLOATS, STACK_WORDS, int_at
from sightray.mathlib.lanes import F32x8, extract4, high4, load8, low4
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, advance, f32_at, f32_put, i32_put, i64_at, i64_put, scratch

FIRST, COUNT, HALVES, PARENT, RANGE_WORDS = 4, 5, 6, 7, 8  # words of a range after those of its box; see `reinsertion`
PLAN_WORDS = 8  # of a range's plan: C(r, i) as float i for i < 8, and as 32-bit integer 7 + i the lower half's places k


@kernel(exact=True)
def half_area(box: F32x8) -> f64:
    """Half the surface of a box."""
    e = low4(box) + high4(box)  # negated extents
    x, y, z = extract4(e, 0), extract4(e, 1), extract4(e, 2)
    return x * y + y * z + z * x


@kernel
def cost_at(plans: Table, r: i64, i: i64) -> f64:
    """C(r, i)."""
    return float(f32_at(plans, 2 * PLAN_WORDS * r + i))


@kernel
def plan_ranges(ranges: Table, n_ranges: i64, plans: Table) -> None:
    """Plan all ranges, halves first: they have larger numbers. No places (0) mean that one less serves as well."""
    for done in range(n_ranges):
        r = n_ranges - 1 - done
        row, at = advance(ranges, r * RANGE_WORDS), 2 * PLAN_WORDS * r
        area, lower = half_area(load8(row, 0)), i64_at(row, HALVES)
        if lower == 0:
            for i in range(1, 8):
                f32_put(plans, at + i, area)
            continue
        best = share_places(plans, lower, 8, at) + area
        f32_put(plans, at + 1, best)
        for i in range(2, 8):
            cost = share_places(plans, lower, i, at)
            if cost < best:
                best = cost
            else:
                i32_put(plans, at + 7 + i, 0)
            f32_put(plans, at + i, best)


@kernel
def share_places(plans: Table, lower: i64, i: i64, at: i64) -> f64:
    """Find the best distribution of i places over two halves and note it in the plan at `at`; its cost."""
    least = math.inf
    for k in range(1, i):
        cost = cost_at(plans, lower, k) + cost_at(plans, lower + 1, i - k)
        if cost < least:
            least = cost
            i32_put(plans, at + 7 + i, k)
    return least


@kernel
def collapse(ranges: Table, plans: Table, leaf_size: i64, nodes: Table) -> i64:
    """Fill `nodes` as planned; the number of nodes, or 0 if rays might need a higher stack."""
    todo = scratch(1536)  # nodes to fill: number, range, and the height of a ray's stack below it
    children = scratch(8)
    i64_put(todo, 0, 0)
    i64_put(todo, 1, 0)
    i64_put(todo, 2, 0)
    waiting, used = 1, 1
    while waiting > 0:
        waiting -= 1
        node, r, below = i64_at(todo, 3 * waiting), i64_at(todo, 3 * waiting + 1), i64_at(todo, 3 * waiting + 2)
        if below + 8 > STACK_WORDS:
            return 0
        number = gather_children(ranges, plans, r, children)
        for lane in range(8):
            code, child = 0, 0
            if lane < number:
                child = i64_at(children, lane)
                row = advance(ranges, child * RANGE_WORDS)
                if i64_at(row, HALVES) == 0:
                    code = LEAF + 8 * i64_at(row, FIRST) + i64_at(row, COUNT)
                else:  # a node, to be filled later
                    code = used
                    used += 1
                    i64_put(todo, 3 * waiting, code)
                    i64_put(todo, 3 * waiting + 1, child)
                    i64_put(todo, 3 * waiting + 2, below + number - 1)
                    waiting += 1
            put_child(nodes, node * NODE_FLOATS + lane, advance(ranges, child * RANGE_WORDS), code)
    return used


@kernel
def gather_children(ranges: Table, plans: Table, r: i64, children: Table) -> i64:
    """Find the up to eight ranges that become the children of the node of range r."""
    open, waiting, number = scratch(32), 0, 0  # ranges and the places they have
    i64_put(open, 0, r)
    i64_put(open, 1, 8)
    if i64_at(advance(ranges, r * RANGE_WORDS), COUNT) > 0:
        waiting = 1
    while waiting > 0:
        waiting -= 1
        part, i = i64_at(open, 2 * waiting), i64_at(open, 2 * waiting + 1)
        lower = i64_at(advance(ranges, part * RANGE_WORDS), HALVES)
        while lower > 0 and 1 < i and int_at(plans, 2 * PLAN_WORDS * part + 7 + i) == 0:
            i -= 1
        if lower == 0 or i == 1:
            i64_put(children, number, part)
            number += 1
            continue
        k = int_at(plans, 2 * PLAN_WORDS * part + 7 + i)
        i64_put(open, 2 * waiting, lower)
        i64_put(open, 2 * waiting + 1, k)
        i64_put(open, 2 * waiting + 2, lower + 1)
        i64_put(open, 2 * waiting + 3, i - k)
        waiting += 2
    return number


@kernel
def put_child(nodes: Table, at: i64, child: Table, code: i64) -> None:
    """Write a child's box and code to its lane of a node; an empty box if it has no code."""
    for axis in range(3):
        f32_put(nodes, at + 16 * axis, float(f32_at(child, axis)) if code > 0 else math.inf)
        f32_put(nodes, at + 16 * axis + 8, -float(f32_at(child, 4 + axis)) if code > 0 else -math.inf)
    i32_put(nodes, at + CHILDREN, code)
