"""Casting the centre rays of a tile, and describing what they met.

The rays are the camera's own, so every camera model works. Where a scene has not too many items, those are picked for
each tile whose boxes its rays may meet (`vision.picking`); of a few picked ones, meshes are asked in packets of 4 x 4
pixels, and other shapes ray by ray. Where many are picked, each ray goes through the tree. The hits are the same.
"""

from __future__ import annotations

import math

from sightray._jit import kernel
from sightray.accelerators.item import (
    BUMPY,
    CLEAR,
    FLAGS,
    MOVED,
    MOVING,
    ItemHit,
    better,
    intersect_item,
    item_at,
    item_surface,
    to_object,
)
from sightray.bvh.bvh8 import int_at
from sightray.bvh.casting import DIRECTION as PACKET_DIRECTION
from sightray.bvh.casting import END, PACKET_WORDS
from sightray.bvh.casting import ORIGIN as PACKET_ORIGIN
from sightray.bvh.casting import PRIM as PACKET_PRIM
from sightray.cameras.base import sight_ray
from sightray.mathlib.hit import is_hit
from sightray.mathlib.lanes import load16d, mask16, select16d, splat16d, store16d
from sightray.mathlib.rays import is_ray
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import (
    Table,
    advance,
    f64_at,
    f64_put,
    i64_at,
    i64_put,
    scratch,
    table_at,
    vec3_at,
    vec3_put,
)
from sightray.mathlib.vec import Vec3, normalize
from sightray.scene.crossings import MESH
from sightray.scene.packet_kernels import closest_of_item, put_lane
from sightray.scene.query_kernels import exact_hit, hit_point
from sightray.scene.world import ITEMS, MERGED, find_closest, point_of, thin_beam
from sightray.scene.world import ORIGIN as MERGED_ORIGIN
from sightray.vision.picking import MOST_PICKED, pick_items
from sightray.vision.record import (
    CAMERA,
    COLUMNS,
    DETAIL,
    DIRECTION,
    FACE,
    ITEM,
    KINDS,
    NORMAL,
    ORIGIN,
    PIXEL,
    POINT,
    POSITION,
    PRIM,
    ROWS,
    SCALE,
    SHADING,
    SIDE,
    SURFACE,
    TEXTURE_U,
    TEXTURE_V,
    WORLD,
    T,
    U,
    V,
    X,
    Y,
    record_at,
)


@kernel
def place_pixels(frame: Table, tile: i64, records: Table) -> i64:
    """Number the pixels of a tile, four squares of 4 x 4 one after the other; how many are in the picture."""
    columns, rows, scale = i64_at(frame, COLUMNS), i64_at(frame, ROWS), float(i64_at(frame, SCALE))
    across = (columns + SIDE - 1) // SIDE
    left, top = tile % across * SIDE, tile // across * SIDE
    count = 0
    for k in range(SIDE * SIDE):
        column = left + (k & 3) + 4 * ((k >> 4) & 1)
        row = top + ((k >> 2) & 3) + 4 * (k >> 5)
        if column < columns and row < rows:
            record = record_at(records, count)
            i64_put(record, PIXEL, row * columns + column)
            f64_put(record, X, (column + 0.5) / scale)
            f64_put(record, Y, (row + 0.5) / scale)
            count += 1
    return count


@kernel
def generate_rays(frame: Table, records: Table, count: i64) -> None:
    """The ray of sight through each pixel's centre, the lens's centre, at the middle of the exposure."""
    camera = table_at(frame, CAMERA)
    for i in range(count):
        record = record_at(records, i)
        ray = sight_ray(camera, f64_at(record, X), f64_at(record, Y), 0.5, 0.5, 0.5)
        vec3_put(record, ORIGIN, ray.origin)
        vec3_put(record, DIRECTION, ray.direction)


@kernel
def put_hit(record: Table, hit: ItemHit) -> None:
    """Write what was met."""
    f64_put(record, T, hit.t)
    i64_put(record, ITEM, hit.item)
    i64_put(record, PRIM, hit.prim)
    f64_put(record, U, hit.u)
    f64_put(record, V, hit.v)


@kernel
def cast_singly(frame: Table, records: Table, count: i64) -> None:
    """Nearest hits, ray by ray."""
    world = table_at(frame, WORLD)
    for i in range(count):
        record = record_at(records, i)
        o, d = vec3_at(record, ORIGIN), vec3_at(record, DIRECTION)
        hit = find_closest(world, o, d, 0.0, math.inf)
        while hit.item >= 0 and is_clear(world, hit.item):
            hit = find_closest(world, o, d, hit.t, math.inf)
        put_hit(record, hit)


@kernel
def is_clear(world: Table, index: i64) -> bool:
    """Whether light passes an item as if it were not there: it only bounds a fog."""
    return i64_at(item_at(table_at(world, ITEMS), index), FLAGS) & CLEAR != 0


@kernel
def cast_picked(frame: Table, records: Table, count: i64, picked: Table, n: i64) -> None:
    """Nearest hits with the `n` items picked for the tile."""
    world, kinds, meshes = table_at(frame, WORLD), table_at(frame, KINDS), 0
    for i in range(count):
        put_hit(record_at(records, i), ItemHit(math.inf, -1, -1, math.nan, math.nan))
    for k in range(n):
        index = i64_at(picked, k)
        if int_at(kinds, index) == MESH:
            i64_put(picked, meshes, index)
            meshes += 1
        else:
            cast_at_shape(item_at(table_at(world, ITEMS), index), index, records, count)
    if meshes > 0:
        cast_in_packets(frame, records, count, picked, meshes)


