"""Coherent rays through the tree over a scene's items: packets of sixteen in groups, as `bvh.packets` has them in a mesh.

A group walks the tree by its interval ray. At a leaf every ray of its packets meets the box of the item, in single
precision; packets of which any does are brought to the item's object space, where its shape meets all of their rays
together (`shapes.base.closest_in_packets`). Packets that belong to no group are left to single rays.

What a packet's rays have met stands in its **answers**: where (`T`, infinite at first), which item (`ITEM`, -1 at first),
and where each ray ends if it meets nothing (`LIMIT`). The packet's own `END` lies just behind `T`, so that what another
item has at the same place is seen: of two the lower number counts, whatever the order, as for single rays.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.accelerators.bvh import BOUNDED_COUNT, ITEMS, LEAF_FLOATS, LEAF_ITEM, LEAVES, UNBOUNDED, UNBOUNDED_COUNT
from sightray.accelerators.item import MET as MET_SHAPE
from sightray.accelerators.item import MOVED, OBJECT_FROM_WORLD, PLACED, TINY, item_at
from sightray.accelerators.item_turns import ANSWER_WORDS, ITEM, LIMIT, T, any_alone, closest_alone, prefetch_child
from sightray.bvh.bvh8 import CHILD, CHILDREN, LEAF, NODE_FLOATS, NODES, int_at, pop_near
from sightray.bvh.casting import (
    DIRECTION,
    END,
    END_AT,
    FROM,
    LANE_WORDS,
    ORIGIN,
    PACKET_WORDS,
    PRIM,
    SIDE,
    WORK_WORDS,
    R,
)
from sightray.bvh.hulls import ALIVE, FIRST, KEY, LEFT, MET, OCTANT, REACHES, STACK, TOP, meet_interval, put_reach
from sightray.bvh.packets import (
    GROUPS,
    LANES,
    ROOM_WORDS,
    WORKS,
    Turns,
    form_groups,
    group_at,
    note_apart,
    note_groups,
    rays_apart,
)
from sightray.bvh.sixteen import lanes_at, reach_of
from sightray.bvh.triangles import SIDES
from sightray.mathlib.lanes import (
    F32x16,
    abs16d,
    count_bits,
    flip16,
    load8,
    load16,
    load16d,
    lowest_bit,
    mask16,
    movemask8,
    movemask16,
    push8,
    push_all8,
    select16,
    select16d,
    sort8,
    splat16,
    splat16d,
    store16,
    store16d,
    vmax16,
    vmin16,
    vmin16d,
)
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, advance, f64_at, i64_at, i64_put, scratch, table_at
from sightray.shapes.base import any_in_packets, closest_in_packets

SPREAD, GROUP_SPREAD = 0.2, 0.4  # as in `bvh.packets`

# Words of the room: for the walk through this tree, for that through a shape, and four packets in the shape's space.
INNER = ROOM_WORDS
THERE = 2 * ROOM_WORDS
ITEM_ROOM_WORDS = THERE + 4 * PACKET_WORDS


# ------------------------------------------------------------------------------------------------------------- one item


@kernel
def bring_packet(item: Table, packet: Table, there: Table) -> None:
    """The rays of a packet in an item's object space: to the last bit what `transform_point` and `_vector` make of one."""
    for axis in range(3):
        at = OBJECT_FROM_WORLD + axis
        x, y, z = splat16d(f64_at(item, at)), splat16d(f64_at(item, at + 4)), splat16d(f64_at(item, at + 8))
        o = x * load16d(packet, ORIGIN) + y * load16d(packet, ORIGIN + 16) + z * load16d(packet, ORIGIN + 32)
        d = x * load16d(packet, DIRECTION) + y * load16d(packet, DIRECTION + 16) + z * load16d(packet, DIRECTION + 32)
        store16d(there, ORIGIN + 16 * axis, o + splat16d(f64_at(item, at + 12)))
        store16d(there, DIRECTION + 16 * axis, d)


@kernel
def gather_packets(item: Table, packets: Table, asked: Table, there: Table) -> i64:
    """Put the rays `asked` of four packets side by side in the item's object space; how many packets have any."""
    count = 0
    for p in range(4):
        bits = i64_at(asked, p)
        if bits != 0:
            packet, its = advance(packets, p * PACKET_WORDS), advance(there, count * PACKET_WORDS)
            count += 1
            if i64_at(item, MOVED) == PLACED:
                bring_packet(item, packet, its)
            else:
                for row in range(6):
                    store16d(its, 16 * row, load16d(packet, 16 * row))
            store16d(its, END, select16d(mask16(bits), load16d(packet, END), splat16d(math.nan)))
    return count


