"""One triangle against sixteen rays: the filter and the decision of `triangles`, lane by lane.

What the filter lets through is decided in doubles for all sixteen rays, with the same operations in the same order as for
a single ray: the hits are the same to the last bit. Coherent rays share the axis of their largest component; where they do
not, axes are renamed for each ray.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.bvh.bvh8 import float_at, int_at
from sightray.bvh.casting import (
    ALONG,
    BY_Y,
    BY_Z,
    DIRECTION,
    END,
    END_AT,
    FROM,
    ORIGIN,
    PRIM,
    RENAMED_O,
    SHEAR,
    SIDE,
    SLACK,
    SPEED,
    START,
    TO,
    largest_of,
)
from sightray.bvh.triangles import BLOCKS, EDGES, VERTICES
from sightray.mathlib.lanes import (
    F32x16,
    F64x16,
    Mask16,
    flip4,
    flip16,
    load4,
    load16,
    load16d,
    mask16,
    movemask16,
    product16d,
    round16,
    select16,
    select16d,
    splat16,
    splat16d,
    store4,
    store16,
    store16d,
    vmax4,
    vmax16d,
    vmin16,
    vmin16d,
)
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, i64_at, i64_put, table_at


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
def seen_corner(vertices: Table, at: i64, packet: Table, work: Table, axis: i64) -> Corner:
    """A corner as rays see it that all have their largest component in `axis`."""
    kx, ky = (axis + 1) % 3, (axis + 2) % 3
    z = doubles_at(vertices, at + axis) - load16d(packet, 16 * axis)
    x = doubles_at(vertices, at + kx) - load16d(packet, 16 * kx) - product16d(z, load16d(work, SHEAR))
    y = doubles_at(vertices, at + ky) - load16d(packet, 16 * ky) - product16d(z, load16d(work, SHEAR + 16))
    return Corner(x, y, z)


@kernel
def decide_triangle(mesh: Table, packet: Table, work: Table, axis: i64, at: i64) -> F64x16:
    """`meet_triangle` for sixteen rays and the triangle at `at` of the blocks: where they meet it; NaN or inf if not."""
    vertices, blocks = table_at(mesh, VERTICES), table_at(mesh, BLOCKS)
    a = seen_corner(vertices, 3 * int_at(blocks, at), packet, work, axis)
    b = seen_corner(vertices, 3 * int_at(blocks, at + 4), packet, work, axis)
    c = seen_corner(vertices, 3 * int_at(blocks, at + 8), packet, work, axis)
    return depth_of(a, b, c, load16d(work, SHEAR + 32))


@kernel
def renamed(by_z: Mask16, by_y: Mask16, x: F64x16, y: F64x16, z: F64x16) -> F64x16:
    """Of three values, that of the ray's own: `z` where the largest component is z, and so on."""
    return select16d(by_z, z, select16d(by_y, y, x))


@kernel(exact=True)
def prepare_own_shears(packet: Table, work: Table) -> None:
    """`prepare_shear` where each ray has an axis of its own; origins with axes renamed accordingly."""
    largest = largest_of(packet)
    i64_put(work, BY_Z, largest.z)
    i64_put(work, BY_Y, largest.y)
    by_z, by_y = mask16(largest.z), mask16(largest.y)
    x, y, z = load16d(packet, DIRECTION), load16d(packet, DIRECTION + 16), load16d(packet, DIRECTION + 32)
    sz = splat16d(1.0) / renamed(by_z, by_y, x, y, z)
    store16d(work, SHEAR, renamed(by_z, by_y, y, z, x) * sz)
    store16d(work, SHEAR + 16, renamed(by_z, by_y, z, x, y) * sz)
    store16d(work, SHEAR + 32, sz)
    x, y, z = load16d(packet, ORIGIN), load16d(packet, ORIGIN + 16), load16d(packet, ORIGIN + 32)
    store16d(work, RENAMED_O, renamed(by_z, by_y, y, z, x))
    store16d(work, RENAMED_O + 16, renamed(by_z, by_y, z, x, y))
    store16d(work, RENAMED_O + 32, renamed(by_z, by_y, x, y, z))


