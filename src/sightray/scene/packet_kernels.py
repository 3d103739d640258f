"""Batches of rays, 256 at a time in packets, for scenes of few items: `query_kernels` with packets (see `bvh.packets`).

Every item is asked in turn, so no tree over items is walked; up to `FEW_ITEMS` that is the faster way. Meshes are met by
packets, other shapes ray by ray. Columns and forms are those of `query_kernels`.
"""

from __future__ import annotations

import math

from sightray._jit import kernel
from sightray.accelerators.item import MOVED, OBJECT, SHAPE, intersect_item, item_at, occluded_item
from sightray.accelerators.item_packets import bring_packet
from sightray.bvh.bundles import packet_vec3
from sightray.bvh.bvh8 import int_at
from sightray.bvh.casting import DIRECTION, END, ORIGIN, PACKET_WORDS, PRIM
from sightray.bvh.packets import PACKETS, ROOM_WORDS, any_rays, closest_rays, fast_rays
from sightray.mathlib.lanes import (
    load16,
    load16d,
    mask16,
    put_bytes16,
    put_ints16,
    select16d,
    splat16d,
    store16d,
    transpose16,
    transpose16d,
    widen16,
)
from sightray.mathlib.rays import is_ray
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, advance, f64_at, f64_put, i32_put, i64_at, i64_put, scratch, table_at
from sightray.mathlib.vec import Vec3
from sightray.scene.crossings import MESH
from sightray.scene.query_kernels import LOOK, number_at, step_of, triple_at
from sightray.scene.world import ITEMS

FEW_ITEMS = 4
RAYS = 16 * PACKETS  # that go together
SINGLE_ROWS, DOUBLE_ROWS = 1 << 32 | 7, 1 << 32 | 6  # forms of contiguous (n, 3) arrays
SINGLE_COLUMNS, DOUBLE_COLUMNS = 3, 2  # the low halves of the forms of (3, n) arrays


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
    elif count == 16 and form & 0xFFFFFFFF == SINGLE_COLUMNS:
        for axis in range(3):
            store16d(packet, at + 16 * axis, widen16(load16(column, first + (form >> 32) * axis)))
    elif count == 16 and form & 0xFFFFFFFF == DOUBLE_COLUMNS:
        for axis in range(3):
            store16d(packet, at + 16 * axis, load16d(column, first + (form >> 32) * axis))
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
    if step_of(e_form) == 0 and count == 16:
        store16d(packet, END, splat16d(number_at(ends, e_form, 0)))
    else:
        store16d(packet, END, splat16d(math.nan))
        for lane in range(count):
            f64_put(packet, END + lane, number_at(ends, e_form, step_of(e_form) * (first + lane)))


@kernel
def fill_packets(
    origins: Table, o_form: i64, directions: Table, d_form: i64, ends: Table, e_form: i64, first: i64, n: i64,
    packets: Table,
) -> i64:  # fmt: skip
    """Read the rays from `first` on into up to sixteen packets; the number of these."""
    count = (min(RAYS, n - first) + 15) // 16
    for p in range(count):
        start = first + 16 * p
        packet = advance(packets, p * PACKET_WORDS)
        fill_packet(origins, o_form, directions, d_form, ends, e_form, start, min(16, n - start), packet)
    return count


@kernel
def move_packets(item: Table, packets: Table, count: i64, moved: Table) -> None:
    """Packets in the item's object space; t means the same there."""
    for p in range(count):
        packet, there = advance(packets, p * PACKET_WORDS), advance(moved, p * PACKET_WORDS)
        bring_packet(item, packet, there)
        store16d(there, END, load16d(packet, END))


@kernel
def bring_back(packets: Table, moved: Table, count: i64, found: Table) -> None:
    """Take over the nearer ends that packets have found in an item's object space."""
    for p in range(count):
        packet, there = advance(packets, p * PACKET_WORDS), advance(moved, p * PACKET_WORDS)
        better = mask16(i64_at(found, p))
        store16d(packet, END, select16d(better, load16d(there, END), load16d(packet, END)))
        store16d(packet, PRIM, select16d(better, load16d(there, PRIM), load16d(packet, PRIM)))


@kernel
def closest_of_shape(item: Table, packets: Table, count: i64, t_min: f64, found: Table) -> None:
    """The rays of packets that meet what is no mesh before their end, which is brought there; one after the other."""
    for p in range(count):
        i64_put(found, p, 0)
        packet = advance(packets, p * PACKET_WORDS)
        for lane in range(16):
            o, d = packet_vec3(packet, ORIGIN + lane), packet_vec3(packet, DIRECTION + lane)
            t_max = f64_at(packet, END + lane)
            if t_min < t_max and is_ray(o, d):
                hit = intersect_item(item, o, d, t_min, t_max)
                if hit.t < t_max:
                    f64_put(packet, END + lane, hit.t)
                    f64_put(packet, PRIM + lane, float(hit.prim))
                    i64_put(found, p, i64_at(found, p) | 1 << lane)