@kernel
def closest_of_item(
    item: Table, index: i64, packets: Table, answers: Table, asked: Table, t_min: f64, room: Table
) -> None:
    """Note where the rays `asked`, bits of four packets, meet an item nearer than anything; their bits replace those."""
    there, found, k = advance(room, THERE), scratch(4), 0
    count = gather_packets(item, packets, asked, there)
    closest_in_packets(table_at(item, MET_SHAPE), there, count, t_min, found, advance(room, INNER))
    for p in range(4):
        if i64_at(asked, p) != 0:
            packet, answer = advance(packets, p * PACKET_WORDS), advance(answers, p * ANSWER_WORDS)
            its = advance(there, k * PACKET_WORDS)
            i64_put(asked, p, keep_nearer(packet, answer, its, i64_at(found, k), index))
            k += 1


@kernel
def keep_nearer(packet: Table, answer: Table, there: Table, met: i64, index: i64) -> i64:
    """Take over what the rays `met` of a packet have found at an item, where it is better; their bits."""
    t, best, number = load16d(there, END), load16d(answer, T), splat16d(float(index))
    better = mask16(met) & ((t < best) | ((t <= best) & (number < load16d(answer, ITEM))))
    bits = movemask16(better)
    if bits != 0:
        store16d(answer, T, select16d(better, t, best))
        store16d(answer, ITEM, select16d(better, number, load16d(answer, ITEM)))
        end = vmin16d(load16d(answer, LIMIT), t + (abs16d(t) * splat16d(2.0**-52) + splat16d(TINY)))  # `just_behind`
        store16d(packet, END, select16d(better, end, load16d(packet, END)))
        store16d(packet, PRIM, select16d(better, load16d(there, PRIM), load16d(packet, PRIM)))
    return bits


@kernel
def any_of_item(item: Table, packets: Table, asked: Table, t_min: f64, room: Table) -> None:
    """Find which of the rays `asked`, bits of four packets, an item stops; their bits replace those."""
    there, found, k = advance(room, THERE), scratch(4), 0
    count = gather_packets(item, packets, asked, there)
    any_in_packets(table_at(item, MET_SHAPE), there, count, t_min, found, advance(room, INNER))
    for p in range(4):
        if i64_at(asked, p) != 0:
            i64_put(asked, p, i64_at(found, k))
            k += 1


# ------------------------------------------------------------------------------------------------------------- one leaf


class Sides(NamedTuple):
    """Along one axis, for sixteen rays: lengths to where they are between the sides of a box."""

    near: F32x16
    far: F32x16


@kernel
def meet_sides(leaves: Table, at: i64, axis: i64, up: bool, lanes: Table) -> Sides:
    """Meet the two sides of a box across an axis that all rays go up, or all down; with the slack of trees."""
    near, far = (at + axis, at + 3 + axis) if up else (at + 3 + axis, at + axis)
    o, r = load16(lanes, FROM + 16 * axis), load16(lanes, R + 16 * axis)
    slack = flip16(r, r) * load16(lanes, SIDE) * splat16(1 / SIDES)
    return Sides((lanes_at(leaves, near) - o) * r - slack, (lanes_at(leaves, far) - o) * r + slack)


@kernel
def meet_box(leaves: Table, at: i64, octant: i64, lanes: Table) -> i64:
    """The rays of a packet that meet a box before they end, a bit each."""
    x, y = meet_sides(leaves, at, 0, octant & 1 != 0, lanes), meet_sides(leaves, at, 1, octant & 2 != 0, lanes)
    z = meet_sides(leaves, at, 2, octant & 4 != 0, lanes)
    near = vmax16(vmax16(x.near, y.near), vmax16(z.near, splat16(0.0)))
    far = vmin16(vmin16(x.far, y.far), vmin16(z.far, load16(lanes, END_AT)))
    return movemask16(near <= far)


@kernel
def meet_leaf(leaves: Table, leaf: i64, group: Table, room: Table, asked: Table) -> bool:
    """Write bits of a group's rays, four packets, that meet the box of an item; whether there are any."""
    first, octant, some = i64_at(group, FIRST), i64_at(group, OCTANT), 0
    for p in range(4):
        bits = i64_at(group, ALIVE + p)
        if bits != 0:
            bits &= meet_box(leaves, leaf * LEAF_FLOATS, octant, advance(room, LANES + (first + p) * LANE_WORDS))
        i64_put(asked, p, bits)
        some |= bits
    return some != 0


