"""Where the rays of a tile met what they met, and how that faces, in doubles.

What neighbouring pixels show is mostly one triangle, whose corners and normal are then read once: its weights and points are
computed for 4 x 4 pixels at a time. These are, to the last bit, those of `describe`, by which pixels are described one by
one that share their triangle with few others.
"""

from __future__ import annotations

from typing import NamedTuple

from sightray._jit import kernel
from sightray.accelerators.item import (
    BUMPY,
    FLAGS,
    MET,
    MOVED,
    MOVING,
    OBJECT_FROM_WORLD,
    PLACED,
    SHAPE,
    WORLD_FROM_OBJECT,
    ItemHit,
    item_at,
    item_surface,
    to_object,
)
from sightray.bvh.bvh8 import int_at
from sightray.bvh.casting import DIRECTION as PACKET_DIRECTION
from sightray.bvh.casting import END as PACKET_END
from sightray.bvh.casting import ORIGIN as PACKET_ORIGIN
from sightray.bvh.casting import PACKET_WORDS
from sightray.bvh.triangles import axis_of
from sightray.mathlib.hit import Hit
from sightray.mathlib.lanes import (
    F64x16,
    abs16d,
    count_bits,
    load16d,
    lowest_bit,
    movemask16,
    product16d,
    splat16d,
    store16d,
)
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, advance, f64_at, f64_put, i64_at, scratch, table_at, vec3_at, vec3_put
from sightray.mathlib.transform import transform_normal
from sightray.mathlib.vec import Vec3, normalize
from sightray.scene.crossings import MESH, mesh_corner
from sightray.scene.query_kernels import exact_hit, hit_point
from sightray.scene.world import ITEMS, point_of, thin_beam
from sightray.shapes.base import facing
from sightray.vision.record import (
    DETAIL,
    DIRECTION,
    FACE,
    FLAT,
    ITEM,
    KINDS,
    NORMAL,
    ORIGIN,
    POSITION,
    PRIM,
    SEEN,
    SHADING,
    SURFACE,
    TEXTURE_U,
    TEXTURE_V,
    WORLD,
    T,
    U,
    V,
    record_at,
)

FEW = 3  # pixels up to which a triangle is described pixel by pixel

# Words of what is found of sixteen pixels: the weights of the triangle's second and third corner, and points.
WEIGHTS, POINTS, FOUND_WORDS = 0, 32, 80


# ------------------------------------------------------------------------------------------------------- pixel by pixel


@kernel
def item_facing(item: Table, hit: ItemHit, p: Vec3) -> Vec3:
    """The geometric normal at a hit, in the world, of unit length; of `item_surface`, that alone."""
    moved, q = i64_at(item, MOVED), to_object(item, p)
    q = Vec3(q.x, q.y, q.z, q.w if moved == MOVING else 0.0)
    n = facing(table_at(item, MET), Hit(hit.t, hit.prim, hit.u, hit.v), q)
    return normalize(transform_normal(item, OBJECT_FROM_WORLD, n) if moved == PLACED else n)


@kernel
def hit_of(record: Table) -> ItemHit:
    """What a pixel's ray met."""
    t, u, v = f64_at(record, T), f64_at(record, U), f64_at(record, V)
    return ItemHit(t, i64_at(record, ITEM), i64_at(record, PRIM), u, v)


@kernel
def describe_point(frame: Table, record: Table) -> None:
    """The point that a ray met, and its parameters."""
    world, kinds = table_at(frame, WORLD), table_at(frame, KINDS)
    o, d, hit = vec3_at(record, ORIGIN), vec3_at(record, DIRECTION), hit_of(record)
    item = item_at(table_at(world, ITEMS), hit.item)
    p = o + d * hit.t
    if i64_at(item, MOVED) != MOVING:  # where what moves is depends on the time, which the next two do not ask
        if int_at(kinds, hit.item) == MESH or hit.u != hit.u:
            hit = exact_hit(world, kinds, hit, o, d)
            f64_put(record, U, hit.u)
            f64_put(record, V, hit.v)
        p = hit_point(world, kinds, hit, o, d)
    vec3_put(record, POSITION, Vec3(p.x, p.y, p.z, o.w))


@kernel
def describe_surface(frame: Table, record: Table) -> None:
    """Normals and texture coordinates of the point that a ray met."""
    world, hit = table_at(frame, WORLD), hit_of(record)
    item = item_at(table_at(world, ITEMS), hit.item)
    s = item_surface(item, hit, to_object(item, vec3_at(record, POSITION)))
    shading = normalize(s.shading)
    if i64_at(item, FLAGS) & BUMPY != 0:
        shading = point_of(world, hit, vec3_at(record, ORIGIN), vec3_at(record, DIRECTION), thin_beam()).shading
    vec3_put(record, NORMAL, normalize(s.normal))
    vec3_put(record, SHADING, shading)
    f64_put(record, TEXTURE_U, s.u)
    f64_put(record, TEXTURE_V, s.v)


