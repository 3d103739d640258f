"""Nodes that many rays of a packet share, though they go different ways: sixteen rays meet one box at a time.

Rays that leave from about the same place all meet the boxes around it, whatever their directions. So a packet whose rays
go each on its own (see `bundles`) begins together: a node that at least `SHARED` of its rays meet is visited once for all
of them, and so is a leaf. What fewer meet waits on these rays' own stacks. Boxes, filter and decision are those of single
rays, so the hits are the same.

Reference: C. Benthin, I. Wald, S. Woop, M. Ernst, W. Mark, "Combining single and packet-ray tracing for arbitrary ray
distributions on the Intel MIC architecture" (2012).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.bvh.bvh8 import CHILD, CHILDREN, LEAF, NODE_FLOATS, NODES, STACK_WORDS, float_at, int_at
from sightray.bvh.casting import END, END_AT, FAR, FROM, LANE_WORDS, NEAR, PACKET_WORDS, WORK_WORDS, R
from sightray.bvh.sixteen import (
    decide_for_each,
    edge_sizes,
    filter_triangle,
    keep_decided,
    lanes_at,
    prepare_own_shears,
)
from sightray.bvh.triangles import BLOCK_FLOATS, BLOCKS, INDICES, NUMBERS, SMALL, VERTICES
from sightray.mathlib.lanes import (
    F32x16,
    Mask16,
    count_bits,
    least16,
    load16,
    load16d,
    lowest_bit,
    movemask16,
    prefetch,
    select16,
    splat16,
    splat16d,
    store16,
    vmax16,
    vmin16,
)
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, advance, i64_at, i64_put, scratch, table_at

SHARED = 8  # rays that are worth a visit of all sixteen
PLACE = 0.06  # in the unit frame: rays that begin no farther apart begin together
PAIRS = 2 * STACK_WORDS  # words of the stack of a packet: two for each node
ALL_PAIRS = 4 * PAIRS
OWN = 64  # words of a ray's own stack for what it does not share; the rest is for what lies below that
STRIDE = OWN + STACK_WORDS + 8  # from stack to stack; one line more, lest all begin in the same set of the cache


@kernel
def prefetch_child(nodes: Table, blocks: Table, child: i64) -> None:
    """Ask for the cache lines that a child will read: four of a node, three of a block."""
    table = nodes if child < LEAF else blocks
    at = child * NODE_FLOATS if child < LEAF else (child & (LEAF - 1)) * BLOCK_FLOATS
    prefetch(table, at)
    prefetch(table, at + 16)
    prefetch(table, at + 32)
    prefetch(table, at + (48 if child < LEAF else 32))


@kernel
def prefetch_corners(mesh: Table, block: i64, maybe: i64) -> None:
    """Ask for the corners of triangles of a block, two lines each, and for their numbers."""
    vertices, blocks = table_at(mesh, VERTICES), table_at(mesh, BLOCKS)
    prefetch(table_at(mesh, NUMBERS), 4 * block)
    while maybe != 0:
        at = block * BLOCK_FLOATS + INDICES + lowest_bit(maybe)
        maybe &= maybe - 1
        for corner in range(3):
            vertex = 6 * int_at(blocks, at + 4 * corner)
            prefetch(vertices, vertex)
            prefetch(vertices, vertex + 4)


class PacketRay(NamedTuple):
    """Sixteen rays, prepared for boxes: as `BoxRay` for one."""

    rx: F32x16
    ry: F32x16
    rz: F32x16
    nx: F32x16
    ny: F32x16
    nz: F32x16
    fx: F32x16
    fy: F32x16
    fz: F32x16
    x: Mask16  # who goes up that axis
    y: Mask16
    z: Mask16


@kernel
def packet_ray(lanes: Table) -> PacketRay:
    """The rays of a packet, after `cast_alone`."""
    x, y, z, zero = load16(lanes, R), load16(lanes, R + 16), load16(lanes, R + 32), splat16(0.0)
    return PacketRay(
        x, y, z,
        load16(lanes, NEAR), load16(lanes, NEAR + 16), load16(lanes, NEAR + 32),
        load16(lanes, FAR), load16(lanes, FAR + 16), load16(lanes, FAR + 32),
        x > zero, y > zero, z > zero,
    )  # fmt: skip


class Sixteen(NamedTuple):
    """What sixteen rays find at a box."""

    near: F32x16  # lengths to where they enter it
    met: Mask16  # which rays meet it


@kernel
def meet_box(nodes: Table, at: i64, ray: PacketRay, reach: F32x16) -> Sixteen:
    """Meet one of the boxes of a node, within `reach`: `meet_boxes` for sixteen rays."""
    low_x, low_y, low_z = lanes_at(nodes, at), lanes_at(nodes, at + 16), lanes_at(nodes, at + 32)
    high_x, high_y, high_z = lanes_at(nodes, at + 8), lanes_at(nodes, at + 24), lanes_at(nodes, at + 40)
    near_x, far_x = select16(ray.x, low_x, high_x) * ray.rx - ray.nx, select16(ray.x, high_x, low_x) * ray.rx - ray.fx
    near_y, far_y = select16(ray.y, low_y, high_y) * ray.ry - ray.ny, select16(ray.y, high_y, low_y) * ray.ry - ray.fy
    near_z, far_z = select16(ray.z, low_z, high_z) * ray.rz - ray.nz, select16(ray.z, high_z, low_z) * ray.rz - ray.fz
    near = vmax16(vmax16(near_x, near_y), vmax16(near_z, splat16(0.0)))
    far = vmin16(vmin16(far_x, far_y), vmin16(far_z, reach))
    return Sixteen(near, near <= far)


class Children(NamedTuple):
    """Children of a node, a bit each."""

    shared: i64  # those that many rays meet
    own: i64  # those that fewer meet


@kernel
def meet_children(nodes: Table, at: i64, ray: PacketRay, bits: i64, reach: F32x16, found: Table) -> Children:
    """Meet the boxes of a node with the rays `bits`. Rows of nine words are written, a child each: bits, and lengths."""
    shared, own = 0, 0
    for lane in range(8):
        box = meet_box(nodes, at + lane, ray, reach)
        met = movemask16(box.met) & bits
        i64_put(found, 9 * lane, met)
        store16(found, 18 * lane + 2, box.near)
        shared |= (1 if count_bits(met) >= SHARED else 0) << lane
        own |= (1 if 0 < count_bits(met) < SHARED else 0) << lane
    return Children(shared, own)


@kernel
def key_of(found: Table, lane: i64, k: i64, code: i64) -> i64:
    """The sort key of a child for ray k of the packet."""
    return int_at(found, 18 * lane + 2 + k) << 32 | code


@kernel
def push_own(nodes: Table, at: i64, found: Table, own: i64, tops: Table, stacks: Table) -> i64:
    """Put children below what is on the stacks of the rays that meet them; the lowest place that is taken."""
    lowest = OWN
    while own != 0:
        lane = lowest_bit(own)
        own &= own - 1
        met, code = i64_at(found, 9 * lane), int_at(nodes, at + CHILDREN + lane)
        while met != 0:
            k = lowest_bit(met)
            met &= met - 1
            place = i64_at(tops, k) - 1
            i64_put(stacks, k * STRIDE + place, key_of(found, lane, k, code))
            i64_put(tops, k, place)
            lowest = min(lowest, place)
    return lowest


@kernel
def push_shared(nodes: Table, at: i64, found: Table, shared: i64, stack: Table, top: i64, sorted: bool) -> i64:
    """Push children that many rays meet, two words each, key and bits, maybe the nearest last; the stack's new height."""
    base = top
    while shared != 0:
        lane = lowest_bit(shared)
        shared &= shared - 1
        met = i64_at(found, 9 * lane)
        key = key_of(found, lane, lowest_bit(met), int_at(nodes, at + CHILDREN + lane))
        i = top
        while sorted and i > base and i64_at(stack, 2 * i - 2) < key:
            i64_put(stack, 2 * i, i64_at(stack, 2 * i - 2))
            i64_put(stack, 2 * i + 1, i64_at(stack, 2 * i - 1))
            i -= 1
        i64_put(stack, 2 * i, key)
        i64_put(stack, 2 * i + 1, met)
        top += 1
    return top