@kernel
def closest_at_leaf(
    tree: Table, leaf: i64, packets: Table, answers: Table, t_min: f64, group: Table, room: Table
) -> None:
    """Meet an item with the rays of a group."""
    leaves, first, asked = table_at(tree, LEAVES), i64_at(group, FIRST), scratch(4)
    if meet_leaf(leaves, leaf, group, room, asked):
        index = int_at(leaves, leaf * LEAF_FLOATS + LEAF_ITEM)
        its, noted = advance(packets, first * PACKET_WORDS), advance(answers, first * ANSWER_WORDS)
        closest_of_item(item_at(table_at(tree, ITEMS), index), index, its, noted, asked, t_min, room)
        for p in range(4):
            better = i64_at(asked, p)
            if better != 0:
                lanes, work = (
                    advance(room, LANES + (first + p) * LANE_WORDS),
                    advance(room, WORKS + (first + p) * WORK_WORDS),
                )
                reach = reach_of(work, load16d(packets, (first + p) * PACKET_WORDS + END))
                store16(lanes, END_AT, select16(mask16(better), reach, load16(lanes, END_AT)))
                put_reach(group, p, lanes)


@kernel
def any_at_leaf(tree: Table, leaf: i64, packets: Table, t_min: f64, group: Table, room: Table) -> None:
    """Find the rays of a group that an item stops."""
    leaves, first, asked = table_at(tree, LEAVES), i64_at(group, FIRST), scratch(4)
    if meet_leaf(leaves, leaf, group, room, asked):
        item = item_at(table_at(tree, ITEMS), int_at(leaves, leaf * LEAF_FLOATS + LEAF_ITEM))
        any_of_item(item, advance(packets, first * PACKET_WORDS), asked, t_min, room)
        for p in range(4):
            stopped = i64_at(asked, p)
            if stopped != 0:
                alive, lanes = i64_at(group, ALIVE + p), advance(room, LANES + (first + p) * LANE_WORDS)
                i64_put(group, MET + p, i64_at(group, MET + p) | stopped)
                i64_put(group, ALIVE + p, alive & ~stopped)
                i64_put(group, LEFT, i64_at(group, LEFT) - count_bits(stopped))
                store16(lanes, END_AT, select16(mask16(stopped), splat16(-1.0), load16(lanes, END_AT)))
                if stopped == alive:
                    put_reach(group, p, lanes)


# ------------------------------------------------------------------------------------------------------------- the tree


@kernel
def go_on(tree: Table, group: Table, now: Turns, g: i64, key: i64, top: i64) -> Turns:
    """Note what group g visits next and ask for its memory; the root means that nothing is left."""
    i64_put(group, KEY, key)
    i64_put(group, TOP, top)
    child = key & CHILD
    prefetch_child(tree, child)
    leaf = child >> 30
    node = 1 - leaf if child != 0 else 0
    return Turns(now.nodes | node << g, now.leaves | leaf << g)


@kernel
def closest_together(tree: Table, packets: Table, answers: Table, t_min: f64, groups: i64, room: Table) -> None:
    """Nearest hits of the rays of all groups, which take turns."""
    nodes = table_at(tree, NODES)
    now = Turns((1 << groups) - 1, 0)
    while now.nodes | now.leaves != 0:
        turn = now.nodes | now.leaves
        leaves = now.leaves
        now = Turns(0, 0)
        while turn != 0:
            g = lowest_bit(turn)
            turn &= turn - 1
            group = group_at(room, g)
            child, top = i64_at(group, KEY) & CHILD, i64_at(group, TOP)
            if leaves >> g & 1 != 0:
                first = (child - LEAF) >> 3
                for leaf in range(first, first + (child & 7)):
                    closest_at_leaf(tree, leaf, packets, answers, t_min, group, room)
            else:
                met = meet_interval(nodes, child * NODE_FLOATS, group)
                codes = load8(nodes, child * NODE_FLOATS + CHILDREN)
                push_all8(advance(group, STACK), top, sort8(met.near, codes, met.met))
                top += count_bits(movemask8(met.met))
            next = pop_near(advance(group, STACK), top, f64_at(group, REACHES))
            now = go_on(tree, group, now, g, next.key, next.top)