@kernel
def closest_of_packets(
    item: Table, is_mesh: bool, packets: Table, count: i64, moved: Table, t_min: f64, found: Table, room: Table
) -> None:
    """The rays of packets that meet an item before their end, which is brought there."""
    if not is_mesh:
        closest_of_shape(item, packets, count, t_min, found)
    elif i64_at(item, MOVED) == 0:
        closest_rays(table_at(item, SHAPE), packets, count, t_min, found, room)
    else:
        move_packets(item, packets, count, moved)
        closest_rays(table_at(item, SHAPE), moved, count, t_min, found, room)
        bring_back(packets, moved, count, found)


@kernel
def fast_of_packets(
    item: Table, is_mesh: bool, packets: Table, count: i64, moved: Table, t_min: f64, found: Table, room: Table
) -> None:
    """`closest_of_packets`, decided in single precision where it is a mesh."""
    if not is_mesh:
        closest_of_shape(item, packets, count, t_min, found)
    elif i64_at(item, MOVED) == 0:
        fast_rays(table_at(item, SHAPE), packets, count, t_min, found, room)
    else:
        move_packets(item, packets, count, moved)
        fast_rays(table_at(item, SHAPE), moved, count, t_min, found, room)
        bring_back(packets, moved, count, found)


@kernel
def closest_of_item(item: Table, is_mesh: bool, packets: Table, count: i64, moved: Table, t_min: f64) -> i64:
    """`closest_of_packets` for up to four packets, with working memory of its own; the bits of the rays."""
    found, room, bits = scratch(16), scratch(ROOM_WORDS), 0
    closest_of_packets(item, is_mesh, packets, count, moved, t_min, found, room)
    for p in range(count):
        bits |= i64_at(found, p) << (16 * p)
    return bits


@kernel
def reset_answers(packets: Table, count: i64, found: Table, item: Table, thing: Table) -> None:
    """No ray has met anything yet."""
    none = splat16d(-1.0)
    for p in range(count):
        i64_put(found, p, 0)
        store16d(packets, p * PACKET_WORDS + PRIM, none)
        store16d(item, 16 * p, none)
        store16d(thing, 16 * p, none)


@kernel
def note_item(index: i64, row: Table, count: i64, met: Table, found: Table, item: Table, thing: Table) -> None:
    """Note of which item and object the hits are that were found last."""
    for p in range(count):
        these = mask16(i64_at(met, p))
        i64_put(found, p, i64_at(found, p) | i64_at(met, p))
        store16d(item, 16 * p, select16d(these, splat16d(float(index)), load16d(item, 16 * p)))
        number = splat16d(float(i64_at(row, OBJECT)))
        store16d(thing, 16 * p, select16d(these, number, load16d(thing, 16 * p)))


@kernel
def put_answers(
    first: i64, n: i64, packets: Table, count: i64, found: Table, item: Table, thing: Table, t: Table, items: Table,
    objects: Table, primitives: Table,
) -> None:  # fmt: skip
    """Write the answers of the packets from ray number `first` on: sixteen at a time, and the rest one by one."""
    for p in range(count):
        start, packet = first + 16 * p, advance(packets, p * PACKET_WORDS)
        met16 = mask16(i64_at(found, p))
        store16d(packet, END, select16d(met16, load16d(packet, END), splat16d(math.inf)))
        if start + 16 <= n:
            store16d(t, start, load16d(packet, END))
            put_ints16(items, start, load16d(item, 16 * p))
            put_ints16(objects, start, load16d(thing, 16 * p))
            put_ints16(primitives, start, load16d(packet, PRIM))
        else:
            for lane in range(n - start):
                f64_put(t, start + lane, f64_at(packet, END + lane))
                i32_put(items, start + lane, int(f64_at(item, 16 * p + lane)))
                i32_put(objects, start + lane, int(f64_at(thing, 16 * p + lane)))
                i32_put(primitives, start + lane, int(f64_at(packet, PRIM + lane)))


