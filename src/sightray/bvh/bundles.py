"""Up to 64 rays that go different ways, in turns: while memory fetches a node for one, the others are at work.

A large tree does not fit into a processor's nearer caches, and rays in all directions wait for memory most of their time.
Here every ray of a packet (see `packets`) has its own stack. It visits one node or block, asks for the memory that it will
read next (`prefetch`), and the next ray has its turn. Rays that visit a node go first, those that visit a leaf follow:
what differs from ray to ray is then not which code runs. Boxes, filter, decision and order of children are those of
single rays, so the hits are the same. Four packets (see `casting`) go together, so that few rays are left alone at the end.

Databases probe their trees like this: S. Chen, A. Ailamaki, P. Gibbons, T. Mowry, "Improving hash join performance
through prefetching" (2004); O. Kocberber, B. Falsafi, B. Grot, "Asynchronous memory access chaining" (VLDB 2015).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.bvh.bvh8 import (
    CHILD,
    LEAF,
    NODE_FLOATS,
    NODES,
    STACK_WORDS,
    BoxRay,
    push_children,
    push_children_unsorted,
)
from sightray.bvh.casting import (
    DIRECTION,
    END,
    ORIGIN,
    PACKET_WORDS,
    PRIM,
    REACH,
    SLACK,
    SPEED,
    START,
    WORK_WORDS,
    box_packet,
    triangle_packet,
)
from sightray.bvh.triangles import BLOCK_FLOATS, BLOCKS, TriangleRay, filter_block, meet_triangle, shear
from sightray.mathlib.lanes import (
    load16d,
    lowest_bit,
    prefetch,
    round16,
    sort_key,
    splat4,
    splat8,
    store16,
)
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, advance, f32_at, f32_put, f64_at, f64_put, i64_at, i64_put, scratch, table_at
from sightray.mathlib.vec import Vec3

BOTTOM = -(1 << 62)  # below all keys: the end of a stack
STRIDE = STACK_WORDS + 8  # words from stack to stack; one line more, lest all begin in the same set of the cache

# Floats of the rays of a bundle, sixteen each.
R, NEAR, FAR, FROM, TO, SIDE, ALONG, END_AT = 0, 48, 96, 144, 192, 240, 256, 272
LANE_WORDS = 144


@kernel
def store_lanes(work: Table, lanes: Table) -> None:
    """Write the rays of a packet as `bundles` reads them."""
    boxes, triangles = box_packet(work), triangle_packet(work)
    store16(lanes, R, boxes.rx)
    store16(lanes, R + 16, boxes.ry)
    store16(lanes, R + 32, boxes.rz)
    store16(lanes, NEAR, boxes.nx)
    store16(lanes, NEAR + 16, boxes.ny)
    store16(lanes, NEAR + 32, boxes.nz)
    store16(lanes, FAR, boxes.fx)
    store16(lanes, FAR + 16, boxes.fy)
    store16(lanes, FAR + 32, boxes.fz)
    store16(lanes, FROM, triangles.ox)
    store16(lanes, FROM + 16, triangles.oy)
    store16(lanes, FROM + 32, triangles.oz)
    store16(lanes, TO, triangles.dx)
    store16(lanes, TO + 16, triangles.dy)
    store16(lanes, TO + 32, triangles.dz)
    store16(lanes, SIDE, triangles.side)
    store16(lanes, ALONG, triangles.along)
    store16(lanes, END_AT, round16(load16d(work, REACH)))


@kernel
def box_ray_of(lanes: Table, k: i64) -> BoxRay:
    """One ray of a bundle, prepared for the boxes."""
    x, y, z = float_at(lanes, R + k), float_at(lanes, R + 16 + k), float_at(lanes, R + 32 + k)
    return BoxRay(
        splat8(x), splat8(y), splat8(z),
        splat8(float_at(lanes, NEAR + k)), splat8(float_at(lanes, NEAR + 16 + k)), splat8(float_at(lanes, NEAR + 32 + k)),
        splat8(float_at(lanes, FAR + k)), splat8(float_at(lanes, FAR + 16 + k)), splat8(float_at(lanes, FAR + 32 + k)),
        0 if x > 0.0 else 8, 16 if y > 0.0 else 24, 32 if z > 0.0 else 40,
    )  # fmt: skip


@kernel
def triangle_ray_of(lanes: Table, k: i64) -> TriangleRay:
    """One ray of a bundle, prepared for the blocks."""
    return TriangleRay(
        splat4(float_at(lanes, FROM + k)), splat4(float_at(lanes, FROM + 16 + k)), splat4(float_at(lanes, FROM + 32 + k)),
        splat4(float_at(lanes, TO + k)), splat4(float_at(lanes, TO + 16 + k)), splat4(float_at(lanes, TO + 32 + k)),
        splat4(float_at(lanes, SIDE + k)), splat4(float_at(lanes, ALONG + k)),
    )  # fmt: skip


@kernel
def lane_of(k: i64) -> i64:
    """Where ray k stands in its packets, in words from the first packet's lane 0."""
    return (k >> 4) * PACKET_WORDS + (k & 15)


