"""Nodes that many rays of a packet share, though they go different ways: sixteen rays meet one box at a time.

Rays that leave from about the same place all meet the boxes around it, whatever their directions. So a packet whose rays
go each on its own (see `bundles`) begins together: a node that at least `SHARED` of its rays meet is visited once for all
of them, and so is a leaf that `SHARED_LEAF` meet. What fewer meet waits on these rays' own stacks. Boxes, filter and
decision are those of single rays, so the hits are the same.

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
)
from sightray.bvh.triangles import BLOCK_FLOATS, BLOCKS, INDICES, LARGE, NUMBERS, SIZE
from sightray.mathlib.lanes import (
    F32x16,
    Mask16,
    count_bits,
    least16,
    load16,
    load16d,
    lowest_bit,
    movemask16,
    select16,
    splat16,
    splat16d,
    store16,
    vmax16,
    vmin16,
)
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, advance, i64_at, i64_put, scratch, table_at

SHARED, SHARED_LEAF = 8, 4  # rays for which a visit of all sixteen is worth it, to a node and to a leaf
PLACE = 0.06  # in the unit frame: rays that begin no farther apart begin together
PAIRS = 2 * STACK_WORDS  # words of the stack of a packet: two for each node
ALL_PAIRS = 4 * PAIRS
OWN = 64  # words of a ray's own stack for what it does not share; the rest is for what lies below that
STRIDE = OWN + STACK_WORDS + 8  # from stack to stack; one line more, lest all begin in the same set of the cache


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
        box, child = meet_box(nodes, at + lane, ray, reach), int_at(nodes, at + CHILDREN + lane)
        met = movemask16(box.met) & bits
        i64_put(found, 9 * lane, met)
        store16(found, 18 * lane + 2, box.near)
        many = count_bits(met) >= (SHARED if child < LEAF else SHARED_LEAF)
        shared |= (1 if many else 0) << lane
        own |= (1 if met != 0 and not many else 0) << lane
    return Children(shared, own)


@kernel
def key_of(found: Table, lane: i64, k: i64, code: i64) -> i64:
    """The sort key of a child for ray k of the packet."""
    return int_at(found, 18 * lane + 2 + k) << 32 | code


class Pushed(NamedTuple):
    """What was put on rays' own stacks."""

    rays: i64  # whose, a bit each
    lowest: i64  # place that is taken


@kernel
def push_own(nodes: Table, at: i64, found: Table, own: i64, tops: Table, stacks: Table) -> Pushed:
    """Put children below what is on the stacks of the rays that meet them."""
    lowest, rays = OWN, 0
    while own != 0:
        lane = lowest_bit(own)
        own &= own - 1
        met, code = i64_at(found, 9 * lane), int_at(nodes, at + CHILDREN + lane)
        rays |= met
        while met != 0:
            k = lowest_bit(met)
            met &= met - 1
            place = i64_at(tops, k) - 1
            i64_put(stacks, k * STRIDE + place, key_of(found, lane, k, code))
            i64_put(tops, k, place)
            lowest = min(lowest, place)
    return Pushed(rays, lowest)


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
    if i64_at(mesh, SIZE) == LARGE:
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
    tops: Table  # how high these are
    own_stacks: Table
    own_tops: Table


class Halt(NamedTuple):
    """How far a crowd has come."""

    going: i64  # packets that have to go on when their rays' own stacks are empty again, a bit each
    met: i64  # rays that have met a triangle
    owners: i64  # rays with something on their own stacks


@kernel
def begin(rays: i64, crowd: Crowd) -> i64:
    """Let the packets of `rays` begin at the root; a bit for each."""
    going = 0
    for p in range(4):
        bits = (rays >> (16 * p)) & 0xFFFF
        if bits != 0:
            i64_put(crowd.stacks, p * PAIRS, 0)
            i64_put(crowd.stacks, p * PAIRS + 1, bits)
            i64_put(crowd.tops, p, 1)
            going |= 1 << p
    return going


class Visited(NamedTuple):
    """What a packet leaves behind at a node."""

    top: i64  # the height of its stack
    room: bool  # whether there is room on its rays' own stacks for another one
    owners: i64  # rays with something on their own stacks