@kernel
def closest_of_few(
    world: Table, kinds: Table, n_items: i64, origins: Table, o_form: i64, directions: Table, d_form: i64, ends: Table,
    e_form: i64, t_min: f64, n: i64, t: Table, items: Table, objects: Table, primitives: Table, stop: Table, room: Table,
) -> None:  # fmt: skip
    """The nearest hit of each ray: float64 t, and int32 item, object and primitive, -1 where there is none."""
    packets, moved, item, thing = scratch(2048), scratch(2048), scratch(256), scratch(256)
    met, found, rows = scratch(16), scratch(16), table_at(world, ITEMS)
    for first in range(0, n, RAYS):
        if first & LOOK == 0 and i64_at(stop, 0) != 0:
            return
        count = fill_packets(origins, o_form, directions, d_form, ends, e_form, first, n, packets)
        reset_answers(packets, count, found, item, thing)
        for index in range(n_items):  # each item brings the ends nearer of the rays that meet it
            row = item_at(rows, index)
            closest_of_packets(row, int_at(kinds, index) == MESH, packets, count, moved, t_min, met, room)
            note_item(index, row, count, met, found, item, thing)
        put_answers(first, n, packets, count, found, item, thing, t, items, objects, primitives)


@kernel
def fast_of_few(
    world: Table, kinds: Table, n_items: i64, origins: Table, o_form: i64, directions: Table, d_form: i64, ends: Table,
    e_form: i64, t_min: f64, n: i64, t: Table, items: Table, objects: Table, primitives: Table, stop: Table, room: Table,
) -> None:  # fmt: skip
    """`closest_of_few` in single precision; a kernel of its own, so that nobody compiles it who does not ask for it."""
    packets, moved, item, thing = scratch(2048), scratch(2048), scratch(256), scratch(256)
    met, found, rows = scratch(16), scratch(16), table_at(world, ITEMS)
    for first in range(0, n, RAYS):
        if first & LOOK == 0 and i64_at(stop, 0) != 0:
            return
        count = fill_packets(origins, o_form, directions, d_form, ends, e_form, first, n, packets)
        reset_answers(packets, count, found, item, thing)
        for index in range(n_items):  # each item brings the ends nearer of the rays that meet it
            row = item_at(rows, index)
            fast_of_packets(row, int_at(kinds, index) == MESH, packets, count, moved, t_min, met, room)
            note_item(index, row, count, met, found, item, thing)
        put_answers(first, n, packets, count, found, item, thing, t, items, objects, primitives)


@kernel
def any_of_packets(
    item: Table, is_mesh: bool, packets: Table, count: i64, moved: Table, t_min: f64, found: Table, room: Table
) -> None:
    """The rays of packets that meet an item before their end."""
    if is_mesh and i64_at(item, MOVED) == 0:
        any_rays(table_at(item, SHAPE), packets, count, t_min, found, room)
    elif is_mesh:
        move_packets(item, packets, count, moved)
        any_rays(table_at(item, SHAPE), moved, count, t_min, found, room)
    else:
        for p in range(count):
            i64_put(found, p, 0)
            packet = advance(packets, p * PACKET_WORDS)
            for lane in range(16):
                o, d = packet_vec3(packet, ORIGIN + lane), packet_vec3(packet, DIRECTION + lane)
                t_max = f64_at(packet, END + lane)
                if t_min < t_max and is_ray(o, d) and occluded_item(item, o, d, t_min, t_max):
                    i64_put(found, p, i64_at(found, p) | 1 << lane)


@kernel
def any_of_few(
    world: Table, kinds: Table, n_items: i64, origins: Table, o_form: i64, directions: Table, d_form: i64, ends: Table,
    e_form: i64, t_min: f64, n: i64, blocked: Table, stop: Table, room: Table,
) -> None:  # fmt: skip
    """Whether each ray meets anything: one byte a ray; `blocked` is sixteen bytes longer than n."""
    packets, moved, met, found = scratch(2048), scratch(2048), scratch(16), scratch(16)
    rows = table_at(world, ITEMS)
    for first in range(0, n, RAYS):
        if first & LOOK == 0 and i64_at(stop, 0) != 0:
            return
        count = fill_packets(origins, o_form, directions, d_form, ends, e_form, first, n, packets)
        for p in range(count):
            i64_put(found, p, 0)
        for index in range(n_items):
            any_of_packets(item_at(rows, index), int_at(kinds, index) == MESH, packets, count, moved, t_min, met, room)
            for p in range(count):  # who is blocked need not ask the next item
                i64_put(found, p, i64_at(found, p) | i64_at(met, p))
                end, these = load16d(packets, p * PACKET_WORDS + END), mask16(i64_at(met, p))
                store16d(packets, p * PACKET_WORDS + END, select16d(these, splat16d(math.nan), end))
        for p in range(count):
            put_bytes16(blocked, (first >> 3) + 2 * p, mask16(i64_at(found, p)))