@kernel
def many(mesh: Table, alive: i64, all_lanes: Table) -> i64:
    """Of the rays `alive`, bits of four packets, those that had better begin together: many, from about the same place."""
    bits = 0
    if i64_at(mesh, SMALL) == 0:
        return bits
    for p in range(4):
        its = alive & 0xFFFF << (16 * p)
        if count_bits(its) >= SHARED and begin_close(advance(all_lanes, p * LANE_WORDS)):
            bits |= its
    return bits


@kernel
def begin_close(lanes: Table) -> bool:
    """Whether the rays of a packet begin within `PLACE` of one another along each axis."""
    met, inf, widest = load16(lanes, END_AT) >= splat16(0.0), splat16(math.inf), 0.0
    for axis in range(3):
        o = load16(lanes, FROM + 16 * axis)
        low, high = least16(select16(met, o, inf)), -least16(select16(met, splat16(0.0) - o, inf))
        widest = max(widest, high - low)
    return widest <= PLACE


class Crowd(NamedTuple):
    """Four packets on their way together, and their rays' own stacks."""

    stacks: Table  # of the packets
    states: Table  # how high these are, and what waits for a decision: six words for each packet
    own_stacks: Table
    own_tops: Table


class Halt(NamedTuple):
    """How far a crowd has come."""

    going: i64  # packets that have to go on when their rays' own stacks are empty again, a bit each
    met: i64  # rays that have met a triangle