@kernel
def any_together(tree: Table, packets: Table, t_min: f64, groups: i64, room: Table) -> None:
    """Which rays of all groups are stopped; these take turns."""
    nodes = table_at(tree, NODES)
    now = Turns((1 << groups) - 1, 0)
    while now.nodes | now.leaves != 0:
        turn = now.nodes | now.leaves
        leaves = now.leaves
        now = Turns(0, 0)
        while turn != 0:
            g = lowest_bit(turn)
            turn &= turn - 1
            group = group_at(room, g)
            child, top, stack = i64_at(group, KEY), i64_at(group, TOP), advance(group, STACK)
            if leaves >> g & 1 != 0:
                first = (child - LEAF) >> 3
                for leaf in range(first, first + (child & 7)):
                    any_at_leaf(tree, leaf, packets, t_min, group, room)
            else:
                bits = movemask8(meet_interval(nodes, child * NODE_FLOATS, group).met)
                push8(stack, top, load8(nodes, child * NODE_FLOATS + CHILDREN), bits)
                top += count_bits(bits)
            if i64_at(group, LEFT) > 0:
                now = go_on(tree, group, now, g, i64_at(stack, top - 1), top - 1)


@kernel
def closest_of_items(tree: Table, packets: Table, answers: Table, count: i64, t_min: f64, room: Table) -> None:
    """Nearest hits beyond t_min of the rays of up to sixteen packets with any item: fills answers, and `PRIM`."""
    for i in range(i64_at(tree, UNBOUNDED_COUNT)):
        index = int_at(table_at(tree, UNBOUNDED), i)
        for first in range(0, count, 4):
            asked = scratch(4)
            ask_all(packets, first, count, t_min, asked)
            its, noted = advance(packets, first * PACKET_WORDS), advance(answers, first * ANSWER_WORDS)
            closest_of_item(item_at(table_at(tree, ITEMS), index), index, its, noted, asked, t_min, room)
    if i64_at(tree, BOUNDED_COUNT) == 0:
        return
    apart, found = scratch(16), scratch(16)
    groups = form_groups(tree, packets, count, t_min, SPREAD, GROUP_SPREAD, apart, found, room)
    closest_together(tree, packets, answers, t_min, groups, room)
    for first in range(0, count, 4):
        alone = rays_apart(apart, first, count)
        if alone != 0:
            works, lanes = advance(room, WORKS + first * WORK_WORDS), advance(room, LANES + first * LANE_WORDS)
            its, noted = advance(packets, first * PACKET_WORDS), advance(answers, first * ANSWER_WORDS)
            closest_alone(tree, its, noted, t_min, alone, works, lanes, advance(room, GROUPS))


@kernel
def ask_all(packets: Table, first: i64, count: i64, t_min: f64, asked: Table) -> None:
    """Write the bits of all rays of four packets, as far as there are any."""
    for p in range(4):
        bits = 0
        if first + p < count:
            bits = movemask16(splat16d(t_min) < load16d(packets, (first + p) * PACKET_WORDS + END))
        i64_put(asked, p, bits)


@kernel
def any_of_items(tree: Table, packets: Table, count: i64, t_min: f64, found: Table, room: Table) -> None:
    """The rays of up to sixteen packets that any item stops between t_min and their end; these end nowhere then."""
    asked, met, apart = scratch(4), scratch(16), scratch(16)
    for p in range(count):
        i64_put(found, p, 0)
    for i in range(i64_at(tree, UNBOUNDED_COUNT)):
        item = item_at(table_at(tree, ITEMS), int_at(table_at(tree, UNBOUNDED), i))
        for first in range(0, count, 4):
            ask_all(packets, first, count, t_min, asked)
            any_of_item(item, advance(packets, first * PACKET_WORDS), asked, t_min, room)
            for p in range(first, min(first + 4, count)):
                stop_rays(packets, p, i64_at(asked, p - first), found)
    if i64_at(tree, BOUNDED_COUNT) == 0:
        return
    groups = form_groups(tree, packets, count, t_min, SPREAD, GROUP_SPREAD, apart, met, room)
    any_together(tree, packets, t_min, groups, room)
    note_groups(groups, met, room)
    for first in range(0, count, 4):
        alone = rays_apart(apart, first, count)
        if alone != 0:
            works, lanes = advance(room, WORKS + first * WORK_WORDS), advance(room, LANES + first * LANE_WORDS)
            its, rest = advance(packets, first * PACKET_WORDS), advance(room, GROUPS)
            note_apart(met, first, count, any_alone(tree, its, t_min, alone, works, lanes, rest))
    for p in range(count):
        i64_put(found, p, i64_at(found, p) | i64_at(met, p))


@kernel
def stop_rays(packets: Table, p: i64, stopped: i64, found: Table) -> None:
    """Note that rays of a packet are stopped; they meet nothing more."""
    i64_put(found, p, i64_at(found, p) | stopped)
    end = load16d(packets, p * PACKET_WORDS + END)
    store16d(packets, p * PACKET_WORDS + END, select16d(mask16(stopped), splat16d(math.nan), end))
