"""Sixteen rays at a time: packets, and how they are brought to a tree.

A **packet** is `PACKET_WORDS` doubles: sixteen x of the origins, y, z (0-47), sixteen x, y, z of the directions (48-95),
where each ray ends (`END`), and which triangle it has met (`PRIM`, written where one is found). A lane whose end is NaN,
or not beyond t_min, takes no part; so a packet may be partly filled.

`cast_packet` does for sixteen rays what `bvh8.unit_ray` does for one, with the same slack.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.bvh.bvh8 import CENTER, HALF, SCALE
from sightray.bvh.triangles import ALONGS, SIDES
from sightray.mathlib.lanes import (
    Mask16,
    abs16d,
    load16,
    load16d,
    movemask16,
    put_ints16,
    round16,
    select16,
    select16d,
    splat16,
    splat16d,
    store16,
    store16d,
    vmax16,
    vmax16d,
    vmin16,
    vmin16d,
    widen16,
)
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at

ORIGIN, DIRECTION, END, PRIM = 0, 48, 96, 112
PACKET_WORDS = 128

# Words of the working memory of a packet, sixteen doubles each: what the decision needs, and origins in the unit frame.
# Then origins with renamed axes, and two words of bits: whose largest component is z, and y (see `sixteen`).
SLACK, SPEED, START, SHEAR, UNIT_O, RENAMED_O, BY_Z, BY_Y = 0, 16, 32, 48, 96, 144, 192, 193
WORK_WORDS = 200

# Floats of a packet's lanes, sixteen each, as boxes and triangles need them: x * R - NEAR is the length to a near plane x,
# x * R - FAR to a far one; origins and directions in the unit frame; slacks, see `TriangleRay`; and where rays end. Then,
# as integers, where a node has their near planes. NEAR, FAR and PLANES are for rays that go each on its own (`cast_alone`).
R, NEAR, FAR, FROM, TO, SIDE, ALONG, END_AT, PLANES = 0, 48, 96, 144, 192, 240, 256, 272, 288
LANE_WORDS = 168

NEARBY = 512.0  # rays nearer to the tree than this, in units of it, are cut to its box in single precision
STEEPEST = 1e18  # reciprocal directions are no larger
MARGIN = 2.0**-10  # the box is larger by so much, so that hits on its faces lie well inside


@kernel
def cast_packet(mesh: Table, packet: Table, t_min: f64, work: Table, lanes: Table) -> i64:
    """Bring a packet into the tree's unit frame, as `unit_ray` does: fills `work` and `lanes`; who meets the tree's box."""
    scale, zero = splat16d(f64_at(mesh, SCALE)), splat16d(0.0)
    speed, total = zero, zero
    for axis in range(3):
        o = (load16d(packet, ORIGIN + 16 * axis) - splat16d(f64_at(mesh, CENTER + axis))) * scale
        d = abs16d(load16d(packet, DIRECTION + 16 * axis) * scale)
        speed, total = vmax16d(speed, d), total + abs16d(o) + d
        store16d(work, UNIT_O + 16 * axis, o)
    store16d(work, SPEED, speed)
    asked = movemask16(splat16d(t_min) < load16d(packet, END))
    near = movemask16((total < splat16d(NEARBY)) & (speed > splat16d(1e-30)))
    if asked & ~near == 0:  # whatever stands in lanes that take no part
        return cast_near(mesh, packet, t_min, work, lanes)
    return cast_far(mesh, packet, t_min, total < splat16d(math.inf), work, lanes)


@kernel
def cast_near(mesh: Table, packet: Table, t_min: f64, work: Table, lanes: Table) -> i64:
    """`cast_packet` for rays that start at most `NEARBY` away: single precision will do to cut them to the tree's box.

    Its errors there are below 2^-12, and the box is larger by `MARGIN`. Where rays start and end is found in doubles.
    """
    scale, speed = splat16d(f64_at(mesh, SCALE)), load16d(work, SPEED)
    pace, slack = round16(speed), 2.0**-20 + 2.0**-49 * NEARBY
    steepest, gentlest, unit = splat16(STEEPEST), splat16(-STEEPEST), splat16(1.0) / pace
    enter, leave = splat16(-math.inf), splat16(math.inf)
    for axis in range(3):
        o, d = round16(load16d(work, UNIT_O + 16 * axis)), round16(load16d(packet, DIRECTION + 16 * axis) * scale)
        r = vmax16(vmin16(pace / d, steepest), gentlest)
        half = splat16(f64_at(mesh, HALF + axis) + MARGIN)
        low, high = (splat16(0.0) - half - o) * r, (half - o) * r
        enter, leave = vmax16(vmin16(low, high), enter), vmin16(vmax16(low, high), leave)
        store16(lanes, R + 16 * axis, r)
        store16(lanes, TO + 16 * axis, d * unit)
    first = vmax16d(widen16(enter * unit), splat16d(t_min))
    start = first * speed
    reach = vmin16(round16((load16d(packet, END) - first) * speed), leave - round16(start))
    met = (reach >= splat16(0.0)) & (splat16d(t_min) < load16d(packet, END))
    store16(lanes, END_AT, select16(met, reach, splat16(-1.0)))
    store16d(work, SLACK, splat16d(slack))
    store16d(work, START, start)
    store16(lanes, SIDE, splat16(SIDES * slack))
    store16(lanes, ALONG, splat16(ALONGS * slack))
    for axis in range(3):
        o = load16d(work, UNIT_O + 16 * axis) + load16d(packet, DIRECTION + 16 * axis) * scale * first
        store16d(work, UNIT_O + 16 * axis, o)
        store16(lanes, FROM + 16 * axis, round16(o))
    return movemask16(met)


@kernel
def cast_far(mesh: Table, packet: Table, t_min: f64, finite: Mask16, work: Table, lanes: Table) -> i64:
    """`cast_packet` for all rays, in doubles."""
    scale, zero, huge = splat16d(f64_at(mesh, SCALE)), splat16d(0.0), splat16d(1e200)
    speed, farthest = load16d(work, SPEED), zero
    for axis in range(3):
        farthest = vmax16d(abs16d(load16d(work, UNIT_O + 16 * axis)), farthest)
    slack = vmin16d(splat16d(2.0**-20) + splat16d(2.0**-49) * farthest, splat16d(0.01))
    first, last, unit = splat16d(t_min), load16d(packet, END), huge
    for axis in range(3):
        o, d = load16d(work, UNIT_O + 16 * axis), load16d(packet, DIRECTION + 16 * axis) * scale
        r = vmax16d(vmin16d(splat16d(1.0) / d, huge), zero - huge)
        half = slack + splat16d(f64_at(mesh, HALF + axis) + MARGIN)
        low, high = (zero - half - o) * r, (half - o) * r
        first, last = vmax16d(vmin16d(low, high), first), vmin16d(vmax16d(low, high), last)
        unit = vmin16d(abs16d(r), unit)
        store16(lanes, R + 16 * axis, round16(vmax16d(vmin16d(r * speed, splat16d(STEEPEST)), splat16d(-STEEPEST))))
    fit = finite & (speed > splat16d(1e-100)) & (speed < splat16d(1e100)) & (splat16d(t_min) < load16d(packet, END))
    reach = select16d(fit, (last - first) * speed, splat16d(-1.0))
    met = reach >= zero
    store16(lanes, END_AT, round16(select16d(met, reach, splat16d(-1.0))))
    store16d(work, SLACK, slack)
    store16d(work, START, first * speed)
    store16(lanes, SIDE, round16(splat16d(SIDES) * slack))
    store16(lanes, ALONG, round16(splat16d(ALONGS) * slack))

    # Of rays that miss the box nothing is asked; where the others start is brought near the tree.
    for axis in range(3):
        d = load16d(packet, DIRECTION + 16 * axis) * scale
        o = select16d(met, load16d(work, UNIT_O + 16 * axis) + d * first, zero)
        store16d(work, UNIT_O + 16 * axis, o)
        store16(lanes, FROM + 16 * axis, round16(o))
        store16(lanes, TO + 16 * axis, round16(select16d(met, d * unit, zero)))
    return movemask16(met)


@kernel
def cast_alone(work: Table, lanes: Table) -> None:
    """What the rays of a packet need besides if each meets boxes on its own."""
    slack = load16d(work, SLACK)
    for axis in range(3):
        o, r = load16d(work, UNIT_O + 16 * axis), widen16(load16(lanes, R + 16 * axis))
        store16(lanes, NEAR + 16 * axis, round16(o * r + abs16d(r) * slack))
        store16(lanes, FAR + 16 * axis, round16(o * r - abs16d(r) * slack))
        lower, upper = splat16d(16.0 * axis), splat16d(16.0 * axis + 8.0)
        put_ints16(lanes, PLANES + 16 * axis, select16d(r > splat16d(0.0), lower, upper))


class Largest(NamedTuple):
    """Rays of a packet, a bit each, by the largest component of their direction; x where neither bit is set."""

    z: i64
    y: i64  # unless it is z


@kernel
def largest_of(packet: Table) -> Largest:
    """Which component is the largest, as `triangles.shear` decides it."""
    x, y = abs16d(load16d(packet, DIRECTION)), abs16d(load16d(packet, DIRECTION + 16))
    z = abs16d(load16d(packet, DIRECTION + 32))
    return Largest(movemask16((z >= x) & (z >= y)), movemask16(y >= x))


class Shared(NamedTuple):
    """What the rays of a packet have in common."""

    same: bool  # the rest is void if they do not share all of it
    octant: i64  # bit i is set if they go up axis i
    axis: i64  # of their largest component


@kernel
def share(packet: Table, lanes: Table, bits: i64) -> Shared:
    """What the rays `bits` of a packet have in common."""
    zero = splat16(0.0)
    up_x = movemask16(load16(lanes, R) > zero) & bits
    up_y = movemask16(load16(lanes, R + 16) > zero) & bits
    up_z = movemask16(load16(lanes, R + 32) > zero) & bits
    largest = largest_of(packet)
    by_z, by_y = largest.z & bits, largest.y & bits
    same = (up_x == 0 or up_x == bits) and (up_y == 0 or up_y == bits) and (up_z == 0 or up_z == bits)
    same &= by_z == bits or (by_z == 0 and (by_y == bits or by_y == 0))
    octant = (1 if up_x != 0 else 0) | (2 if up_y != 0 else 0) | (4 if up_z != 0 else 0)
    return Shared(same, octant, 2 if by_z != 0 else 1 if by_y != 0 else 0)
