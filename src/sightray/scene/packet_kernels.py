"""Batches of rays sixteen at a time, for scenes of few items: `query_kernels` with packets (see `bvh.packets`).

Every item is asked in turn, so no tree over items is walked; up to `FEW_ITEMS` that is the faster way. Meshes are met by
packets, other shapes ray by ray. Columns and forms are those of `query_kernels`.
"""

from __future__ import annotations

import math

from sightray._jit import kernel
from sightray.accelerators.item import (
    MOVED,
    OBJECT,
    OBJECT_FROM_WORLD,
    SHAPE,
    intersect_item,
    item_at,
    occluded_item,
)
from sightray.bvh.bundles import packet_vec3
from sightray.bvh.bvh8 import int_at
from sightray.bvh.casting import DIRECTION, END, ORIGIN, PRIM
from sightray.bvh.packets import any_packet, closest_packet
from sightray.mathlib.lanes import (
    load16d,
    mask16,
    put_bytes16,
    put_ints16,
    select16d,
    splat16d,
    store16d,
    transpose16,
    transpose16d,
)
from sightray.mathlib.rays import is_ray
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, f64_put, i32_put, i64_at, scratch, table_at
from sightray.mathlib.transform import transform_point, transform_vector
from sightray.mathlib.vec import Vec3
from sightray.scene.crossings import MESH
from sightray.scene.query_kernels import LOOK, number_at, triple_at
from sightray.scene.world import ITEMS

FEW_ITEMS = 4
SINGLE_ROWS, DOUBLE_ROWS = 7, 6  # forms of contiguous (n, 3) arrays
ITEM = 112 + 16  # words of a packet after those of `casting`: which item was met, and its object
BATCH_OBJECT = ITEM + 16


@kernel
def put_lane(packet: Table, at: i64, lane: i64, a: Vec3) -> None:
    """Write origin or direction of one ray of a packet."""
    f64_put(packet, at + lane, a.x)
    f64_put(packet, at + 16 + lane, a.y)
    f64_put(packet, at + 32 + lane, a.z)


@kernel
def fill_triples(column: Table, form: i64, first: i64, count: i64, packet: Table, at: i64) -> None:
    """Read origins or directions of up to sixteen rays."""
    if count == 16 and form == SINGLE_ROWS:
        transpose16(column, 3 * first, packet, at)
    elif count == 16 and form == DOUBLE_ROWS:
        transpose16d(column, 3 * first, packet, at)
    else:
        for lane in range(count):
            put_lane(packet, at, lane, triple_at(column, form, first + lane))


@kernel
def fill_packet(
    origins: Table, o_form: i64, directions: Table, d_form: i64, ends: Table, e_form: i64, first: i64, count: i64,
    packet: Table,
) -> None:  # fmt: skip
    """Read up to sixteen rays; lanes without one end before they begin."""
    fill_triples(origins, o_form, first, count, packet, ORIGIN)
    fill_triples(directions, d_form, first, count, packet, DIRECTION)
    if e_form <= 1 and count == 16:
        store16d(packet, END, splat16d(number_at(ends, e_form, 0)))
    else:
        store16d(packet, END, splat16d(math.nan))
        for lane in range(count):
            f64_put(packet, END + lane, number_at(ends, e_form, (e_form >> 1) * (first + lane)))


@kernel
def move_packet(item: Table, packet: Table, moved: Table) -> None:
    """A packet in the item's object space; t means the same there."""
    for lane in range(16):
        o = transform_point(item, OBJECT_FROM_WORLD, packet_vec3(packet, ORIGIN + lane))
        d = transform_vector(item, OBJECT_FROM_WORLD, packet_vec3(packet, DIRECTION + lane))
        put_lane(moved, ORIGIN, lane, o)
        put_lane(moved, DIRECTION, lane, d)
    store16d(moved, END, load16d(packet, END))


@kernel
def closest_of_item(item: Table, is_mesh: bool, packet: Table, moved: Table, t_min: f64) -> i64:
    """The rays of a packet that meet an item before their end, which is brought there."""
    if is_mesh and i64_at(item, MOVED) == 0:
        return closest_packet(table_at(item, SHAPE), packet, t_min)
    found = 0
    if is_mesh:
        move_packet(item, packet, moved)
        found = closest_packet(table_at(item, SHAPE), moved, t_min)
        better = mask16(found)
        store16d(packet, END, select16d(better, load16d(moved, END), load16d(packet, END)))
        store16d(packet, PRIM, select16d(better, load16d(moved, PRIM), load16d(packet, PRIM)))
        return found
    for lane in range(16):
        o, d = packet_vec3(packet, ORIGIN + lane), packet_vec3(packet, DIRECTION + lane)
        t_max = f64_at(packet, END + lane)
        if t_min < t_max and is_ray(o, d):
            hit = intersect_item(item, o, d, t_min, t_max)
            if hit.t < t_max:
                f64_put(packet, END + lane, hit.t)
                f64_put(packet, PRIM + lane, float(hit.prim))
                found |= 1 << lane
    return found


