"""Casting the centre rays of a tile.

Where a scene has not too many items, those are picked for each tile whose boxes its rays may meet (`vision.picking`); of a
few picked ones, meshes are asked in packets of 4 x 4 pixels, and other shapes ray by ray. Where many are picked, each ray
goes through the tree. The hits are the same.
"""

from __future__ import annotations

import math

from sightray._jit import kernel
from sightray.accelerators.item import CLEAR, FLAGS, ItemHit, better, intersect_item, item_at
from sightray.bvh.bvh8 import int_at
from sightray.bvh.casting import END, PACKET_WORDS
from sightray.bvh.casting import PRIM as PACKET_PRIM
from sightray.mathlib.hit import is_hit
from sightray.mathlib.lanes import load16d, lowest_bit, mask16, select16d, splat16d, store16d
from sightray.mathlib.rays import is_ray
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, advance, f64_at, f64_put, i64_at, i64_put, scratch, table_at, vec3_at
from sightray.scene.crossings import MESH
from sightray.scene.packet_kernels import closest_of_item
from sightray.scene.world import ITEMS, MERGED, find_closest
from sightray.scene.world import ORIGIN as MERGED_ORIGIN
from sightray.vision.describing import describe_tile, hit_of
from sightray.vision.picking import MOST_PICKED, pick_items
from sightray.vision.record import DETAIL, DIRECTION, ITEM, KINDS, ORIGIN, POINT, PRIM, SEEN, WORLD, T, U, V, record_at
from sightray.vision.sight import generate_rays, place_pixels


@kernel
def put_hit(record: Table, hit: ItemHit) -> None:
    """Write what was met."""
    f64_put(record, T, hit.t)
    i64_put(record, ITEM, hit.item)
    i64_put(record, PRIM, hit.prim)
    i64_put(record, SEEN, hit.item << 32 | hit.prim & 0xFFFFFFFF)
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
def cast_picked(frame: Table, records: Table, packets: Table, count: i64, picked: Table, n: i64) -> None:
    """Nearest hits with the `n` items picked for the tile: first those that are no meshes, ray by ray."""
    items, kinds, meshes, rays = table_at(table_at(frame, WORLD), ITEMS), table_at(frame, KINDS), 0, 0
    for k in range(n):
        meshes += 1 if int_at(kinds, i64_at(picked, k)) == MESH else 0
    if meshes == n > 0:
        cast_in_packets(frame, records, packets, count, picked, n, True)
        return
    for i in range(count):
        record = record_at(records, i)
        put_hit(record, ItemHit(math.inf, -1, -1, math.nan, math.nan))
        rays |= (1 if is_ray(vec3_at(record, ORIGIN), vec3_at(record, DIRECTION)) else 0) << i
    meshes = 0
    for k in range(n):
        index = i64_at(picked, k)
        if int_at(kinds, index) == MESH:
            i64_put(picked, meshes, index)
            meshes += 1
        else:
            cast_at_shape(item_at(items, index), index, records, rays)
    if meshes > 0:
        cast_in_packets(frame, records, packets, count, picked, meshes, False)


@kernel
def cast_at_shape(item: Table, index: i64, records: Table, rays: i64) -> None:
    """Note where `rays`, a bit each, meet an item that is no mesh, and nothing nearer so far; the lower of two counts."""
    while rays != 0:
        record = record_at(records, lowest_bit(rays))
        rays &= rays - 1
        hit = intersect_item(item, vec3_at(record, ORIGIN), vec3_at(record, DIRECTION), 0.0, f64_at(record, T))
        if is_hit(hit):
            put_hit(record, ItemHit(hit.t, index, hit.prim, hit.u, hit.v))


@kernel
def cast_in_packets(
    frame: Table, records: Table, packets: Table, count: i64, picked: Table, n: i64, alone: bool
) -> None:  # fmt: skip
    """Note where rays meet the first `n` picked items, which are meshes: sixteen rays at a time.

    If they are `alone`, nothing else was asked before, and records have no hits yet.
    """
    moved, found_by = scratch(512), scratch(64)
    world, groups = table_at(frame, WORLD), (count + 15) // 16
    for p in range(groups):
        packet = advance(packets, p * PACKET_WORDS)
        store16d(found_by, 16 * p, splat16d(-1.0))
        if alone and 16 * p + 16 <= count:
            store16d(packet, END, splat16d(math.inf))
            continue
        store16d(packet, END, splat16d(math.nan))
        for lane in range(min(16, count - 16 * p)):
            end = math.inf if alone else f64_at(record_at(records, 16 * p + lane), T)
            f64_put(packet, END + lane, end * (1.0 + 2.0**-52))  # what is at the same place is found, too

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
        at, index, record = (i >> 4) * PACKET_WORDS + (i & 15), int(f64_at(found_by, i)), record_at(records, i)
        if index < 0:
            if alone:
                put_hit(record, ItemHit(math.inf, -1, -1, math.nan, math.nan))
        else:
            prim = int(f64_at(packets, PACKET_PRIM + at))
            hit = ItemHit(f64_at(packets, END + at), index, prim, math.nan, math.nan)
            if alone or better(hit, hit_of(record)):
                if index == i64_at(world, MERGED):
                    index, prim = int_at(origin, 2 * prim), int_at(origin, 2 * prim + 1)
                put_hit(record, ItemHit(hit.t, index, prim, math.nan, math.nan))


@kernel
def cast_tile(frame: Table, tile: i64, records: Table) -> i64:
    """Fill the records of a tile; how many pixels it has."""
    packets, picked = scratch(512), scratch(MOST_PICKED)
    count = place_pixels(frame, tile, records)
    generate_rays(frame, records, packets, count)
    n = pick_items(frame, records, count, picked)
    if n >= 0:
        cast_picked(frame, records, packets, count, picked, n)
    else:
        cast_singly(frame, records, count)
    if i64_at(frame, DETAIL) >= POINT:
        describe_tile(frame, records, packets, count)
    return count
