"""One triangle against sixteen rays: the filter and the decision of `triangles`, lane by lane.

What the filter lets through is decided in doubles for all sixteen rays, with the same operations in the same order as for
a single ray: the hits are the same to the last bit. The rays of a packet share the axis of their largest component.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.bvh.bundles import float_at
from sightray.bvh.bvh8 import int_at
from sightray.bvh.casting import ALONG, DIRECTION, END_AT, FROM, SHEAR, SIDE, SLACK, SPEED, START, TO
from sightray.bvh.triangles import BLOCKS, EDGES, VERTICES
from sightray.mathlib.lanes import (
    F32x16,
    F64x16,
    flip4,
    flip16,
    load4,
    load16,
    load16d,
    movemask16,
    product16d,
    round16,
    select16d,
    splat16,
    splat16d,
    store4,
    store16d,
    vmax4,
    vmax16d,
    vmin16,
    vmin16d,
)
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, table_at


@kernel
def lanes_at(floats: Table, index: i64) -> F32x16:
    """A float, sixteen times."""
    return splat16(float_at(floats, index))


class FilteredLanes(NamedTuple):
    """Rays of a packet, one bit each."""

    maybe: i64  # those that may meet the triangle
    surely: i64  # those that meet it, whatever the rounding
    length: F32x16  # where, in single precision


@kernel
def edge_sizes(blocks: Table, at: i64, sizes: Table) -> None:
    """How large the four triangles of a block are: the larger 1-norm of their edges."""
    bx, by, bz = load4(blocks, at + EDGES), load4(blocks, at + EDGES + 4), load4(blocks, at + EDGES + 8)
    cx, cy, cz = load4(blocks, at + 2 * EDGES), load4(blocks, at + 2 * EDGES + 4), load4(blocks, at + 2 * EDGES + 8)
    b, c = flip4(bx, bx) + flip4(by, by) + flip4(bz, bz), flip4(cx, cx) + flip4(cy, cy) + flip4(cz, cz)
    store4(sizes, 0, vmax4(b, c))


@kernel
def filter_triangle(blocks: Table, at: i64, size: f64, lanes: Table) -> FilteredLanes:
    """`filter_block` for one triangle of that size and sixteen rays."""
    ax, ay, az = lanes_at(blocks, at), lanes_at(blocks, at + 4), lanes_at(blocks, at + 8)
    bx, by, bz = lanes_at(blocks, at + 12), lanes_at(blocks, at + 16), lanes_at(blocks, at + 20)
    cx, cy, cz = lanes_at(blocks, at + 24), lanes_at(blocks, at + 28), lanes_at(blocks, at + 32)
    dx, dy, dz = load16(lanes, TO), load16(lanes, TO + 16), load16(lanes, TO + 32)
    px, py, pz = dy * cz - dz * cy, dz * cx - dx * cz, dx * cy - dy * cx  # d x c
    sx, sy, sz = load16(lanes, FROM) - ax, load16(lanes, FROM + 16) - ay, load16(lanes, FROM + 32) - az
    qx, qy, qz = sy * bz - sz * by, sz * bx - sx * bz, sx * by - sy * bx  # s x b
    signed = bx * px + by * py + bz * pz
    det = flip16(signed, signed)
    u = flip16(sx * px + sy * py + sz * pz, signed)
    v = flip16(dx * qx + dy * qy + dz * qz, signed)
    edge, zero = splat16(size), splat16(0.0)
    side = edge * load16(lanes, SIDE)
    inside = vmin16(vmin16(u, v), det - (u + v))
    if movemask16(inside + side >= zero) == 0:
        return FilteredLanes(0, 0, zero)
    along = edge * edge * load16(lanes, ALONG)
    t = flip16(cx * qx + cy * qy + cz * qz, signed)
    ahead = vmin16(t, det * load16(lanes, END_AT) - t)
    maybe = (inside + side >= zero) & (ahead + along >= zero)
    return FilteredLanes(movemask16(maybe), movemask16((inside > side) & (ahead > along)), t / det)


@kernel(exact=True)
def prepare_shear(packet: Table, axis: i64, work: Table) -> None:
    """The shear of each ray, see `triangles.shear`: three numbers, all rays having their largest component in `axis`."""
    kx, ky = (axis + 1) % 3, (axis + 2) % 3
    sz = splat16d(1.0) / load16d(packet, DIRECTION + 16 * axis)
    store16d(work, SHEAR, load16d(packet, DIRECTION + 16 * kx) * sz)
    store16d(work, SHEAR + 16, load16d(packet, DIRECTION + 16 * ky) * sz)
    store16d(work, SHEAR + 32, sz)


@kernel(exact=True)
def decide_triangle(mesh: Table, packet: Table, work: Table, axis: i64, at: i64) -> F64x16:
    """`meet_triangle` for sixteen rays and the triangle at `at` of the blocks: where they meet it; NaN or inf if not."""
    vertices, blocks = table_at(mesh, VERTICES), table_at(mesh, BLOCKS)
    a, b, c = 3 * int_at(blocks, at), 3 * int_at(blocks, at + 4), 3 * int_at(blocks, at + 8)
    kx, ky = (axis + 1) % 3, (axis + 2) % 3
    oz, ox, oy = load16d(packet, 16 * axis), load16d(packet, 16 * kx), load16d(packet, 16 * ky)
    shear_x, shear_y = load16d(work, SHEAR), load16d(work, SHEAR + 16)
    az, bz = doubles_at(vertices, a + axis) - oz, doubles_at(vertices, b + axis) - oz
    cz = doubles_at(vertices, c + axis) - oz
    ax = doubles_at(vertices, a + kx) - ox - product16d(az, shear_x)
    ay = doubles_at(vertices, a + ky) - oy - product16d(az, shear_y)
    bx = doubles_at(vertices, b + kx) - ox - product16d(bz, shear_x)
    by = doubles_at(vertices, b + ky) - oy - product16d(bz, shear_y)
    cx = doubles_at(vertices, c + kx) - ox - product16d(cz, shear_x)
    cy = doubles_at(vertices, c + ky) - oy - product16d(cz, shear_y)
    ea = product16d(cx, by) - product16d(bx, cy)
    eb = product16d(ax, cy) - product16d(cx, ay)
    ec = product16d(bx, ay) - product16d(ax, by)
    zero = splat16d(0.0)
    inside = (vmin16d(vmin16d(ea, eb), ec) >= zero) | (vmax16d(vmax16d(ea, eb), ec) <= zero)
    along = product16d(ea, az) + product16d(eb, bz) + product16d(ec, cz)
    t = product16d(along, load16d(work, SHEAR + 32)) / (ea + eb + ec)  # NaN or infinite if the determinant is zero
    return select16d(inside, t, splat16d(math.nan))


@kernel
def doubles_at(vertices: Table, index: i64) -> F64x16:
    """A double, sixteen times."""
    return splat16d(f64_at(vertices, index))


@kernel
def reach_of(work: Table, t: F64x16) -> F32x16:
    """Length to t along each ray, and the slack."""
    return round16(t * load16d(work, SPEED) - load16d(work, START) + load16d(work, SLACK))