@kernel
def closest_of_few(
    world: Table, kinds: Table, n_items: i64, origins: Table, o_form: i64, directions: Table, d_form: i64, ends: Table,
    e_form: i64, t_min: f64, n: i64, t: Table, items: Table, objects: Table, primitives: Table, stop: Table,
) -> None:  # fmt: skip
    """The nearest hit of each ray: float64 t, and int32 item, object and primitive, -1 where there is none."""
    packet, moved = scratch(160), scratch(128)
    rows = table_at(world, ITEMS)
    for first in range(0, n, 16):
        if first & LOOK == 0 and i64_at(stop, 0) != 0:
            return
        count, found = min(16, n - first), 0
        fill_packet(origins, o_form, directions, d_form, ends, e_form, first, count, packet)
        none = splat16d(-1.0)
        store16d(packet, PRIM, none)
        item, thing = none, none
        for index in range(n_items):
            row = item_at(rows, index)
            met = closest_of_item(row, int_at(kinds, index) == MESH, packet, moved, t_min)
            if met != 0:
                found |= met
                item = select16d(mask16(met), splat16d(float(index)), item)
                thing = select16d(mask16(met), splat16d(float(i64_at(row, OBJECT))), thing)
        far = select16d(mask16(found), load16d(packet, END), splat16d(math.inf))
        if count == 16:
            store16d(t, first, far)
            put_ints16(items, first, item)
            put_ints16(objects, first, thing)
            put_ints16(primitives, first, load16d(packet, PRIM))
        else:
            store16d(packet, END, far)
            store16d(packet, ITEM, item)
            store16d(packet, BATCH_OBJECT, thing)
            for lane in range(count):
                f64_put(t, first + lane, f64_at(packet, END + lane))
                i32_put(items, first + lane, int(f64_at(packet, ITEM + lane)))
                i32_put(objects, first + lane, int(f64_at(packet, BATCH_OBJECT + lane)))
                i32_put(primitives, first + lane, int(f64_at(packet, PRIM + lane)))


@kernel
def any_of_item(item: Table, is_mesh: bool, packet: Table, moved: Table, t_min: f64) -> i64:
    """The rays of a packet that meet an item before their end."""
    if is_mesh and i64_at(item, MOVED) == 0:
        return any_packet(table_at(item, SHAPE), packet, t_min)
    if is_mesh:
        move_packet(item, packet, moved)
        return any_packet(table_at(item, SHAPE), moved, t_min)
    found = 0
    for lane in range(16):
        o, d = packet_vec3(packet, ORIGIN + lane), packet_vec3(packet, DIRECTION + lane)
        t_max = f64_at(packet, END + lane)
        if t_min < t_max and is_ray(o, d) and occluded_item(item, o, d, t_min, t_max):
            found |= 1 << lane
    return found


@kernel
def any_of_few(
    world: Table, kinds: Table, n_items: i64, origins: Table, o_form: i64, directions: Table, d_form: i64, ends: Table,
    e_form: i64, t_min: f64, n: i64, blocked: Table, stop: Table,
) -> None:  # fmt: skip
    """Whether each ray meets anything: one byte a ray; `blocked` is sixteen bytes longer than n."""
    packet, moved = scratch(128), scratch(128)
    rows = table_at(world, ITEMS)
    for first in range(0, n, 16):
        if first & LOOK == 0 and i64_at(stop, 0) != 0:
            return
        count, found = min(16, n - first), 0
        fill_packet(origins, o_form, directions, d_form, ends, e_form, first, count, packet)
        for index in range(n_items):
            met = any_of_item(item_at(rows, index), int_at(kinds, index) == MESH, packet, moved, t_min)
            if met != 0:  # who is blocked need not ask the next item
                found |= met
                store16d(packet, END, select16d(mask16(met), splat16d(math.nan), load16d(packet, END)))
        put_bytes16(blocked, first >> 3, mask16(found))