@kernel
def begin(packets: Table, works: Table, rays: i64, crowd: Crowd) -> i64:
    """Let the packets of `rays` begin at the root; a bit for each."""
    going = 0
    for p in range(4):
        bits = (rays >> (16 * p)) & 0xFFFF
        if bits != 0:
            prepare_own_shears(advance(packets, p * PACKET_WORDS), advance(works, p * WORK_WORDS))
            i64_put(crowd.stacks, p * PAIRS, 0)
            i64_put(crowd.stacks, p * PAIRS + 1, bits)
            i64_put(crowd.states, 6 * p, 1)
            going |= 1 << p
    return going


@kernel
def visit_shared(
    mesh: Table, child: i64, bits: i64, lanes: Table, p: i64, sorted: bool, crowd: Crowd, found: Table
) -> bool:  # fmt: skip
    """Visit a node with the rays `bits` of packet p; whether there is room on their stacks for another one."""
    nodes, at, stack = table_at(mesh, NODES), child * NODE_FLOATS, advance(crowd.stacks, p * PAIRS)
    children = meet_children(nodes, at, packet_ray(lanes), bits, load16(lanes, END_AT), found)
    own_tops, own_stacks = advance(crowd.own_tops, 16 * p), advance(crowd.own_stacks, 16 * p * STRIDE)
    lowest = push_own(nodes, at, found, children.own, own_tops, own_stacks)
    i64_put(
        crowd.states, 6 * p, push_shared(nodes, at, found, children.shared, stack, i64_at(crowd.states, 6 * p), sorted)
    )
    return lowest > 8


@kernel
def go_on(mesh: Table, crowd: Crowd, p: i64) -> bool:
    """Ask for what packet p visits next; whether there is anything."""
    top = i64_at(crowd.states, 6 * p)
    if top > 0:
        child = i64_at(crowd.stacks, p * PAIRS + 2 * top - 2) & CHILD
        prefetch_child(table_at(mesh, NODES), table_at(mesh, BLOCKS), child)
    return top > 0


@kernel
def closest_shared(
    mesh: Table, packets: Table, t_min: f64, works: Table, all_lanes: Table, crowd: Crowd, halt: Halt
) -> Halt:
    """Visit what many rays of packets meet."""
    found, open, due, waiting, met = scratch(72), halt.going, 0, 0, halt.met
    empty_stacks(crowd)
    while open != 0:
        turn = open
        while turn != 0:
            p = lowest_bit(turn)
            turn &= turn - 1
            lanes, state, room = advance(all_lanes, p * LANE_WORDS), advance(crowd.states, 6 * p), True
            if due >> p & 1 != 0:
                packet, work = advance(packets, p * PACKET_WORDS), advance(works, p * WORK_WORDS)
                its = (met >> (16 * p)) & 0xFFFF
                met |= decide_block(mesh, packet, work, lanes, state, t_min, its) << (16 * p)
                due &= ~(1 << p)
            else:
                top = i64_at(state, 0) - 1
                entry = p * PAIRS + 2 * top
                child, bits = i64_at(crowd.stacks, entry) & CHILD, i64_at(crowd.stacks, entry + 1)
                i64_put(state, 0, top)
                if child < LEAF:
                    room = visit_shared(mesh, child, bits, lanes, p, True, crowd, found)
                elif filter_shared(mesh, child & (LEAF - 1), bits, lanes, state):
                    due |= 1 << p  # to be decided when the corners are there
                    continue
            more = go_on(mesh, crowd, p)
            if not (more and room):
                open &= ~(1 << p)
                waiting |= (1 if more else 0) << p
    return Halt(waiting, met)