@kernel
def face_record(frame: Table, record: Table) -> Vec3:
    """The geometric normal of what a ray met."""
    hit = hit_of(record)
    return item_facing(item_at(table_at(table_at(frame, WORLD), ITEMS), hit.item), hit, vec3_at(record, POSITION))


# ------------------------------------------------------------------------------------------------ sixteen rays at a time


class Triple(NamedTuple):
    """Vectors of sixteen pixels."""

    x: F64x16
    y: F64x16
    z: F64x16


@kernel
def triple_from(rows: Table, at: i64) -> Triple:
    """Vectors that stand at word `at`."""
    return Triple(load16d(rows, at), load16d(rows, at + 16), load16d(rows, at + 32))


@kernel
def put_triple_at(rows: Table, at: i64, a: Triple) -> None:
    """Write vectors to word `at`."""
    store16d(rows, at, a.x)
    store16d(rows, at + 16, a.y)
    store16d(rows, at + 32, a.z)


@kernel
def mapped(item: Table, at: i64, axis: i64, a: Triple) -> F64x16:
    """One coordinate of vectors after the matrix whose columns stand at word `at`."""
    x, y, z = (
        splat16d(f64_at(item, at + axis)),
        splat16d(f64_at(item, at + 4 + axis)),
        splat16d(f64_at(item, at + 8 + axis)),
    )
    return x * a.x + y * a.y + z * a.z


@kernel
def mapped_points(item: Table, at: i64, a: Triple) -> Triple:
    """Points after the matrix whose columns stand at word `at`."""
    return Triple(
        mapped(item, at, 0, a) + splat16d(f64_at(item, at + 12)),
        mapped(item, at, 1, a) + splat16d(f64_at(item, at + 13)),
        mapped(item, at, 2, a) + splat16d(f64_at(item, at + 14)),
    )


@kernel
def largest_axis(d: Triple, bits: i64) -> i64:
    """The axis of the largest component of the directions `bits`, as `triangles.shear` chooses it; -1: not the same."""
    x, y, z = abs16d(d.x), abs16d(d.y), abs16d(d.z)
    by_z, by_y = movemask16((z >= x) & (z >= y)) & bits, movemask16(y >= x) & bits
    if by_z == bits:
        return 2
    if by_z != 0 or (by_y != bits and by_y != 0):
        return -1
    return 1 if by_y != 0 else 0


@kernel
def part(a: Vec3, axis: i64) -> F64x16:
    """A component by its number, sixteen times."""
    return splat16d(axis_of(a, axis))


@kernel(exact=True)
def put_weights(mesh: Table, prim: i64, rays: Table, axis: i64, found: Table) -> i64:
    """The weights of a triangle where rays meet it, as `query_kernels.exact_hit` computes them; who has any, a bit each."""
    kx, ky = (axis + 1) % 3, (axis + 2) % 3
    oz, ox, oy = load16d(rays, 16 * axis), load16d(rays, 16 * kx), load16d(rays, 16 * ky)
    sz = splat16d(1.0) / load16d(rays, PACKET_DIRECTION + 16 * axis)
    sx, sy = load16d(rays, PACKET_DIRECTION + 16 * kx) * sz, load16d(rays, PACKET_DIRECTION + 16 * ky) * sz
    a, b, c = mesh_corner(mesh, prim, 0), mesh_corner(mesh, prim, 1), mesh_corner(mesh, prim, 2)
    az, bz, cz = part(a, axis) - oz, part(b, axis) - oz, part(c, axis) - oz
    ax, ay = part(a, kx) - ox - product16d(az, sx), part(a, ky) - oy - product16d(az, sy)
    bx, by = part(b, kx) - ox - product16d(bz, sx), part(b, ky) - oy - product16d(bz, sy)
    cx, cy = part(c, kx) - ox - product16d(cz, sx), part(c, ky) - oy - product16d(cz, sy)
    ea = product16d(cx, by) - product16d(bx, cy)
    eb = product16d(ax, cy) - product16d(cx, ay)
    ec = product16d(bx, ay) - product16d(ax, by)
    total, zero = ea + eb + ec, splat16d(0.0)
    store16d(found, WEIGHTS, eb / total)
    store16d(found, WEIGHTS + 16, ec / total)
    return movemask16((total < zero) | (total > zero))


