"""Walking the 8-wide tree for a point: the nearest box first, and none that is farther than the best answer.

Distances are squared, in the tree's unit frame and in double precision: a point may be far away, where single precision
would not tell boxes apart. Corners of boxes are single precision, rounded by up to 2^-24; boxes are grown by twice that,
so that none is taken to be farther than what it holds.

Reference: N. Roussopoulos, S. Kelley, F. Vincent, "Nearest neighbor queries" (SIGMOD 1995).
"""

from __future__ import annotations

import math

from sightray._jit import kernel
from sightray.bvh.bvh8 import CENTER, CHILDREN, NODE_FLOATS, SCALE, int_at
from sightray.mathlib.lanes import sort_key
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f32_at, f64_at, i64_at, i64_put, vec3_at
from sightray.mathlib.vec import Vec3

GROWN = 2.0**-23


@kernel
def to_unit(tree: Table, p: Vec3) -> Vec3:
    """A point in the tree's unit frame."""
    return (p - vec3_at(tree, CENTER)) * f64_at(tree, SCALE)


@kernel
def gap(nodes: Table, at: i64, x: f64) -> f64:
    """How far a coordinate lies outside a child's box along one axis."""
    return max(float(f32_at(nodes, at)) - x, x - float(f32_at(nodes, at + 8)), GROWN) - GROWN


@kernel
def push_nearest(nodes: Table, node: i64, p: Vec3, limit: f64, stack: Table, top: i64) -> i64:
    """Push keys of the children within the squared distance `limit`, the nearest last; the stack's new height."""
    base, first = top, node * NODE_FLOATS
    for lane in range(8):
        child = int_at(nodes, first + CHILDREN + lane)
        if child == 0:  # there is none
            continue
        x, y, z = gap(nodes, first + lane, p.x), gap(nodes, first + 16 + lane, p.y), gap(nodes, first + 32 + lane, p.z)
        square = x * x + y * y + z * z
        if not (square <= limit and square < math.inf):
            continue
        key = sort_key(square) | child
        i = top
        while i > base and i64_at(stack, i - 1) < key:
            i64_put(stack, i, i64_at(stack, i - 1))
            i -= 1
        i64_put(stack, i, key)
        top += 1
    return top
