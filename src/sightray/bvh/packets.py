"""Sixteen coherent rays through the triangles of a mesh: one box, or one triangle, against all of them at a time.

Rays are **coherent** if they run into the same octant, share their largest component, and lie close together compared to
the tree. Then one *interval ray* stands for all at a node: it begins at the origin that is farthest along for the near
planes, at the one farthest behind for the far planes, with the smallest and the largest reciprocal direction. One test of
eight boxes, as for a single ray, tells which children no ray can meet; only the others are met by all sixteen rays. The
nearest ray decides in which order. Other packets are left to `bundles`.

Errors are those of `bvh8` and of `triangles`: the same slack, lane by lane. An interval ray is a ray with one more rounding
of its origin; boxes of triangles are found from rounded edges, 4u off: with the 8u of `bvh8` still less than 16u of slack.
What the filter lets through is decided in doubles for all sixteen rays, with the same operations in the same order as for
a single ray: the hits are the same to the last bit.

References: I. Wald, P. Slusallek, C. Benthin, M. Wagner, "Interactive rendering with coherent ray tracing" (Eurographics
2001); S. Boulos, I. Wald, P. Shirley, "Geometric and arithmetic culling methods for entire ray packets" (2006).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.bvh.bundles import any_in_turns, closest_in_turns, float_at
from sightray.bvh.bvh8 import CHILD, CHILDREN, LEAF, NODE_FLOATS, NODES, STACK_WORDS, Met, int_at
from sightray.bvh.casting import (
    DIRECTION,
    END,
    PACKET_WORDS,
    PRIM,
    REACH,
    SHEAR,
    SLACK,
    SPEED,
    START,
    UNIT_O,
    UNIT_R,
    WORK_WORDS,
    BoxPacket,
    Shared,
    TrianglePacket,
    box_packet,
    cast_packet,
    share,
    triangle_packet,
)
from sightray.bvh.triangles import BLOCK_FLOATS, BLOCKS, EDGES, INDICES, NUMBERS, VERTICES
from sightray.mathlib.lanes import (
    F32x4,
    F32x8,
    F32x16,
    F64x16,
    abs16d,
    flip16,
    least16,
    load4,
    load8,
    load16d,
    low4,
    lowest_bit,
    mask16,
    movemask4,
    movemask8,
    movemask16,
    product16d,
    round16,
    select16,
    select16d,
    sort_key,
    splat4,
    splat8,
    splat16,
    splat16d,
    store8,
    store16d,
    vmax4,
    vmax8,
    vmax16,
    vmax16d,
    vmin4,
    vmin8,
    vmin16,
    vmin16d,
)
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, advance, f64_at, i64_at, i64_put, scratch, table_at

# How far the origins of a packet's rays may lie apart, and their directions, in the tree's unit frame. Measured on half a
# million triangles: wider packets are slower than rays in turns from 0.02 (any hit) to 0.05 (nearest) on.
SPREAD = 0.02


class IntervalRay(NamedTuple):
    """What meets eight boxes, for all rays together: x * ax - nx is the least length to a near plane x."""

    ax: F32x8
    ay: F32x8
    az: F32x8
    nx: F32x8
    ny: F32x8
    nz: F32x8
    bx: F32x8  # x * bx - fx is the largest length to a far plane x
    by: F32x8
    bz: F32x8
    fx: F32x8
    fy: F32x8
    fz: F32x8


@kernel(exact=True)
def prepare_shear(packet: Table, axis: i64, work: Table) -> None:
    """The shear of each ray, see `triangles.shear`: three numbers, all rays having their largest component in `axis`."""
    kx, ky = (axis + 1) % 3, (axis + 2) % 3
    sz = splat16d(1.0) / load16d(packet, DIRECTION + 16 * axis)
    store16d(work, SHEAR, load16d(packet, DIRECTION + 16 * kx) * sz)
    store16d(work, SHEAR + 16, load16d(packet, DIRECTION + 16 * ky) * sz)
    store16d(work, SHEAR + 32, sz)


class Interval(NamedTuple):
    """Of the interval ray, along one axis."""

    a: f64  # reciprocal direction and its product with the origin, for near planes
    n: f64
    b: f64  # and for far planes
    f: f64
    wide: bool  # whether the rays lie too far apart


@kernel
def interval(work: Table, axis: i64, up: bool) -> Interval:
    """The extremes of a packet along one axis, in floats."""
    met, inf, zero = round16(load16d(work, REACH)) >= splat16(0.0), splat16(math.inf), splat16(0.0)
    o, slack = round16(load16d(work, UNIT_O + 16 * axis)), round16(load16d(work, SLACK))
    r = round16(abs16d(load16d(work, UNIT_R + 16 * axis)))
    slowest, fastest = least16(select16(met, r, inf)), -least16(select16(met, zero - r, inf))
    low = least16(select16(met, o - slack, inf))
    high = -least16(select16(met, zero - o - slack, inf))
    wide = high - low > SPREAD or fastest - slowest > SPREAD * slowest * fastest  # 1/slowest - 1/fastest
    if up:
        return Interval(slowest, high * slowest, fastest, low * fastest, wide)
    return Interval(-slowest, -low * slowest, -fastest, -high * fastest, wide)


class Extremes(NamedTuple):
    """Of the interval ray."""

    x: Interval
    y: Interval
    z: Interval
    close: bool  # whether one ray may stand for all


@kernel
def extremes(work: Table, shared: Shared) -> Extremes:
    """What bounds a packet, and whether it is coherent."""
    x, y, z = interval(work, 0, shared.x_up), interval(work, 1, shared.y_up), interval(work, 2, shared.z_up)
    return Extremes(x, y, z, shared.same and not (x.wide or y.wide or z.wide))


@kernel
def interval_ray(e: Extremes) -> IntervalRay:
    """Prepare a packet for eight boxes at a time."""
    x, y, z = e.x, e.y, e.z
    return IntervalRay(
        splat8(x.a), splat8(y.a), splat8(z.a), splat8(x.n), splat8(y.n), splat8(z.n),
        splat8(x.b), splat8(y.b), splat8(z.b), splat8(x.f), splat8(y.f), splat8(z.f),
    )  # fmt: skip


# ------------------------------------------------------------------------------------------------------------- meeting


@kernel
def lanes_at(floats: Table, index: i64) -> F32x16:
    """A float, sixteen times."""
    return splat16(float_at(floats, index))


@kernel
def meet_interval(nodes: Table, at: i64, ray: IntervalRay, x: i64, y: i64, z: i64, reach: f64) -> Met:
    """Which of the eight boxes of a node the packet may meet within `reach`; x, y, z: where the near planes stand."""
    near_x, far_x = load8(nodes, at + x) * ray.ax - ray.nx, load8(nodes, at + 8 - x) * ray.bx - ray.fx
    near_y, far_y = load8(nodes, at + y) * ray.ay - ray.ny, load8(nodes, at + 40 - y) * ray.by - ray.fy
    near_z, far_z = load8(nodes, at + z) * ray.az - ray.nz, load8(nodes, at + 72 - z) * ray.bz - ray.fz
    near = vmax8(vmax8(near_x, near_y), vmax8(near_z, splat8(0.0)))
    far = vmin8(vmin8(far_x, far_y), vmin8(far_z, splat8(reach)))
    return Met(near, movemask8(near <= far))


@kernel
def meets_box(nodes: Table, at: i64, ray: BoxPacket, x: i64, y: i64, z: i64, reach: F32x16) -> bool:
    """Whether any ray meets the box whose lower x stands at `at`."""
    near_x, far_x = lanes_at(nodes, at + x) * ray.rx - ray.nx, lanes_at(nodes, at + 8 - x) * ray.rx - ray.fx
    near_y, far_y = lanes_at(nodes, at + y) * ray.ry - ray.ny, lanes_at(nodes, at + 40 - y) * ray.ry - ray.fy
    near_z, far_z = lanes_at(nodes, at + z) * ray.rz - ray.nz, lanes_at(nodes, at + 72 - z) * ray.rz - ray.fz
    near = vmax16(vmax16(near_x, near_y), vmax16(near_z, splat16(0.0)))
    return movemask16(near <= vmin16(vmin16(far_x, far_y), vmin16(far_z, reach))) != 0


class FilteredLanes(NamedTuple):
    """Rays of a packet, one bit each."""

    maybe: i64  # those that may meet the triangle
    surely: i64  # those that meet it, whatever the rounding


@kernel
def filter_triangle(blocks: Table, at: i64, ray: TrianglePacket, reach: F32x16) -> FilteredLanes:
    """`filter_block` for one triangle and sixteen rays."""
    ax, ay, az = lanes_at(blocks, at), lanes_at(blocks, at + 4), lanes_at(blocks, at + 8)
    b1, b2, b3 = float_at(blocks, at + 12), float_at(blocks, at + 16), float_at(blocks, at + 20)
    c1, c2, c3 = float_at(blocks, at + 24), float_at(blocks, at + 28), float_at(blocks, at + 32)
    bx, by, bz, cx, cy, cz = splat16(b1), splat16(b2), splat16(b3), splat16(c1), splat16(c2), splat16(c3)
    px, py, pz = ray.dy * cz - ray.dz * cy, ray.dz * cx - ray.dx * cz, ray.dx * cy - ray.dy * cx  # d x c
    sx, sy, sz = ray.ox - ax, ray.oy - ay, ray.oz - az
    qx, qy, qz = sy * bz - sz * by, sz * bx - sx * bz, sx * by - sy * bx  # s x b
    signed = bx * px + by * py + bz * pz
    det = flip16(signed, signed)
    u = flip16(sx * px + sy * py + sz * pz, signed)
    v = flip16(ray.dx * qx + ray.dy * qy + ray.dz * qz, signed)
    size = splat16(max(abs(b1) + abs(b2) + abs(b3), abs(c1) + abs(c2) + abs(c3)))
    side, zero = size * ray.side, splat16(0.0)
    inside = vmin16(vmin16(u, v), det - (u + v))
    if movemask16(inside + side >= zero) == 0:
        return FilteredLanes(0, 0)
    along = size * size * ray.along
    t = flip16(cx * qx + cy * qy + cz * qz, signed)
    ahead = vmin16(t, det * reach - t)
    maybe = (inside + side >= zero) & (ahead + along >= zero)
    return FilteredLanes(movemask16(maybe), movemask16((inside > side) & (ahead > along)))


@kernel
def cull_triangles(blocks: Table, at: i64, ray: IntervalRay, x: bool, y: bool, z: bool, reach: f64) -> i64:
    """Which of the four triangles of a block the packet may meet within `reach`, by their boxes."""
    fx, fy, fz = far_and_near(blocks, at, x), far_and_near(blocks, at + 4, y), far_and_near(blocks, at + 8, z)
    near_x, far_x = fx.near * low4(ray.ax) - low4(ray.nx), fx.far * low4(ray.bx) - low4(ray.fx)
    near_y, far_y = fy.near * low4(ray.ay) - low4(ray.ny), fy.far * low4(ray.by) - low4(ray.fy)
    near_z, far_z = fz.near * low4(ray.az) - low4(ray.nz), fz.far * low4(ray.bz) - low4(ray.fz)
    near = vmax4(vmax4(splat4(0.0), near_x), vmax4(near_y, near_z))
    far = vmin4(vmin4(splat4(reach), far_x), vmin4(far_y, far_z))
    return movemask4(near <= far)


class Sides(NamedTuple):
    """Of four triangles along one axis."""

    near: F32x4
    far: F32x4


@kernel
def far_and_near(blocks: Table, at: i64, up: bool) -> Sides:
    """Where four triangles begin and end along one axis, as rays see it that go up or down."""
    a = load4(blocks, at)
    b, c = a + load4(blocks, at + EDGES), a + load4(blocks, at + 2 * EDGES)
    low, high = vmin4(vmin4(b, c), a), vmax4(vmax4(b, c), a)
    return Sides(low if up else high, high if up else low)


@kernel(exact=True)
def decide_triangle(mesh: Table, packet: Table, work: Table, axis: i64, at: i64) -> F64x16:
    """`meet_triangle` for sixteen rays and the triangle at `at` of the blocks: where they meet it; NaN or inf if not."""
    vertices, blocks = table_at(mesh, VERTICES), table_at(mesh, BLOCKS)
    a, b, c = 3 * int_at(blocks, at), 3 * int_at(blocks, at + 4), 3 * int_at(blocks, at + 8)
    kx, ky = (axis + 1) % 3, (axis + 2) % 3
    oz, ox, oy = load16d(packet, 16 * axis), load16d(packet, 16 * kx), load16d(packet, 16 * ky)
    shear_x, shear_y = load16d(work, SHEAR), load16d(work, SHEAR + 16)
    az, bz, cz = lanes_of(vertices, a + axis) - oz, lanes_of(vertices, b + axis) - oz, lanes_of(vertices, c + axis) - oz
    ax = lanes_of(vertices, a + kx) - ox - product16d(az, shear_x)
    ay = lanes_of(vertices, a + ky) - oy - product16d(az, shear_y)
    bx = lanes_of(vertices, b + kx) - ox - product16d(bz, shear_x)
    by = lanes_of(vertices, b + ky) - oy - product16d(bz, shear_y)
    cx = lanes_of(vertices, c + kx) - ox - product16d(cz, shear_x)
    cy = lanes_of(vertices, c + ky) - oy - product16d(cz, shear_y)
    ea = product16d(cx, by) - product16d(bx, cy)
    eb = product16d(ax, cy) - product16d(cx, ay)
    ec = product16d(bx, ay) - product16d(ax, by)
    zero = splat16d(0.0)
    inside = (vmin16d(vmin16d(ea, eb), ec) >= zero) | (vmax16d(vmax16d(ea, eb), ec) <= zero)
    along = product16d(ea, az) + product16d(eb, bz) + product16d(ec, cz)
    t = product16d(along, load16d(work, SHEAR + 32)) / (ea + eb + ec)  # NaN or infinite if the determinant is zero
    return select16d(inside, t, splat16d(math.nan))


@kernel
def lanes_of(vertices: Table, index: i64) -> F64x16:
    """A double, sixteen times."""
    return splat16d(f64_at(vertices, index))


@kernel
def reach_of(work: Table, t: F64x16) -> F32x16:
    """Length to t along each ray, and the slack."""
    return round16(t * load16d(work, SPEED) - load16d(work, START) + load16d(work, SLACK))


@kernel
def closest_together(
    mesh: Table, packet: Table, t_min: f64, alive: i64, work: Table, shared: Shared, bounds: Extremes
) -> i64:
    """`closest_rays` for one coherent packet."""
    boxes, hull, triangles = box_packet(work), interval_ray(bounds), triangle_packet(work)
    reach = round16(load16d(work, REACH))
    farthest = -least16(splat16(0.0) - reach)
    x, y, z = 0 if shared.x_up else 8, 16 if shared.y_up else 24, 32 if shared.z_up else 40
    nodes, blocks, numbers = table_at(mesh, NODES), table_at(mesh, BLOCKS), table_at(mesh, NUMBERS)
    found, sheared = 0, False
    lengths = scratch(4)
    stack = scratch(STACK_WORDS)
    i64_put(stack, 0, 0)
    top = 1
    while top > 0:
        top -= 1
        key = i64_at(stack, top)
        if key > sort_key(farthest):
            continue
        child = key & CHILD
        if child < LEAF:
            # Cull by the interval ray, meet what is left with all rays, and push the nearest last.
            at, base = child * NODE_FLOATS, top
            met = meet_interval(nodes, at, hull, x, y, z, farthest)
            bits = met.bits
            store8(lengths, 0, met.near)
            while bits != 0:
                lane = lowest_bit(bits)
                bits &= bits - 1
                child = int_at(nodes, at + CHILDREN + lane)
                if child >= LEAF and not meets_box(nodes, at + lane, boxes, x, y, z, reach):
                    continue
                key = (int_at(lengths, lane) << 32) | child
                i = top
                while i > base and i64_at(stack, i - 1) < key:
                    i64_put(stack, i, i64_at(stack, i - 1))
                    i -= 1
                i64_put(stack, i, key)
                top += 1
            continue
        block = child & (LEAF - 1)
        culled = cull_triangles(blocks, block * BLOCK_FLOATS, hull, shared.x_up, shared.y_up, shared.z_up, farthest)
        while culled != 0:
            lane = lowest_bit(culled)
            culled &= culled - 1
            prim = int_at(numbers, 4 * block + lane)
            maybe = filter_triangle(blocks, block * BLOCK_FLOATS + lane, triangles, reach).maybe & alive
            if maybe == 0:
                continue
            if not sheared:
                prepare_shear(packet, shared.axis, work)
                sheared = True
            t = decide_triangle(mesh, packet, work, shared.axis, block * BLOCK_FLOATS + INDICES + lane)
            end, number = load16d(packet, END), splat16d(float(prim))
            # Of two triangles at the same place, the one with the smaller number counts.
            first = (t < end) | (mask16(found) & (t <= end) & (number < load16d(packet, PRIM)))
            better = mask16(maybe) & (splat16d(t_min) < t) & first
            if movemask16(better) != 0:
                found |= movemask16(better)
                end = select16d(better, t, end)
                store16d(packet, END, end)
                store16d(packet, PRIM, select16d(better, number, load16d(packet, PRIM)))
                reach = select16(better, reach_of(work, end), reach)
                farthest = -least16(splat16(0.0) - reach)
    return found


@kernel
def any_together(
    mesh: Table, packet: Table, t_min: f64, alive: i64, work: Table, shared: Shared, bounds: Extremes
) -> i64:
    """`any_rays` for one coherent packet."""
    boxes, hull, triangles = box_packet(work), interval_ray(bounds), triangle_packet(work)
    sheared = False
    reach = round16(load16d(work, REACH))
    farthest = -least16(splat16(0.0) - reach)
    x, y, z = 0 if shared.x_up else 8, 16 if shared.y_up else 24, 32 if shared.z_up else 40
    nodes, blocks = table_at(mesh, NODES), table_at(mesh, BLOCKS)
    blocked = 0
    stack = scratch(STACK_WORDS)
    i64_put(stack, 0, 0)
    top = 1
    while top > 0:
        top -= 1
        child = i64_at(stack, top)
        if child < LEAF:
            at = child * NODE_FLOATS
            bits = meet_interval(nodes, at, hull, x, y, z, farthest).bits
            while bits != 0:
                lane = lowest_bit(bits)
                bits &= bits - 1
                child = int_at(nodes, at + CHILDREN + lane)
                if child < LEAF or meets_box(nodes, at + lane, boxes, x, y, z, reach):
                    i64_put(stack, top, child)
                    top += 1
            continue
        block, before = child & (LEAF - 1), blocked
        culled = cull_triangles(blocks, block * BLOCK_FLOATS, hull, shared.x_up, shared.y_up, shared.z_up, farthest)
        while culled != 0:
            lane = lowest_bit(culled)
            culled &= culled - 1
            found = filter_triangle(blocks, block * BLOCK_FLOATS + lane, triangles, reach)
            blocked |= found.surely & alive
            doubtful = found.maybe & alive & ~blocked
            if doubtful != 0:
                if not sheared:
                    prepare_shear(packet, shared.axis, work)
                    sheared = True
                t = decide_triangle(mesh, packet, work, shared.axis, block * BLOCK_FLOATS + INDICES + lane)
                blocked |= movemask16((splat16d(t_min) < t) & (t < load16d(packet, END))) & doubtful
        if blocked != before:
            if blocked == alive:
                break
            reach = select16(mask16(blocked), splat16(-1.0), reach)  # rays that are done meet nothing
            farthest = -least16(splat16(0.0) - reach)
    return blocked


@kernel
def closest_rays(mesh: Table, packets: Table, count: i64, t_min: f64) -> i64:
    """Nearest hits beyond t_min of the rays of up to four packets: writes `END` and `PRIM` of those that meet the mesh.

    Returns the bits of these rays. Their hits are what `closest_triangle` finds; of equal t the triangle that comes first.
    """
    works = scratch(1088)
    found, apart = 0, 0
    for p in range(count):
        packet, work = advance(packets, p * PACKET_WORDS), advance(works, p * WORK_WORDS)
        alive = cast_packet(mesh, packet, t_min, work)
        if alive != 0:
            shared = share(packet, work, alive)
            bounds = extremes(work, shared)
            if bounds.close:
                found |= closest_together(mesh, packet, t_min, alive, work, shared, bounds) << (16 * p)
            else:
                apart |= alive << (16 * p)
    if apart != 0:
        found |= closest_in_turns(mesh, packets, t_min, apart, works)
    return found


@kernel
def any_rays(mesh: Table, packets: Table, count: i64, t_min: f64) -> i64:
    """The bits of those rays of up to four packets that meet the mesh between t_min and their end."""
    works = scratch(1088)
    blocked, apart = 0, 0
    for p in range(count):
        packet, work = advance(packets, p * PACKET_WORDS), advance(works, p * WORK_WORDS)
        alive = cast_packet(mesh, packet, t_min, work)
        if alive != 0:
            shared = share(packet, work, alive)
            bounds = extremes(work, shared)
            if bounds.close:
                blocked |= any_together(mesh, packet, t_min, alive, work, shared, bounds) << (16 * p)
            else:
                apart |= alive << (16 * p)
    if apart != 0:
        blocked |= any_in_turns(mesh, packets, t_min, apart, works)
    return blocked