@kernel
def put_points(item: Table, prim: i64, found: Table) -> None:
    """The points of a triangle that have these weights, in the world, as `query_kernels.hit_point` computes them."""
    mesh, u, v = table_at(item, SHAPE), load16d(found, WEIGHTS), load16d(found, WEIGHTS + 16)
    a = mesh_corner(mesh, prim, 0)
    b, c = mesh_corner(mesh, prim, 1) - a, mesh_corner(mesh, prim, 2) - a
    p = Triple(
        splat16d(a.x) + splat16d(b.x) * u + splat16d(c.x) * v,
        splat16d(a.y) + splat16d(b.y) * u + splat16d(c.y) * v,
        splat16d(a.z) + splat16d(b.z) * u + splat16d(c.z) * v,
    )
    if i64_at(item, MOVED) == PLACED:
        p = mapped_points(item, WORLD_FROM_OBJECT, p)
    put_triple_at(found, POINTS, p)


@kernel
def describe_on_triangle(item: Table, prim: i64, records: Table, these: i64, packet: Table) -> i64:
    """The points where the rays `these` of a packet met a triangle, and their weights; for whom it could be done."""
    moved, found, rays = scratch(PACKET_END), scratch(FOUND_WORDS), packet
    if i64_at(item, MOVED) == PLACED:
        d = triple_from(packet, PACKET_DIRECTION)
        d = Triple(
            mapped(item, OBJECT_FROM_WORLD, 0, d),
            mapped(item, OBJECT_FROM_WORLD, 1, d),
            mapped(item, OBJECT_FROM_WORLD, 2, d),
        )
        put_triple_at(moved, PACKET_ORIGIN, mapped_points(item, OBJECT_FROM_WORLD, triple_from(packet, PACKET_ORIGIN)))
        put_triple_at(moved, PACKET_DIRECTION, d)
        rays = moved
    axis = largest_axis(triple_from(rays, PACKET_DIRECTION), these)
    if axis < 0:
        return 0
    done = these & put_weights(table_at(item, SHAPE), prim, rays, axis, found)
    put_points(item, prim, found)
    bits = done
    while bits != 0:
        lane = lowest_bit(bits)
        bits &= bits - 1
        record, at = record_at(records, lane), POINTS + lane
        f64_put(record, U, f64_at(found, WEIGHTS + lane))
        f64_put(record, V, f64_at(found, WEIGHTS + 16 + lane))
        p = Vec3(f64_at(found, at), f64_at(found, at + 16), f64_at(found, at + 32), f64_at(record, ORIGIN + 3))
        vec3_put(record, POSITION, p)
    return done


# ------------------------------------------------------------------------------------------------------------- the tile


@kernel
def describe_alike(frame: Table, records: Table, these: i64, packet: Table) -> None:
    """Describe `these` of sixteen pixels, which all show one primitive of one item."""
    leader = record_at(records, lowest_bit(these))
    index, prim = i64_at(leader, ITEM), i64_at(leader, PRIM)
    item, kind = item_at(table_at(table_at(frame, WORLD), ITEMS), index), int_at(table_at(frame, KINDS), index)
    still, left = i64_at(item, MOVED) != MOVING, these
    if kind == MESH and still and count_bits(these) > FEW:
        left &= ~describe_on_triangle(item, prim, records, these, packet)
    while left != 0:
        describe_point(frame, record_at(records, lowest_bit(left)))
        left &= left - 1
    detail = i64_at(frame, DETAIL)
    if detail < FACE:
        return
    n, one = face_record(frame, leader), still and (kind == MESH or kind == FLAT)
    while these != 0:
        record = record_at(records, lowest_bit(these))
        these &= these - 1
        if detail >= SURFACE:
            describe_surface(frame, record)
        else:
            vec3_put(record, NORMAL, n if one else face_record(frame, record))


@kernel
def describe_tile(frame: Table, records: Table, packets: Table, count: i64) -> None:
    """Describe what the rays of a tile met, in as much detail as the layers ask for."""
    for first in range(0, count, 16):
        rows, n, todo = record_at(records, first), min(16, count - first), 0
        for lane in range(n):
            todo |= (1 if i64_at(record_at(rows, lane), SEEN) >= 0 else 0) << lane
        while todo != 0:
            seen, these = i64_at(record_at(rows, lowest_bit(todo)), SEEN), 0
            for lane in range(n):
                these |= (1 if i64_at(record_at(rows, lane), SEEN) == seen else 0) << lane
            describe_alike(frame, rows, these, advance(packets, (first >> 4) * PACKET_WORDS))
            todo &= ~these
