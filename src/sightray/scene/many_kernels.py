"""Batches of rays, 256 at a time in packets, through the tree over the items of a scene: for scenes of more than a few.

Columns and forms are those of `query_kernels`; what the packets do, stands in `accelerators.item_packets`.
"""

from __future__ import annotations

import math

from sightray._jit import kernel
from sightray.accelerators.item import OBJECT, item_at
from sightray.accelerators.item_packets import any_of_items, closest_of_items
from sightray.accelerators.item_turns import ANSWER_WORDS, ITEM, LIMIT, T
from sightray.bvh.bvh8 import int_at
from sightray.bvh.casting import END, PACKET_WORDS, PRIM
from sightray.mathlib.lanes import load16d, lowest_bit, mask16, movemask16, put_bytes16, select16d, splat16d, store16d
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, advance, f64_at, f64_put, i64_at, i64_put, scratch, table_at
from sightray.scene.packet_kernels import RAYS, fill_packets, put_answers
from sightray.scene.query_kernels import LOOK
from sightray.scene.world import ITEMS, MERGED, TREE
from sightray.scene.world import ORIGIN as MERGED_ORIGIN


@kernel
def reset_answers(packets: Table, count: i64, answers: Table) -> None:
    """No ray has met anything yet."""
    for p in range(count):
        answer = advance(answers, p * ANSWER_WORDS)
        store16d(answer, T, splat16d(math.inf))
        store16d(answer, ITEM, splat16d(-1.0))
        store16d(answer, LIMIT, load16d(packets, p * PACKET_WORDS + END))


@kernel
def name_hits(
    world: Table, packets: Table, answers: Table, count: i64, found: Table, items: Table, things: Table
) -> None:
    """Item and object of each hit; what belongs to meshes that were put together goes back to those."""
    rows, origin, none = table_at(world, ITEMS), table_at(world, MERGED_ORIGIN), splat16d(-1.0)
    for p in range(count):
        packet, answer = advance(packets, p * PACKET_WORDS), advance(answers, p * ANSWER_WORDS)
        bits = movemask16(load16d(answer, ITEM) >= splat16d(0.0))
        i64_put(found, p, bits)
        store16d(packet, END, load16d(answer, T))
        store16d(packet, PRIM, select16d(mask16(bits), load16d(packet, PRIM), none))
        store16d(items, 16 * p, load16d(answer, ITEM))
        store16d(things, 16 * p, none)
        while bits != 0:
            lane = lowest_bit(bits)
            bits &= bits - 1
            index = int(f64_at(answer, ITEM + lane))
            if index == i64_at(world, MERGED):
                prim = int(f64_at(packet, PRIM + lane))
                index = int_at(origin, 2 * prim)
                f64_put(packet, PRIM + lane, float(int_at(origin, 2 * prim + 1)))
                f64_put(items, 16 * p + lane, float(index))
            f64_put(things, 16 * p + lane, float(i64_at(item_at(rows, index), OBJECT)))


@kernel
def closest_of_many(
    world: Table, origins: Table, o_form: i64, directions: Table, d_form: i64, ends: Table, e_form: i64, t_min: f64,
    n: i64, t: Table, items: Table, objects: Table, primitives: Table, stop: Table, room: Table,
) -> None:  # fmt: skip
    """The nearest hit of each ray: float64 t, and int32 item, object and primitive, -1 where there is none."""
    packets, answers, item, thing, found = scratch(2048), scratch(768), scratch(256), scratch(256), scratch(16)
    for first in range(0, n, RAYS):
        if first & LOOK == 0 and i64_at(stop, 0) != 0:
            return
        count = fill_packets(origins, o_form, directions, d_form, ends, e_form, first, n, packets)
        reset_answers(packets, count, answers)
        closest_of_items(table_at(world, TREE), packets, answers, count, t_min, room)
        name_hits(world, packets, answers, count, found, item, thing)
        put_answers(first, n, packets, count, found, item, thing, t, items, objects, primitives)


@kernel
def any_of_many(
    world: Table, origins: Table, o_form: i64, directions: Table, d_form: i64, ends: Table, e_form: i64, t_min: f64,
    n: i64, blocked: Table, stop: Table, room: Table,
) -> None:  # fmt: skip
    """Whether each ray meets anything: one byte a ray; `blocked` is sixteen bytes longer than n."""
    packets, found = scratch(2048), scratch(16)
    for first in range(0, n, RAYS):
        if first & LOOK == 0 and i64_at(stop, 0) != 0:
            return
        count = fill_packets(origins, o_form, directions, d_form, ends, e_form, first, n, packets)
        any_of_items(table_at(world, TREE), packets, count, t_min, found, room)
        for p in range(count):
            put_bytes16(blocked, (first >> 3) + 2 * p, mask16(i64_at(found, p)))