@kernel
def cast_at_shape(item: Table, index: i64, records: Table, count: i64) -> None:
    """Note where rays meet an item that is no mesh, and nothing nearer so far; the lower of two items counts."""
    for i in range(count):
        record = record_at(records, i)
        o, d = vec3_at(record, ORIGIN), vec3_at(record, DIRECTION)
        if is_ray(o, d):
            hit = intersect_item(item, o, d, 0.0, f64_at(record, T))
            if is_hit(hit):
                put_hit(record, ItemHit(hit.t, index, hit.prim, hit.u, hit.v))


@kernel
def cast_in_packets(frame: Table, records: Table, count: i64, picked: Table, n: i64) -> None:
    """Note where rays meet the first `n` picked items, which are meshes: sixteen rays at a time."""
    packets, moved, found_by = scratch(512), scratch(512), scratch(64)
    world, groups = table_at(frame, WORLD), (count + 15) // 16
    for p in range(groups):
        packet = advance(packets, p * PACKET_WORDS)
        store16d(found_by, 16 * p, splat16d(-1.0))
        store16d(packet, END, splat16d(math.nan))
        for lane in range(min(16, count - 16 * p)):
            record = record_at(records, 16 * p + lane)
            put_lane(packet, PACKET_ORIGIN, lane, vec3_at(record, ORIGIN))
            put_lane(packet, PACKET_DIRECTION, lane, vec3_at(record, DIRECTION))
            f64_put(packet, END + lane, f64_at(record, T) * (1.0 + 2.0**-52))  # what is at the same place is found, too

    # Each mesh brings the ends nearer of the rays that meet it.
    for k in range(n):
        index = i64_at(picked, k)
        met = closest_of_item(item_at(table_at(world, ITEMS), index), True, packets, groups, moved, 0.0)
        for p in range(groups):
            these = mask16((met >> (16 * p)) & 0xFFFF)
            store16d(found_by, 16 * p, select16d(these, splat16d(float(index)), load16d(found_by, 16 * p)))

    # Triangles of meshes that were put together go back to the mesh that they came from.
    origin = table_at(world, MERGED_ORIGIN)
    for i in range(count):
        at, index = (i >> 4) * PACKET_WORDS + (i & 15), int(f64_at(found_by, i))
        if index >= 0:
            record, prim = record_at(records, i), int(f64_at(packets, PACKET_PRIM + at))
            best = ItemHit(f64_at(record, T), i64_at(record, ITEM), i64_at(record, PRIM), math.nan, math.nan)
            hit = ItemHit(f64_at(packets, END + at), index, prim, math.nan, math.nan)
            if better(hit, best):
                if index == i64_at(world, MERGED):
                    index, prim = int_at(origin, 2 * prim), int_at(origin, 2 * prim + 1)
                put_hit(record, ItemHit(hit.t, index, prim, math.nan, math.nan))


@kernel
def describe(frame: Table, record: Table) -> None:
    """Position, and normals and texture coordinates if a layer asks for them, of what a ray met."""
    world, kinds = table_at(frame, WORLD), table_at(frame, KINDS)
    o, d, index = vec3_at(record, ORIGIN), vec3_at(record, DIRECTION), i64_at(record, ITEM)
    item, u = item_at(table_at(world, ITEMS), index), f64_at(record, U)
    hit = ItemHit(f64_at(record, T), index, i64_at(record, PRIM), u, f64_at(record, V))
    p = o + d * hit.t
    if i64_at(item, MOVED) != MOVING:  # where what moves is depends on the time, which the next two do not ask
        if int_at(kinds, index) == MESH or u != u:
            hit = exact_hit(world, kinds, hit, o, d)
            f64_put(record, U, hit.u)
            f64_put(record, V, hit.v)
        p = hit_point(world, kinds, hit, o, d)
    p = Vec3(p.x, p.y, p.z, o.w)
    vec3_put(record, POSITION, p)
    detail = i64_at(frame, DETAIL)
    if detail < FACE:
        return
    s = item_surface(item, hit, to_object(item, p))
    vec3_put(record, NORMAL, normalize(s.normal))
    if detail >= SURFACE:
        shading = normalize(s.shading)
        if i64_at(item, FLAGS) & BUMPY != 0:
            shading = point_of(world, hit, o, d, thin_beam()).shading
        vec3_put(record, SHADING, shading)
        f64_put(record, TEXTURE_U, s.u)
        f64_put(record, TEXTURE_V, s.v)


@kernel
def cast_tile(frame: Table, tile: i64, records: Table) -> i64:
    """Fill the records of a tile; how many pixels it has."""
    count = place_pixels(frame, tile, records)
    generate_rays(frame, records, count)
    picked = scratch(MOST_PICKED)
    n = pick_items(frame, records, count, picked)
    if n >= 0:
        cast_picked(frame, records, count, picked, n)
    else:
        cast_singly(frame, records, count)
    if i64_at(frame, DETAIL) >= POINT:
        for i in range(count):
            record = record_at(records, i)
            if i64_at(record, ITEM) >= 0:
                describe(frame, record)
    return count