@kernel
def visit_shared(
    mesh: Table, child: i64, bits: i64, lanes: Table, p: i64, now: Visited, sorted: bool, crowd: Crowd, found: Table
) -> Visited:  # fmt: skip
    """Visit a node with the rays `bits` of packet p."""
    nodes, at, stack = table_at(mesh, NODES), child * NODE_FLOATS, advance(crowd.stacks, p * PAIRS)
    children = meet_children(nodes, at, packet_ray(lanes), bits, load16(lanes, END_AT), found)
    own_tops, own_stacks = advance(crowd.own_tops, 16 * p), advance(crowd.own_stacks, 16 * p * STRIDE)
    pushed = push_own(nodes, at, found, children.own, own_tops, own_stacks)
    top = push_shared(nodes, at, found, children.shared, stack, now.top, sorted)
    return Visited(top, pushed.lowest > 8, now.owners | pushed.rays)


@kernel
def ahead(crowd: Crowd, halt: Halt, p: i64) -> Visited:
    """What lies ahead of packet p."""
    return Visited(i64_at(crowd.tops, p) if halt.going >> p & 1 != 0 else 0, True, 0)


@kernel
def closest_shared(
    mesh: Table, packets: Table, t_min: f64, works: Table, all_lanes: Table, crowd: Crowd, halt: Halt
) -> Halt:
    """Visit what many rays of packets meet, one packet after the other: all is in near caches."""
    found, waiting, met, owners = scratch(72), 0, halt.met, 0
    empty_stacks(crowd)
    for p in range(4):
        lanes, now = advance(all_lanes, p * LANE_WORDS), ahead(crowd, halt, p)
        while now.top > 0 and now.room:
            now = Visited(now.top - 1, True, now.owners)
            entry = p * PAIRS + 2 * now.top
            child, bits = i64_at(crowd.stacks, entry) & CHILD, i64_at(crowd.stacks, entry + 1)
            if child < LEAF:
                now = visit_shared(mesh, child, bits, lanes, p, now, True, crowd, found)
            else:
                packet, work = advance(packets, p * PACKET_WORDS), advance(works, p * WORK_WORDS)
                its = (met >> (16 * p)) & 0xFFFF
                met |= closest_in_block(mesh, packet, work, lanes, child & (LEAF - 1), bits, t_min, its) << (16 * p)
        i64_put(crowd.tops, p, now.top)
        waiting |= (1 if now.top > 0 else 0) << p
        owners |= now.owners << (16 * p)
    return Halt(waiting, met, owners)


@kernel
def closest_in_block(
    mesh: Table, packet: Table, work: Table, lanes: Table, block: i64, bits: i64, t_min: f64, found: i64
) -> i64:  # fmt: skip
    """Meet the rays `bits` of a packet with the triangles of a block; `found`, who has met any, with those that do now."""
    blocks, at, sizes = table_at(mesh, BLOCKS), block * BLOCK_FLOATS, scratch(2)
    edge_sizes(blocks, at, sizes)
    for lane in range(4):
        maybe = filter_triangle(blocks, at + lane, float_at(sizes, lane), lanes).maybe & bits
        if maybe != 0:
            t = decide_for_each(mesh, work, at + lane + INDICES)
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
    found, waiting, stopped, owners = scratch(72), 0, halt.met, 0
    empty_stacks(crowd)
    for p in range(4):
        lanes, now = advance(all_lanes, p * LANE_WORDS), ahead(crowd, halt, p)
        while now.top > 0 and now.room:
            now = Visited(now.top - 1, True, now.owners)
            entry = p * PAIRS + 2 * now.top
            child, bits = i64_at(crowd.stacks, entry) & CHILD, i64_at(crowd.stacks, entry + 1) & ~(stopped >> (16 * p))
            if bits != 0 and child < LEAF:
                now = visit_shared(mesh, child, bits, lanes, p, now, False, crowd, found)
            elif bits != 0:
                packet, work = advance(packets, p * PACKET_WORDS), advance(works, p * WORK_WORDS)
                stopped |= any_in_block(mesh, packet, work, lanes, child & (LEAF - 1), bits, t_min) << (16 * p)
        i64_put(crowd.tops, p, now.top)
        waiting |= (1 if now.top > 0 else 0) << p
        owners |= now.owners << (16 * p)
    return Halt(waiting, stopped, owners & ~stopped)


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
