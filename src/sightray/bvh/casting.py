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
    abs16d,
    load16,
    load16d,
    movemask16,
    round16,
    select16d,
    splat16,
    splat16d,
    store16,
    store16d,
    vmax16d,
    vmin16d,
)
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at

ORIGIN, DIRECTION, END, PRIM = 0, 48, 96, 112
PACKET_WORDS = 128

# Words of the working memory of a packet, sixteen doubles each: what the decision needs, and rays in the unit frame.
SLACK, SPEED, START, SHEAR, UNIT_O, UNIT_R = 0, 16, 32, 48, 96, 144
WORK_WORDS = 192

# Floats of a packet's lanes, sixteen each, as boxes and triangles need them: x * R - NEAR is the length to a near plane x,
# x * R - FAR to a far one; origins and directions in the unit frame; slacks, see `TriangleRay`; and where rays end. Then,
# as integers, where a node has their near planes.
R, NEAR, FAR, FROM, TO, SIDE, ALONG, END_AT, PLANES = 0, 48, 96, 144, 192, 240, 256, 272, 288
LANE_WORDS = 168


@kernel
def cast_packet(mesh: Table, packet: Table, t_min: f64, work: Table, lanes: Table) -> i64:
    """Bring a packet into the tree's unit frame, as `unit_ray` does: fills `work` and `lanes`; who meets the tree's box."""
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
    store16(lanes, END_AT, round16(select16d(met, reach, splat16d(-1.0))))
    store16d(work, SLACK, slack)
    store16d(work, SPEED, speed)
    store16d(work, START, first * speed)
    store16(lanes, SIDE, round16(splat16d(16.0) * slack))
    store16(lanes, ALONG, round16(splat16d(3.0) * slack))

    # Of rays that miss the box nothing is asked; where the others start is brought near the tree.
    for axis in range(3):
        d, r = load16d(packet, DIRECTION + 16 * axis) * scale, load16d(work, UNIT_R + 16 * axis)
        o = select16d(met, load16d(work, UNIT_O + 16 * axis) + d * first, zero)
        store16(lanes, R + 16 * axis, round16(r))
        store16(lanes, NEAR + 16 * axis, round16(o * r + abs16d(r) * slack))
        store16(lanes, FAR + 16 * axis, round16(o * r - abs16d(r) * slack))
        store16(lanes, FROM + 16 * axis, round16(o))
        store16(lanes, TO + 16 * axis, round16(select16d(met, d * unit, zero)))
    return movemask16(met)


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
    x, y, z = abs16d(load16d(packet, 48)), abs16d(load16d(packet, 64)), abs16d(load16d(packet, 80))
    by_z, by_y = movemask16((z >= x) & (z >= y)) & bits, movemask16(y >= x) & bits
    same = (up_x == 0 or up_x == bits) and (up_y == 0 or up_y == bits) and (up_z == 0 or up_z == bits)
    same &= by_z == bits or (by_z == 0 and (by_y == bits or by_y == 0))
    octant = (1 if up_x != 0 else 0) | (2 if up_y != 0 else 0) | (4 if up_z != 0 else 0)
    return Shared(same, octant, 2 if by_z != 0 else 1 if by_y != 0 else 0)
