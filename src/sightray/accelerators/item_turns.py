"""Rays that go different ways through the tree over a scene's items: up to 64 in turns, as `bvh.bundles` has them in a mesh.

Where there are many items, their tree, their rows and their shapes' rows do not fit into near caches. Each ray visits one
node, leaf or item, asks for the memory that it will read next, and the next ray has its turn. Items are met by single rays.
"""

from __future__ import annotations

from sightray._jit import kernel
from sightray.accelerators.bvh import ITEMS, LEAF_FLOATS, LEAF_ITEM, LEAF_MET, LEAVES
from sightray.accelerators.item import intersect_item, item_at, just_behind, occluded_item
from sightray.bvh.bundles import (
    NEXT,
    STACKS,
    STRIDE,
    TOPS,
    Bundle,
    board,
    box_ray_of,
    lane_of,
    packet_vec3,
    work_of,
)
from sightray.bvh.bvh8 import (
    CHILD,
    LEAF,
    NODE_FLOATS,
    NODES,
    float_at,
    int_at,
    pop_near,
    push_children_unsorted,
    visit_nearest,
)
from sightray.bvh.casting import DIRECTION, END, END_AT, LANE_WORDS, ORIGIN, PRIM, SLACK, SPEED, START
from sightray.mathlib.lanes import lowest_bit, prefetch
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, advance, f32_put, f64_at, f64_put, i64_at, i64_put, table_at

# Of the answers of a packet (see `item_packets`), sixteen doubles each.
T, ITEM, LIMIT = 0, 16, 32
ANSWER_WORDS = 48


@kernel
def prefetch_child(tree: Table, child: i64) -> None:
    """Ask for the cache lines that a child will read: four of a node, one of a leaf."""
    table = table_at(tree, NODES) if child < LEAF else table_at(tree, LEAVES)
    at = child * NODE_FLOATS if child < LEAF else ((child - LEAF) >> 3) * LEAF_FLOATS
    last = 48 if child < LEAF else 0
    prefetch(table, at)
    prefetch(table, at + (last & 16))
    prefetch(table, at + (last & 32))
    prefetch(table, at + last)


