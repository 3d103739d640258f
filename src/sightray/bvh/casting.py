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
from sightray.mathlib.lanes import (
    F32x16,
    abs16d,
    load16d,
    movemask16,
    round16,
    select16d,
    splat16,
    splat16d,
    store16d,
    vmax16d,
    vmin16d,
)
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at

ORIGIN, DIRECTION, END, PRIM = 0, 48, 96, 112
PACKET_WORDS = 128

# Words of the working memory of a packet, sixteen lanes each: rays in the unit frame, and what the decision needs.
UNIT_O, UNIT_D, UNIT_R, REACH, SLACK, SPEED, START, SHEAR, BEST = 0, 48, 96, 144, 160, 176, 192, 208, 256
WORK_WORDS = 272


@kernel
def cast_packet(mesh: Table, packet: Table, t_min: f64, work: Table) -> i64:
    """Bring a packet into the tree's unit frame, as `unit_ray` does: fills `work`; the bits of rays that meet the box."""
    scale, zero = splat16d(f64_at(mesh, SCALE)), splat16d(0.0)
    huge = splat16d(1e200)
    speed, slack, total = zero, zero, zero
    for axis in range(3):
        o = (load16d(packet, ORIGIN + 16 * axis) - splat16d(f64_at(mesh, CENTER + axis))) * scale
        d = abs16d(load16d(packet, DIRECTION + 16 * axis) * scale)
        speed, slack, total = vmax16d(speed, d), vmax16d(slack, abs16d(o)), total + abs16d(o) + d
        store16d(work, UNIT_O + 16 * axis, o)
    slack = vmin16d(splat16d(2.0**-20) + splat16d(2.0**-49) * slack, splat16d(0.01))

    # Cut the rays to the tree's box.
    first, last, unit = splat16d(t_min), load16d(packet, END), huge
    for axis in range(3):
        o, d = load16d(work, UNIT_O + 16 * axis), load16d(packet, DIRECTION + 16 * axis) * scale
        r = vmax16d(vmin16d(splat16d(1.0) / d, huge), zero - huge)
        half = slack + splat16d(f64_at(mesh, HALF + axis) + 2.0**-10)
        low, high = (zero - half - o) * r, (half - o) * r
        first, last = vmax16d(vmin16d(low, high), first), vmin16d(vmax16d(low, high), last)
        unit = vmin16d(abs16d(r), unit)
        store16d(work, UNIT_R + 16 * axis, vmax16d(vmin16d(r * speed, splat16d(1e18)), splat16d(-1e18)))
    fit = (
        (total < splat16d(math.inf))
        & (speed > splat16d(1e-100))
        & (speed < splat16d(1e100))
        & (splat16d(t_min) < load16d(packet, END))
    )
    reach = select16d(fit, (last - first) * speed, splat16d(-1.0))
    met = reach >= zero
    reach = select16d(met, reach, splat16d(-1.0))
    store16d(work, REACH, reach)
    store16d(work, SLACK, slack)
    store16d(work, SPEED, speed)
    store16d(work, START, first * speed)

    # Of rays that miss the box nothing is asked; where the others start is brought near the tree.
    for axis in range(3):
        o, d = load16d(work, UNIT_O + 16 * axis), load16d(packet, DIRECTION + 16 * axis) * scale
        store16d(work, UNIT_O + 16 * axis, select16d(met, o + d * first, zero))
        store16d(work, UNIT_D + 16 * axis, select16d(met, d * unit, zero))
    return movemask16(met)


@kernel
def share(packet: Table, work: Table, bits: i64) -> Shared:
    """What the rays `bits` of a packet have in common."""
    up_x = movemask16(load16d(work, UNIT_R) > splat16d(0.0)) & bits
    up_y = movemask16(load16d(work, UNIT_R + 16) > splat16d(0.0)) & bits
    up_z = movemask16(load16d(work, UNIT_R + 32) > splat16d(0.0)) & bits
    x, y, z = abs16d(load16d(packet, 48)), abs16d(load16d(packet, 64)), abs16d(load16d(packet, 80))
    by_z, by_y = movemask16((z >= x) & (z >= y)) & bits, movemask16(y >= x) & bits
    same = (up_x == 0 or up_x == bits) and (up_y == 0 or up_y == bits) and (up_z == 0 or up_z == bits)
    same &= by_z == bits or (by_z == 0 and (by_y == bits or by_y == 0))
    return Shared(same, up_x != 0, up_y != 0, up_z != 0, 2 if by_z != 0 else 1 if by_y != 0 else 0)


class Shared(NamedTuple):
    """What the rays of a packet have in common."""

    same: bool  # the rest is void if they do not share all of it
    x_up: bool  # whether they go up the axes
    y_up: bool
    z_up: bool
    axis: i64  # of their largest component


class BoxPacket(NamedTuple):
    """What meets a box, for each ray: x * rx - nx is the length to a near plane x, x * rx - fx to a far one."""

    rx: F32x16
    ry: F32x16
    rz: F32x16
    nx: F32x16
    ny: F32x16
    nz: F32x16
    fx: F32x16
    fy: F32x16
    fz: F32x16


@kernel
def near_lanes(work: Table, axis: i64, sign: f64) -> F32x16:
    """Origin times reciprocal direction, moved by the slack: ahead if `sign` is 1, back if it is -1."""
    r = load16d(work, UNIT_R + 16 * axis)
    return round16(load16d(work, UNIT_O + 16 * axis) * r + abs16d(r) * load16d(work, SLACK) * splat16d(sign))


@kernel
def box_packet(work: Table) -> BoxPacket:
    """Prepare a packet for boxes."""
    return BoxPacket(
        round16(load16d(work, UNIT_R)), round16(load16d(work, UNIT_R + 16)), round16(load16d(work, UNIT_R + 32)),
        near_lanes(work, 0, 1.0), near_lanes(work, 1, 1.0), near_lanes(work, 2, 1.0),
        near_lanes(work, 0, -1.0), near_lanes(work, 1, -1.0), near_lanes(work, 2, -1.0),
    )  # fmt: skip


class TrianglePacket(NamedTuple):
    """What meets a triangle, for each ray; as `TriangleRay`."""

    ox: F32x16
    oy: F32x16
    oz: F32x16
    dx: F32x16
    dy: F32x16
    dz: F32x16
    side: F32x16
    along: F32x16


@kernel
def triangle_packet(work: Table) -> TrianglePacket:
    """Prepare a packet for triangles."""
    slack = round16(load16d(work, SLACK))
    return TrianglePacket(
        round16(load16d(work, UNIT_O)), round16(load16d(work, UNIT_O + 16)), round16(load16d(work, UNIT_O + 32)),
        round16(load16d(work, UNIT_D)), round16(load16d(work, UNIT_D + 16)), round16(load16d(work, UNIT_D + 32)),
        splat16(16.0) * slack, splat16(3.0) * slack,
    )  # fmt: skip