@kernel
def filter_shared(mesh: Table, block: i64, bits: i64, lanes: Table, state: Table) -> bool:
    """Note which of the rays `bits` of a packet may meet the triangles of a block; whether any may."""
    blocks, at, sizes, some = table_at(mesh, BLOCKS), block * BLOCK_FLOATS, scratch(2), 0
    edge_sizes(blocks, at, sizes)
    i64_put(state, 1, block)
    for lane in range(4):
        maybe = filter_triangle(blocks, at + lane, float_at(sizes, lane), lanes).maybe & bits
        i64_put(state, 2 + lane, maybe)
        some |= (1 if maybe != 0 else 0) << lane
    prefetch_corners(mesh, block, some)
    return some != 0


@kernel
def decide_block(mesh: Table, packet: Table, work: Table, lanes: Table, state: Table, t_min: f64, found: i64) -> i64:
    """Meet the rays of a packet with the triangles that wait for them; `found`, who has met any, with those that do now."""
    block = i64_at(state, 1)
    for lane in range(4):
        maybe = i64_at(state, 2 + lane)
        if maybe != 0:
            t = decide_for_each(mesh, work, block * BLOCK_FLOATS + INDICES + lane)
            prim = int_at(table_at(mesh, NUMBERS), 4 * block + lane)
            found |= keep_decided(packet, work, lanes, t, prim, t_min, maybe, found)
    return found


@kernel
def empty_stacks(crowd: Crowd) -> None:
    """Let the rays' own stacks be empty."""
    for k in range(64):
        i64_put(crowd.own_tops, k, OWN)


@kernel
def any_shared(
    mesh: Table, packets: Table, t_min: f64, works: Table, all_lanes: Table, crowd: Crowd, halt: Halt
) -> Halt:
    """Visit what many rays of packets meet, until they are stopped."""
    found, open, waiting, stopped = scratch(72), halt.going, 0, halt.met
    empty_stacks(crowd)
    while open != 0:
        turn = open
        while turn != 0:
            p = lowest_bit(turn)
            turn &= turn - 1
            top, room = i64_at(crowd.states, 6 * p) - 1, True
            entry, lanes = p * PAIRS + 2 * top, advance(all_lanes, p * LANE_WORDS)
            child, bits = i64_at(crowd.stacks, entry) & CHILD, i64_at(crowd.stacks, entry + 1) & ~(stopped >> (16 * p))
            i64_put(crowd.states, 6 * p, top)
            if bits != 0 and child < LEAF:
                room = visit_shared(mesh, child, bits, lanes, p, False, crowd, found)
            elif bits != 0:
                packet, work = advance(packets, p * PACKET_WORDS), advance(works, p * WORK_WORDS)
                stopped |= any_in_block(mesh, packet, work, lanes, child & (LEAF - 1), bits, t_min) << (16 * p)
            more = go_on(mesh, crowd, p)
            if not (more and room):
                open &= ~(1 << p)
                waiting |= (1 if more else 0) << p
    return Halt(waiting, stopped)


@kernel
def any_in_block(mesh: Table, packet: Table, work: Table, lanes: Table, block: i64, bits: i64, t_min: f64) -> i64:
    """Which of the rays `bits` of a packet the triangles of a block stop."""
    blocks, at, sizes, stopped = table_at(mesh, BLOCKS), block * BLOCK_FLOATS, scratch(2), 0
    edge_sizes(blocks, at, sizes)
    for lane in range(4):
        met = filter_triangle(blocks, at + lane, float_at(sizes, lane), lanes)
        stopped |= met.surely & bits
        if met.maybe & bits & ~stopped != 0:
            t = decide_for_each(mesh, work, at + lane + INDICES)
            stopped |= movemask16((splat16d(t_min) < t) & (t < load16d(packet, END))) & met.maybe & bits
    return stopped