class Corner(NamedTuple):
    """A corner of a triangle as sixteen rays see it: axes renamed, from their origins, sheared."""

    x: F64x16
    y: F64x16
    z: F64x16


@kernel(exact=True)
def own_corner(vertices: Table, at: i64, work: Table) -> Corner:
    """The corner that begins at number `at` of the vertices."""
    by_z, by_y = mask16(i64_at(work, BY_Z)), mask16(i64_at(work, BY_Y))
    x, y, z = doubles_at(vertices, at), doubles_at(vertices, at + 1), doubles_at(vertices, at + 2)
    kx = renamed(by_z, by_y, y, z, x) - load16d(work, RENAMED_O)
    ky = renamed(by_z, by_y, z, x, y) - load16d(work, RENAMED_O + 16)
    kz = renamed(by_z, by_y, x, y, z) - load16d(work, RENAMED_O + 32)
    return Corner(kx - product16d(kz, load16d(work, SHEAR)), ky - product16d(kz, load16d(work, SHEAR + 16)), kz)


@kernel
def decide_for_each(mesh: Table, work: Table, at: i64) -> F64x16:
    """`decide_triangle` where each ray has an axis of its own, after `prepare_own_shears`."""
    vertices, blocks = table_at(mesh, VERTICES), table_at(mesh, BLOCKS)
    a, b = own_corner(vertices, 3 * int_at(blocks, at), work), own_corner(vertices, 3 * int_at(blocks, at + 4), work)
    return depth_of(a, b, own_corner(vertices, 3 * int_at(blocks, at + 8), work), load16d(work, SHEAR + 32))


@kernel(exact=True)
def depth_of(a: Corner, b: Corner, c: Corner, sz: F64x16) -> F64x16:
    """Where rays meet a triangle whose corners are sheared; NaN or infinite if they do not."""
    ea = product16d(c.x, b.y) - product16d(b.x, c.y)
    eb = product16d(a.x, c.y) - product16d(c.x, a.y)
    ec = product16d(b.x, a.y) - product16d(a.x, b.y)
    zero = splat16d(0.0)
    inside = (vmin16d(vmin16d(ea, eb), ec) >= zero) | (vmax16d(vmax16d(ea, eb), ec) <= zero)
    along = product16d(ea, a.z) + product16d(eb, b.z) + product16d(ec, c.z)
    t = product16d(along, sz) / (ea + eb + ec)  # NaN or infinite if the determinant is zero
    return select16d(inside, t, splat16d(math.nan))


@kernel
def doubles_at(vertices: Table, index: i64) -> F64x16:
    """A double, sixteen times."""
    return splat16d(f64_at(vertices, index))


@kernel
def reach_of(work: Table, t: F64x16) -> F32x16:
    """Length to t along each ray, and the slack."""
    return round16(t * load16d(work, SPEED) - load16d(work, START) + load16d(work, SLACK))


@kernel
def keep_decided(
    packet: Table, work: Table, lanes: Table, t: F64x16, prim: i64, t_min: f64, maybe: i64, found: i64
) -> i64:
    """Note which of the rays `maybe` meet a triangle at t, nearer than anything so far; `found`: who has met any."""
    end, number = load16d(packet, END), splat16d(float(prim))
    # Of two triangles at the same place, the one with the smaller number counts.
    first = (t < end) | (mask16(found) & (t <= end) & (number < load16d(packet, PRIM)))
    better = mask16(maybe) & (splat16d(t_min) < t) & first
    if movemask16(better) != 0:
        end = select16d(better, t, end)
        store16d(packet, END, end)
        store16d(packet, PRIM, select16d(better, number, load16d(packet, PRIM)))
        store16(lanes, END_AT, select16(better, reach_of(work, end), load16(lanes, END_AT)))
    return movemask16(better)
