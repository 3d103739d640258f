"""Which items the rays of a tile may meet: of most scenes few, so that nobody else need be asked.

All rays of a tile together are an *interval ray*: origins between two corners of a box, directions between two corners of
another. At the time t >= 0 it fills the box from ``o0 + t d0`` to ``o1 + t d1``, which meets the box of an item only
while six inequalities hold that are linear in t. Where they contradict one another, no ray of the tile meets the item.

Reference: S. Boulos, I. Wald, P. Shirley, "Geometric and arithmetic culling methods for entire ray packets" (2006).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.bvh.bvh8 import int_at
from sightray.cameras.base import _CORNER, _DOWN, _EYE, _RIGHT
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, i64_at, i64_put, is_null, table_at, vec3_at
from sightray.mathlib.vec import Vec3, vabs, vmax, vmin
from sightray.vision.record import BLOCK, BOXES, CAMERA, CAST_COUNT, CASTS, DIRECTION, LATTICE, ORIGIN, X, Y, record_at

MOST_CASTS = 64  # items up to which it is worth while to look at the boxes of all of them
MOST_PICKED = 12  # items up to which asking each of them is faster than the tree
BOX_WORDS = 8  # of an item: lower and upper corner
SLACK = 2.0**-30  # by which boxes are larger, in parts of the coordinates: far more than what hits are off by


class Times(NamedTuple):
    """When something may be: from first to last; never if these are the other way round."""

    first: f64
    last: f64


class IntervalRay(NamedTuple):
    """All rays of a tile: the least and the most of their coordinates."""

    o0: Vec3
    o1: Vec3
    d0: Vec3
    d1: Vec3


@kernel
def interval_ray(records: Table, count: i64) -> IntervalRay:
    """The interval ray of the first `count` records, at least one."""
    first = record_at(records, 0)
    o, d = vec3_at(first, ORIGIN), vec3_at(first, DIRECTION)
    o0, o1, d0, d1 = o, o, d, d
    for i in range(1, count):
        record = record_at(records, i)
        o, d = vec3_at(record, ORIGIN), vec3_at(record, DIRECTION)
        o0, o1, d0, d1 = vmin(o, o0), vmax(o, o1), vmin(d, d0), vmax(d, d1)  # what is no number changes nothing
    return IntervalRay(o0, o1, d0, d1)


@kernel
def interval_ray_of_pinhole(frame: Table, records: Table) -> IntervalRay:
    """The interval ray of a whole tile: directions are linear in the pixel, so those of its corners are the outermost."""
    camera = table_at(frame, CAMERA)
    eye = vec3_at(camera, _EYE)
    a, b = direction_of(camera, record_at(records, 0)), direction_of(camera, record_at(records, 19))
    c, d = direction_of(camera, record_at(records, 44)), direction_of(camera, record_at(records, 63))
    return IntervalRay(eye, eye, vmin(vmin(a, b), vmin(c, d)), vmax(vmax(a, b), vmax(c, d)))


@kernel
def direction_of(camera: Table, record: Table) -> Vec3:
    """The direction of a pinhole's ray, not of unit length."""
    x, y = f64_at(record, X), f64_at(record, Y)
    return vec3_at(camera, _CORNER) + vec3_at(camera, _RIGHT) * x + vec3_at(camera, _DOWN) * y


@kernel
def until(times: Times, speed: f64, way: f64) -> Times:
    """The part of times at which ``t * speed <= way``."""
    if speed > 0.0:
        return Times(times.first, min(times.last, way / speed))
    if speed < 0.0:
        return Times(max(times.first, way / speed), times.last)
    return Times(math.inf, 0.0) if speed == 0.0 and way < 0.0 else times


@kernel
def may_meet(rays: IntervalRay, lower: Vec3, upper: Vec3) -> bool:
    """Whether any of the rays may meet a box."""
    slack = (vmax(vabs(lower), vabs(upper)) + vmax(vabs(rays.o0), vabs(rays.o1))) * SLACK
    below, above = upper - rays.o0 + slack, rays.o1 - lower + slack
    times = until(until(Times(0.0, math.inf), rays.d0.x, below.x), -rays.d1.x, above.x)
    times = until(until(times, rays.d0.y, below.y), -rays.d1.y, above.y)
    times = until(until(times, rays.d0.z, below.z), -rays.d1.z, above.z)
    return not times.first > times.last


@kernel
def pick_items(frame: Table, records: Table, count: i64, picked: Table) -> i64:
    """Write the numbers of the items that rays of a tile may meet, ascending; how many. -1: too many to be asked."""
    casts, boxes, total = table_at(frame, CASTS), table_at(frame, BOXES), i64_at(frame, CAST_COUNT)
    if total == 0:
        return -1
    pinhole = count == BLOCK and not is_null(table_at(frame, LATTICE))
    rays = interval_ray_of_pinhole(frame, records) if pinhole else interval_ray(records, count)
    n = 0
    for k in range(total):
        if may_meet(rays, vec3_at(boxes, BOX_WORDS * k), vec3_at(boxes, BOX_WORDS * k + 4)):
            if n == MOST_PICKED:
                return -1
            i64_put(picked, n, int_at(casts, k))
            n += 1
    return n