@kernel
def work_of(k: i64) -> i64:
    """The same for their working memory."""
    return (k >> 4) * WORK_WORDS + (k & 15)


@kernel
def float_of(k: i64) -> i64:
    """The same for their lanes, in floats."""
    return (k >> 4) * (2 * LANE_WORDS) + (k & 15)


@kernel
def float_at(table: Table, index: i64) -> f64:
    """Float number `index` of a table as a double."""
    return float(f32_at(table, index))


@kernel
def packet_vec3(packet: Table, at: i64) -> Vec3:
    """Origin or direction of one ray of a packet."""
    return Vec3(f64_at(packet, at), f64_at(packet, at + 16), f64_at(packet, at + 32))


@kernel
def prefetch_child(nodes: Table, blocks: Table, child: i64) -> None:
    """Ask for the cache lines that a child will read: four of a node, three of a block."""
    table = nodes if child < LEAF else blocks
    at = child * NODE_FLOATS if child < LEAF else (child & (LEAF - 1)) * BLOCK_FLOATS
    prefetch(table, at)
    prefetch(table, at + 16)
    prefetch(table, at + 32)
    prefetch(table, at + (48 if child < LEAF else 32))


class Bundle(NamedTuple):
    """Sixteen rays on their way, a bit each."""

    alive: i64  # rays that have something left to visit
    leaf: i64  # rays that visit a leaf next, if they are alive


@kernel
def next_visit(now: Bundle, k: i64, child: i64, done: bool) -> Bundle:
    """Note that ray k is done, or visits `child` next."""
    leaf = (now.leaf & ~(1 << k)) | (child >> 30 & 1) << k
    return Bundle(now.alive & ~((1 if done else 0) << k), leaf)


@kernel
def closest_in_turns(mesh: Table, packet: Table, t_min: f64, alive: i64, work: Table) -> i64:
    """`closest_packet` for the rays `alive`, each on its own."""
    lanes = scratch(576)
    for p in range(4):
        if (alive >> (16 * p)) & 0xFFFF != 0:
            store_lanes(advance(work, p * WORK_WORDS), advance(lanes, p * LANE_WORDS))
    nodes, blocks = table_at(mesh, NODES), table_at(mesh, BLOCKS)
    stacks, tops = scratch(25088), scratch(64)
    for k in range(64):
        i64_put(stacks, k * STRIDE, BOTTOM)
        i64_put(stacks, k * STRIDE + 1, 0)
        i64_put(tops, k, 2)
    now, found = Bundle(alive, 0), 0
    while now.alive != 0:
        # First all rays that visit a node, then all that visit a leaf: so the processor knows which comes next.
        turn = now.alive & ~now.leaf
        leaves = now.alive & now.leaf
        while turn != 0:
            k = lowest_bit(turn)
            turn &= turn - 1
            stack, top, reach = advance(stacks, k * STRIDE), i64_at(tops, k) - 1, float_at(lanes, END_AT + float_of(k))
            child = i64_at(stack, top) & CHILD
            top = push_children(nodes, child, box_ray_of(lanes, float_of(k)), reach, stack, top)
            top = drop_far(stack, top, reach)
            i64_put(tops, k, top)
            child = i64_at(stack, top - 1) & CHILD
            prefetch_child(nodes, blocks, child)
            now = next_visit(now, k, child, top == 1)
        while leaves != 0:
            k = lowest_bit(leaves)
            leaves &= leaves - 1
            stack, top, reach = advance(stacks, k * STRIDE), i64_at(tops, k) - 1, float_at(lanes, END_AT + float_of(k))
            block = i64_at(stack, top) & (LEAF - 1)
            maybe = filter_block(blocks, block * BLOCK_FLOATS, triangle_ray_of(lanes, float_of(k)), reach).maybe
            while maybe != 0:
                o, d = packet_vec3(packet, ORIGIN + lane_of(k)), packet_vec3(packet, DIRECTION + lane_of(k))
                hit = meet_triangle(mesh, block, lowest_bit(maybe), o, shear(d), t_min, math.inf)
                maybe &= maybe - 1
                end = f64_at(packet, END + lane_of(k))
                known = int(f64_at(packet, PRIM + lane_of(k))) if found >> k & 1 != 0 else -1
                if hit.t < end or (hit.t == end and hit.prim < known):
                    found |= 1 << k
                    f64_put(packet, END + lane_of(k), hit.t)
                    f64_put(packet, PRIM + lane_of(k), float(hit.prim))
                    reach = (
                        hit.t * f64_at(work, SPEED + work_of(k))
                        - f64_at(work, START + work_of(k))
                        + f64_at(work, SLACK + work_of(k))
                    )
                    f32_put(lanes, END_AT + float_of(k), reach)
            top = drop_far(stack, top, reach)
            i64_put(tops, k, top)
            child = i64_at(stack, top - 1) & CHILD
            prefetch_child(nodes, blocks, child)
            now = next_visit(now, k, child, top == 1)
    return found


