"""Interval rays: one ray that stands for many, to find out which boxes none of them can meet.

It begins at the origin that is farthest along for near planes, at the one farthest behind for far planes, with the smallest
and the largest reciprocal direction (Boulos, Wald and Shirley 2006). Rays of a **group**, up to four packets, have one for
the eight boxes of a node; and each of the packets has its own for the boxes of the four triangles in a block: one operation
over sixteen lanes meets four triangles with four packets.

An interval ray is a ray with one more rounding of its origin, and boxes of triangles are found from rounded edges, 4u off:
with the 8u of `bvh8` still less than the 16u of slack that origins carry here.

Reference: S. Boulos, I. Wald, P. Shirley, "Geometric and arithmetic culling methods for entire ray packets" (2006).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.bvh.bvh8 import STACK_WORDS, Met, float_at
from sightray.bvh.casting import END_AT, FROM, SIDE, R
from sightray.bvh.triangles import EDGES, SIDES
from sightray.mathlib.lanes import (
    F32x4,
    F32x8,
    flip16,
    least16,
    load4,
    load8,
    load16,
    movemask16,
    repeat4,
    select16,
    splat4,
    splat8,
    splat16,
    store4,
    vmax4,
    vmax8,
    vmax16,
    vmin4,
    vmin8,
    vmin16,
)
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f32_put, f64_at, f64_put, i64_at

# Words of a group's row: what it visits next, its stack's height, its octant, the first of its packets, two bits for each
# packet that say which axis is largest, bits of packets whose shear is prepared, how far it reaches, how many rays are on
# their way; for each of four packets the bits of rays that have met something, and of all; then floats, of the interval ray,
# and of those of the packets; and the stack.
KEY, TOP, OCTANT, FIRST, AXES, SHEARED, REACHES, LEFT = 0, 1, 2, 3, 4, 5, 6, 7
MET, ALIVE, SLABS, HULLS, STACK = 8, 12, 16, 24, 128
GROUP_WORDS = STACK + STACK_WORDS + 16
PACKET_REACHES = 2 * HULLS + 192  # floats: how far the packets reach, four times each


class Interval(NamedTuple):
    """Of rays along one axis."""

    slowest: f64  # absolute reciprocal directions
    fastest: f64
    low: f64  # origins, with slack
    high: f64


@kernel
def interval(lanes: Table, axis: i64) -> Interval:
    """The extremes of a packet along one axis."""
    met, inf, zero = load16(lanes, END_AT) >= splat16(0.0), splat16(math.inf), splat16(0.0)
    o, slack = load16(lanes, FROM + 16 * axis), load16(lanes, SIDE) * splat16(1 / SIDES)
    r = load16(lanes, R + 16 * axis)
    r = flip16(r, r)
    slowest, fastest = least16(select16(met, r, inf)), -least16(select16(met, zero - r, inf))
    low = least16(select16(met, o - slack, inf))
    high = -least16(select16(met, zero - o - slack, inf))
    return Interval(slowest, fastest, low, high)


@kernel
def joined(a: Interval, b: Interval) -> Interval:
    """The extremes of two together."""
    return Interval(min(a.slowest, b.slowest), max(a.fastest, b.fastest), min(a.low, b.low), max(a.high, b.high))


@kernel
def is_close(a: Interval, spread: f64) -> bool:
    """Whether origins and directions lie within `spread` of one another."""
    return a.high - a.low <= spread and a.fastest - a.slowest <= spread * a.slowest * a.fastest  # 1/slowest - 1/fastest


class Extremes(NamedTuple):
    """Of rays along all axes."""

    x: Interval
    y: Interval
    z: Interval


@kernel
def extremes(lanes: Table) -> Extremes:
    """What bounds a packet."""
    return Extremes(interval(lanes, 0), interval(lanes, 1), interval(lanes, 2))


@kernel
def all_joined(a: Extremes, b: Extremes) -> Extremes:
    """What bounds two together."""
    return Extremes(joined(a.x, b.x), joined(a.y, b.y), joined(a.z, b.z))


@kernel
def are_close(e: Extremes, spread: f64) -> bool:
    """Whether one ray may stand for all."""
    return is_close(e.x, spread) and is_close(e.y, spread) and is_close(e.z, spread)


class Slab(NamedTuple):
    """The interval ray along an axis: x * a - n is the least length to a near plane x, x * b - f the largest to a far."""

    a: f64
    n: f64
    b: f64
    f: f64


@kernel
def slab(e: Interval, up: bool) -> Slab:
    """Prepare rays that go up or down an axis."""
    if up:
        return Slab(e.slowest, e.high * e.slowest, e.fastest, e.low * e.fastest)
    return Slab(-e.slowest, -e.low * e.slowest, -e.fastest, -e.high * e.fastest)


@kernel
def put_extremes(row: Table, e: Extremes) -> None:
    """Keep what bounds a packet."""
    put_interval(row, 0, e.x)
    put_interval(row, 4, e.y)
    put_interval(row, 8, e.z)


@kernel
def put_interval(row: Table, at: i64, e: Interval) -> None:
    """Keep the extremes along one axis."""
    f64_put(row, at, e.slowest)
    f64_put(row, at + 1, e.fastest)
    f64_put(row, at + 2, e.low)
    f64_put(row, at + 3, e.high)


@kernel
def extremes_at(row: Table) -> Extremes:
    """What bounds a packet."""
    return Extremes(interval_at(row, 0), interval_at(row, 4), interval_at(row, 8))


@kernel
def interval_at(row: Table, at: i64) -> Interval:
    """The extremes along one axis."""
    return Interval(f64_at(row, at), f64_at(row, at + 1), f64_at(row, at + 2), f64_at(row, at + 3))


@kernel
def put_slabs(group: Table, e: Extremes, octant: i64) -> None:
    """Prepare a group for boxes."""
    put_floats(group, 2 * SLABS, slab(e.x, octant & 1 != 0))
    put_floats(group, 2 * SLABS + 4, slab(e.y, octant & 2 != 0))
    put_floats(group, 2 * SLABS + 8, slab(e.z, octant & 4 != 0))


@kernel
def put_floats(group: Table, at: i64, s: Slab) -> None:
    """Write the numbers of one axis once."""
    f32_put(group, at, s.a)
    f32_put(group, at + 1, s.n)
    f32_put(group, at + 2, s.b)
    f32_put(group, at + 3, s.f)


@kernel
def lanes8_at(floats: Table, index: i64) -> F32x8:
    """A float, eight times."""
    return splat8(float_at(floats, index))


@kernel
def put_hull(group: Table, p: i64, e: Extremes, octant: i64) -> None:
    """Write the interval ray of a packet, four times each number, for triangles."""
    at = 2 * HULLS + 4 * p
    put_slab(group, at, slab(e.x, octant & 1 != 0))
    put_slab(group, at + 64, slab(e.y, octant & 2 != 0))
    put_slab(group, at + 128, slab(e.z, octant & 4 != 0))


@kernel
def put_slab(group: Table, at: i64, s: Slab) -> None:
    """Write the numbers of one axis."""
    store4(group, at, splat4(s.a))
    store4(group, at + 16, splat4(s.n))
    store4(group, at + 32, splat4(s.b))
    store4(group, at + 48, splat4(s.f))


@kernel
def put_reach(group: Table, p: i64, lanes: Table) -> None:
    """Note how far a packet and its group reach."""
    store4(group, PACKET_REACHES + 4 * p, splat4(-least16(splat16(0.0) - load16(lanes, END_AT))))
    reach = max(float_at(group, PACKET_REACHES), float_at(group, PACKET_REACHES + 4))
    reach = max(reach, float_at(group, PACKET_REACHES + 8), float_at(group, PACKET_REACHES + 12))
    f64_put(group, REACHES, reach)


@kernel
def meet_interval(nodes: Table, at: i64, group: Table) -> Met:
    """Which of the eight boxes of a node the group may meet."""
    octant, g = i64_at(group, OCTANT), 2 * SLABS
    x, y, z = 8 - 8 * (octant & 1), 24 - 4 * (octant & 2), 40 - 2 * (octant & 4)  # where the near planes stand
    near_x = load8(nodes, at + x) * lanes8_at(group, g) - lanes8_at(group, g + 1)
    far_x = load8(nodes, at + 8 - x) * lanes8_at(group, g + 2) - lanes8_at(group, g + 3)
    near_y = load8(nodes, at + y) * lanes8_at(group, g + 4) - lanes8_at(group, g + 5)
    far_y = load8(nodes, at + 40 - y) * lanes8_at(group, g + 6) - lanes8_at(group, g + 7)
    near_z = load8(nodes, at + z) * lanes8_at(group, g + 8) - lanes8_at(group, g + 9)
    far_z = load8(nodes, at + 72 - z) * lanes8_at(group, g + 10) - lanes8_at(group, g + 11)
    near = vmax8(vmax8(near_x, near_y), vmax8(near_z, splat8(0.0)))
    far = vmin8(vmin8(far_x, far_y), vmin8(far_z, splat8(f64_at(group, REACHES))))
    return Met(near, near <= far)


@kernel
def cull_triangles(blocks: Table, at: i64, group: Table) -> i64:
    """Which packets may meet which of the four triangles of a block, by their boxes: bit 4 p + i is of packet p."""
    octant, hull = i64_at(group, OCTANT), 2 * HULLS
    x = sides(blocks, at, octant & 1 != 0)
    y, z = sides(blocks, at + 4, octant & 2 != 0), sides(blocks, at + 8, octant & 4 != 0)
    near_x = repeat4(x.near) * load16(group, hull) - load16(group, hull + 16)
    far_x = repeat4(x.far) * load16(group, hull + 32) - load16(group, hull + 48)
    near_y = repeat4(y.near) * load16(group, hull + 64) - load16(group, hull + 80)
    far_y = repeat4(y.far) * load16(group, hull + 96) - load16(group, hull + 112)
    near_z = repeat4(z.near) * load16(group, hull + 128) - load16(group, hull + 144)
    far_z = repeat4(z.far) * load16(group, hull + 160) - load16(group, hull + 176)
    near = vmax16(vmax16(splat16(0.0), near_x), vmax16(near_y, near_z))
    far = vmin16(vmin16(load16(group, PACKET_REACHES), far_x), vmin16(far_y, far_z))
    return movemask16(near <= far)


class Sides(NamedTuple):
    """Of four triangles along one axis."""

    near: F32x4
    far: F32x4


@kernel
def sides(blocks: Table, at: i64, up: bool) -> Sides:
    """Where four triangles begin and end along one axis, as rays see it that go up or down."""
    a = load4(blocks, at)
    b, c = a + load4(blocks, at + EDGES), a + load4(blocks, at + 2 * EDGES)
    low, high = vmin4(vmin4(b, c), a), vmax4(vmax4(b, c), a)
    return Sides(low, high) if up else Sides(high, low)