@kernel
def prefetch_item(tree: Table, leaf: i64) -> None:
    """Ask for what meeting an item reads: its row up to the matrix, and the beginning of its shape's row."""
    leaves = table_at(tree, LEAVES)
    item = item_at(table_at(tree, ITEMS), int_at(leaves, leaf * LEAF_FLOATS + LEAF_ITEM))
    shape = table_at(leaves, leaf * (LEAF_FLOATS // 2) + LEAF_MET)
    prefetch(item, 0)
    prefetch(item, 16)
    prefetch(item, 32)
    prefetch(shape, 0)
    prefetch(shape, 16)
    prefetch(shape, 32)


@kernel
def proceed(tree: Table, room: Table, now: Bundle, k: i64, key: i64, top: i64) -> Bundle:
    """Note what ray k visits next and ask for its memory; the root means that nothing is left."""
    i64_put(room, NEXT + k, key)
    i64_put(room, TOPS + k, top)
    child = key & CHILD
    prefetch_child(tree, child)
    leaf = child >> 30
    node = 1 - leaf if child != 0 else 0
    return Bundle(now.nodes | node << k, now.leaves | leaf << k)


@kernel
def closest_alone(
    tree: Table, packets: Table, answers: Table, t_min: f64, alive: i64, works: Table, all_lanes: Table, room: Table
) -> None:
    """Nearest hits of the rays `alive`, bits of four packets: fills their answers, and `PRIM`."""
    board(alive, alive, works, all_lanes, room)
    nodes = table_at(tree, NODES)
    now, due = Bundle(alive, 0), 0
    while now.nodes | now.leaves | due != 0:
        turn, leaves, meeting = now.nodes, now.leaves, due
        now, due = Bundle(0, 0), leaves
        while turn != 0:
            k = lowest_bit(turn)
            turn &= turn - 1
            stack, top = advance(room, STACKS + k * STRIDE), i64_at(room, TOPS + k)
            lanes = advance(all_lanes, (k >> 4) * LANE_WORDS)
            reach, node = float_at(lanes, END_AT + (k & 15)), i64_at(room, NEXT + k) & CHILD
            next = visit_nearest(nodes, node, box_ray_of(lanes, k & 15), reach, stack, top)
            now = proceed(tree, room, now, k, next.key, next.top)
        while leaves != 0:
            k = lowest_bit(leaves)
            leaves &= leaves - 1
            prefetch_item(tree, ((i64_at(room, NEXT + k) & CHILD) - LEAF) >> 3)
        while meeting != 0:
            k = lowest_bit(meeting)
            meeting &= meeting - 1
            lanes = advance(all_lanes, (k >> 4) * LANE_WORDS)
            leaf = ((i64_at(room, NEXT + k) & CHILD) - LEAF) >> 3
            meet_item(tree, leaf, packets, answers, t_min, works, lanes, k)
            stack, top = advance(room, STACKS + k * STRIDE), i64_at(room, TOPS + k)
            next = pop_near(stack, top, float_at(lanes, END_AT + (k & 15)))
            now = proceed(tree, room, now, k, next.key, next.top)


@kernel
def meet_item(
    tree: Table, leaf: i64, packets: Table, answers: Table, t_min: f64, works: Table, lanes: Table, k: i64
) -> None:
    """Meet the item of a leaf with ray k, and note it if it is better than what was met so far."""
    index = int_at(table_at(tree, LEAVES), leaf * LEAF_FLOATS + LEAF_ITEM)
    packet, answer, work = (
        advance(packets, lane_of(k)),
        advance(answers, (k >> 4) * ANSWER_WORDS + (k & 15)),
        advance(works, work_of(k)),
    )
    o, d = packet_vec3(packet, ORIGIN), packet_vec3(packet, DIRECTION)
    hit = intersect_item(item_at(table_at(tree, ITEMS), index), o, d, t_min, f64_at(packet, END))
    best = f64_at(answer, T)
    if hit.t < best or (hit.t == best and index < int(f64_at(answer, ITEM))):
        f64_put(answer, T, hit.t)
        f64_put(answer, ITEM, float(index))
        f64_put(packet, PRIM, float(hit.prim))
        end = min(f64_at(answer, LIMIT), just_behind(hit.t))
        f64_put(packet, END, end)
        f32_put(lanes, END_AT + (k & 15), end * f64_at(work, SPEED) - f64_at(work, START) + f64_at(work, SLACK))


@kernel
def any_alone(tree: Table, packets: Table, t_min: f64, alive: i64, works: Table, all_lanes: Table, room: Table) -> i64:
    """Which of the rays `alive`, bits of four packets, any item stops."""
    board(alive, alive, works, all_lanes, room)
    nodes = table_at(tree, NODES)
    now, due, blocked = Bundle(alive, 0), 0, 0
    while now.nodes | now.leaves | due != 0:
        turn, leaves, meeting = now.nodes, now.leaves, due
        now, due = Bundle(0, 0), leaves
        while turn != 0:
            k = lowest_bit(turn)
            turn &= turn - 1
            stack, top = advance(room, STACKS + k * STRIDE), i64_at(room, TOPS + k)
            lanes = advance(all_lanes, (k >> 4) * LANE_WORDS)
            reach, node = float_at(lanes, END_AT + (k & 15)), i64_at(room, NEXT + k) & CHILD
            top = push_children_unsorted(nodes, node, box_ray_of(lanes, k & 15), reach, stack, top) - 1
            now = proceed(tree, room, now, k, i64_at(stack, top), top)
        while leaves != 0:
            k = lowest_bit(leaves)
            leaves &= leaves - 1
            prefetch_item(tree, ((i64_at(room, NEXT + k) & CHILD) - LEAF) >> 3)
        while meeting != 0:
            k = lowest_bit(meeting)
            meeting &= meeting - 1
            leaf, packet = ((i64_at(room, NEXT + k) & CHILD) - LEAF) >> 3, advance(packets, lane_of(k))
            item = item_at(table_at(tree, ITEMS), int_at(table_at(tree, LEAVES), leaf * LEAF_FLOATS + LEAF_ITEM))
            o, d = packet_vec3(packet, ORIGIN), packet_vec3(packet, DIRECTION)
            if occluded_item(item, o, d, t_min, f64_at(packet, END)):
                blocked |= 1 << k
            else:
                top = i64_at(room, TOPS + k) - 1
                now = proceed(tree, room, now, k, i64_at(room, STACKS + k * STRIDE + top), top)
    return blocked