@kernel
def drop_far(stack: Table, top: i64, reach: f64) -> i64:
    """The stack's height without what lies farther than the best hit."""
    farthest = sort_key(reach)
    while i64_at(stack, top - 1) > farthest:
        top -= 1
    return top


@kernel
def any_in_turns(mesh: Table, packet: Table, t_min: f64, alive: i64, work: Table) -> i64:
    """`any_packet` for the rays `alive`, each on its own."""
    lanes = scratch(576)
    for p in range(4):
        if (alive >> (16 * p)) & 0xFFFF != 0:
            store_lanes(advance(work, p * WORK_WORDS), advance(lanes, p * LANE_WORDS))
    nodes, blocks = table_at(mesh, NODES), table_at(mesh, BLOCKS)
    stacks, tops = scratch(25088), scratch(64)
    for k in range(64):
        i64_put(stacks, k * STRIDE, 0)
        i64_put(stacks, k * STRIDE + 1, 0)
        i64_put(tops, k, 2)
    now, blocked = Bundle(alive, 0), 0
    while now.alive != 0:
        turn = now.alive & ~now.leaf
        leaves = now.alive & now.leaf
        while turn != 0:
            k = lowest_bit(turn)
            turn &= turn - 1
            stack, top, reach = advance(stacks, k * STRIDE), i64_at(tops, k) - 1, float_at(lanes, END_AT + float_of(k))
            top = push_children_unsorted(nodes, i64_at(stack, top), box_ray_of(lanes, float_of(k)), reach, stack, top)
            i64_put(tops, k, top)
            child = i64_at(stack, top - 1)
            prefetch_child(nodes, blocks, child)
            now = next_visit(now, k, child, top == 1)
        while leaves != 0:
            k = lowest_bit(leaves)
            leaves &= leaves - 1
            stack, top, reach = advance(stacks, k * STRIDE), i64_at(tops, k) - 1, float_at(lanes, END_AT + float_of(k))
            block = i64_at(stack, top) & (LEAF - 1)
            met = filter_block(blocks, block * BLOCK_FLOATS, triangle_ray_of(lanes, float_of(k)), reach)
            hit, maybe = met.surely != 0, met.maybe
            while maybe != 0 and not hit:
                o, d = packet_vec3(packet, ORIGIN + lane_of(k)), packet_vec3(packet, DIRECTION + lane_of(k))
                hit = (
                    meet_triangle(
                        mesh, block, lowest_bit(maybe), o, shear(d), t_min, f64_at(packet, END + lane_of(k))
                    ).prim
                    >= 0
                )
                maybe &= maybe - 1
            blocked |= (1 if hit else 0) << k
            i64_put(tops, k, top)
            child = i64_at(stack, top - 1)
            prefetch_child(nodes, blocks, child)
            now = next_visit(now, k, child, hit or top == 1)
    return blocked
