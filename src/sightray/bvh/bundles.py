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
    BOTTOM,
    CHILD,
    LEAF,
    NODE_FLOATS,
    NODES,
    BoxRay,
    float_at,
    int_at,
    pop_near,
    push_children_unsorted,
    visit_nearest,
)
from sightray.bvh.casting import (
    ALONG,
    BY_Y,
    BY_Z,
    DIRECTION,
    END,
    END_AT,
    FAR,
    FROM,
    LANE_WORDS,
    NEAR,
    ORIGIN,
    PACKET_WORDS,
    PLANES,
    PRIM,
    RENAMED_O,
    SHEAR,
    SIDE,
    SLACK,
    SPEED,
    START,
    TO,
    WORK_WORDS,
    R,
    cast_alone,
)
from sightray.bvh.shared import (
    ALL_PAIRS,
    OWN,
    STRIDE,
    Crowd,
    Halt,
    any_shared,
    begin,
    closest_shared,
    many,
)
from sightray.bvh.sixteen import prepare_own_shears
from sightray.bvh.triangles import (
    BLOCK_FLOATS,
    BLOCKS,
    INDICES,
    NUMBERS,
    SIZE,
    TINY,
    VERTICES,
    Shear,
    TriangleRay,
    corners,
    decide,
    filter_block,
    meet_triangle,
    shear,
)
from sightray.mathlib.lanes import (
    lowest_bit,
    prefetch,
    splat4,
    splat8,
)
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, advance, f32_put, f64_at, f64_put, i64_at, i64_put, scratch, table_at
from sightray.mathlib.vec import Vec3

# Words of the room that the rays of a bundle take: what each visits next, its stack's height, what waits, and its stack.
NEXT, TOPS, WAITING, STACKS = 0, 64, 128, 192
BUNDLE_WORDS = STACKS + 64 * STRIDE


@kernel
def box_ray_of(lanes: Table, k: i64) -> BoxRay:
    """One ray of a bundle, prepared for the boxes."""
    x, y, z = float_at(lanes, R + k), float_at(lanes, R + 16 + k), float_at(lanes, R + 32 + k)
    return BoxRay(
        splat8(x), splat8(y), splat8(z),
        splat8(float_at(lanes, NEAR + k)), splat8(float_at(lanes, NEAR + 16 + k)), splat8(float_at(lanes, NEAR + 32 + k)),
        splat8(float_at(lanes, FAR + k)), splat8(float_at(lanes, FAR + 16 + k)), splat8(float_at(lanes, FAR + 32 + k)),
        int_at(lanes, PLANES + k), int_at(lanes, PLANES + 16 + k), int_at(lanes, PLANES + 32 + k),
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


class Bundle(NamedTuple):
    """Rays on their way, a bit each."""

    nodes: i64  # rays that visit a node next
    leaves: i64  # rays that visit a leaf next


@kernel
def board(alive: i64, alone: i64, works: Table, all_lanes: Table, room: Table) -> None:
    """Prepare the rays `alive`: all that boxes need, empty stacks, and the root as what those `alone` visit next."""
    for p in range(4):
        if (alive >> (16 * p)) & 0xFFFF != 0:
            cast_alone(advance(works, p * WORK_WORDS), advance(all_lanes, p * LANE_WORDS))
    while alone != 0:
        k = lowest_bit(alone)
        alone &= alone - 1
        i64_put(room, NEXT + k, 0)
        i64_put(room, TOPS + k, OWN)
        i64_put(room, STACKS + k * STRIDE + OWN - 1, BOTTOM)


@kernel
def prepare_shears(packets: Table, works: Table, rays: i64) -> None:
    """Prepare the packets of `rays` for decisions."""
    for p in range(4):
        if rays >> (16 * p) & 0xFFFF != 0:
            prepare_own_shears(advance(packets, p * PACKET_WORDS), advance(works, p * WORK_WORDS))


@kernel
def proceed(mesh: Table, room: Table, now: Bundle, k: i64, key: i64, top: i64) -> Bundle:
    """Note what ray k visits next and ask for its memory, if that is far; the root means that nothing is left."""
    i64_put(room, NEXT + k, key)
    i64_put(room, TOPS + k, top)
    child = key & CHILD
    if i64_at(mesh, SIZE) != TINY:
        prefetch_child(table_at(mesh, NODES), table_at(mesh, BLOCKS), child)
    leaf = child >> 30
    node = 1 - leaf if child != 0 else 0
    return Bundle(now.nodes | node << k, now.leaves | leaf << k)


@kernel
def part(mesh: Table, owners: i64, sorted: bool, all_lanes: Table, room: Table) -> Bundle:
    """What rays with something on their own stacks visit first when each goes its own way; maybe what is nearest."""
    now = Bundle(0, 0)
    while owners != 0:
        k = lowest_bit(owners)
        owners &= owners - 1
        lowest, stack = i64_at(room, TOPS + k), advance(room, STACKS + k * STRIDE)
        i64_put(stack, lowest - 1, BOTTOM)
        if sorted:
            nearest_on_top(stack, lowest)
        next = pop_near(stack, OWN, float_at(advance(all_lanes, (k >> 4) * LANE_WORDS), END_AT + (k & 15)))
        now = proceed(mesh, room, now, k, next.key, next.top)
    return now


@kernel
def nearest_on_top(stack: Table, lowest: i64) -> None:
    """Bring the smallest key from `lowest` on to the top."""
    key = i64_at(stack, lowest)
    for place in range(lowest + 1, OWN):
        other = i64_at(stack, place)
        i64_put(stack, place - 1, max(key, other))
        key = min(key, other)
    i64_put(stack, OWN - 1, key)


@kernel
def closest_in_turns(
    mesh: Table, packets: Table, t_min: f64, alive: i64, works: Table, all_lanes: Table, room: Table
) -> i64:
    """`closest_rays` for the rays `alive`, together where many meet the same, and then each on its own."""
    together = many(mesh, alive, all_lanes)
    board(alive, alive & ~together, works, all_lanes, room)
    crowd = Crowd(scratch(ALL_PAIRS), scratch(4), advance(room, STACKS), advance(room, TOPS))
    prepare_shears(packets, works, alive)
    halt = Halt(begin(together, crowd), 0, 0)
    found = closest_apart(mesh, packets, t_min, Bundle(alive & ~together, 0), 0, works, all_lanes, room)
    while halt.going != 0:
        halt = closest_shared(mesh, packets, t_min, works, all_lanes, crowd, Halt(halt.going, found, 0))
        now = part(mesh, halt.owners, True, all_lanes, room)
        found = closest_apart(mesh, packets, t_min, now, halt.met, works, all_lanes, room)
    return found


@kernel
def closest_apart(
    mesh: Table, packets: Table, t_min: f64, now: Bundle, found: i64, works: Table, all_lanes: Table, room: Table
) -> i64:
    """Nearest hits of the rays of a bundle, each on its own; `found`, who has met anything, with those that do now."""
    nodes, blocks, due = table_at(mesh, NODES), table_at(mesh, BLOCKS), 0
    while now.nodes | now.leaves | due != 0:
        # First all rays that visit a node, then those that visit a leaf: so the processor knows which comes next.
        turn, leaves, deciding = now.nodes, now.leaves, due
        now, due = Bundle(0, 0), 0
        while turn != 0:
            k = lowest_bit(turn)
            turn &= turn - 1
            stack, top = advance(room, STACKS + k * STRIDE), i64_at(room, TOPS + k)
            lanes = advance(all_lanes, (k >> 4) * LANE_WORDS)
            reach = float_at(lanes, END_AT + (k & 15))
            node = i64_at(room, NEXT + k) & CHILD
            next = visit_nearest(nodes, node, box_ray_of(lanes, k & 15), reach, stack, top)
            now = proceed(mesh, room, now, k, next.key, next.top)
        while leaves != 0:
            k = lowest_bit(leaves)
            leaves &= leaves - 1
            lanes = advance(all_lanes, (k >> 4) * LANE_WORDS)
            reach = float_at(lanes, END_AT + (k & 15))
            block = i64_at(room, NEXT + k) & (LEAF - 1)
            maybe = filter_block(blocks, block * BLOCK_FLOATS, triangle_ray_of(lanes, k & 15), reach).maybe
            if maybe != 0:  # to be decided when the corners are there
                if i64_at(mesh, SIZE) != TINY:
                    prefetch_corners(mesh, block, maybe)
                i64_put(room, WAITING + k, maybe)
                due |= 1 << k
            else:
                stack, top = advance(room, STACKS + k * STRIDE), i64_at(room, TOPS + k)
                next = pop_near(stack, top, reach)
                now = proceed(mesh, room, now, k, next.key, next.top)
        while deciding != 0:
            k = lowest_bit(deciding)
            deciding &= deciding - 1
            stack, top = advance(room, STACKS + k * STRIDE), i64_at(room, TOPS + k)
            lanes = advance(all_lanes, (k >> 4) * LANE_WORDS)
            packet = advance(packets, lane_of(k))
            found |= (1 if meet_waiting(mesh, packet, works, lanes, room, k, t_min, found >> k & 1 != 0) else 0) << k
            next = pop_near(stack, top, float_at(lanes, END_AT + (k & 15)))
            now = proceed(mesh, room, now, k, next.key, next.top)
    return found


@kernel
def shear_of(works: Table, k: i64) -> Shear:
    """`triangles.shear` of ray k, after `prepare_own_shears`."""
    of_packet, work = advance(works, (k >> 4) * WORK_WORDS), advance(works, work_of(k))
    by_z, by_y = i64_at(of_packet, BY_Z) >> (k & 15) & 1, i64_at(of_packet, BY_Y) >> (k & 15) & 1
    kz = 2 if by_z != 0 else by_y
    kx = 0 if kz == 2 else kz + 1
    return Shear(kx, 3 - kx - kz, kz, f64_at(work, SHEAR), f64_at(work, SHEAR + 16), f64_at(work, SHEAR + 32))


@kernel
def meet_waiting(
    mesh: Table, packet: Table, works: Table, lanes: Table, room: Table, k: i64, t_min: f64, found: bool
) -> bool:  # fmt: skip
    """Meet ray k with the triangles that wait for it, and note what is nearer; whether it has met any so far."""
    block, waiting = i64_at(room, NEXT + k) & (LEAF - 1), i64_at(room, WAITING + k)
    vertices, blocks, work = table_at(mesh, VERTICES), table_at(mesh, BLOCKS), advance(works, work_of(k))
    ox, oy, oz = f64_at(work, RENAMED_O), f64_at(work, RENAMED_O + 16), f64_at(work, RENAMED_O + 32)
    s = shear_of(works, k)
    while waiting != 0:
        lane = lowest_bit(waiting)
        waiting &= waiting - 1
        at, number = block * BLOCK_FLOATS + INDICES + lane, int_at(table_at(mesh, NUMBERS), 4 * block + lane)
        x, y = corners(vertices, blocks, at, s.kx) - ox, corners(vertices, blocks, at, s.ky) - oy
        hit = decide(number, x, y, corners(vertices, blocks, at, s.kz) - oz, s, t_min, math.inf)
        end = f64_at(packet, END)
        # Of two triangles at the same place, the one with the smaller number counts.
        if hit.t < end or (found and hit.t == end and hit.prim < int(f64_at(packet, PRIM))):
            found = True
            f64_put(packet, END, hit.t)
            f64_put(packet, PRIM, float(hit.prim))
            reach = hit.t * f64_at(work, SPEED) - f64_at(work, START) + f64_at(work, SLACK)
            f32_put(lanes, END_AT + (k & 15), reach)
    return found


@kernel
def any_in_turns(
    mesh: Table, packets: Table, t_min: f64, alive: i64, works: Table, all_lanes: Table, room: Table
) -> i64:
    """`any_rays` for the rays `alive`, together where many meet the same, and then each on its own."""
    together = many(mesh, alive, all_lanes)
    board(alive, alive & ~together, works, all_lanes, room)
    crowd = Crowd(scratch(ALL_PAIRS), scratch(4), advance(room, STACKS), advance(room, TOPS))
    prepare_shears(packets, works, together)
    halt = Halt(begin(together, crowd), 0, 0)
    blocked = any_apart(mesh, packets, t_min, Bundle(alive & ~together, 0), 0, all_lanes, room)
    while halt.going != 0:
        halt = any_shared(mesh, packets, t_min, works, all_lanes, crowd, Halt(halt.going, blocked, 0))
        now = part(mesh, halt.owners, False, all_lanes, room)
        blocked = any_apart(mesh, packets, t_min, now, halt.met, all_lanes, room)
    return blocked


@kernel
def any_apart(mesh: Table, packets: Table, t_min: f64, now: Bundle, blocked: i64, all_lanes: Table, room: Table) -> i64:
    """Find which rays of a bundle are blocked, each on its own; `blocked`: who is known to be."""
    nodes, blocks = table_at(mesh, NODES), table_at(mesh, BLOCKS)
    while now.nodes | now.leaves != 0:
        turn, leaves = now.nodes, now.leaves
        now = Bundle(0, 0)
        while turn != 0:
            k = lowest_bit(turn)
            turn &= turn - 1
            stack, top = advance(room, STACKS + k * STRIDE), i64_at(room, TOPS + k)
            lanes = advance(all_lanes, (k >> 4) * LANE_WORDS)
            reach = float_at(lanes, END_AT + (k & 15))
            node = i64_at(room, NEXT + k) & CHILD
            top = push_children_unsorted(nodes, node, box_ray_of(lanes, k & 15), reach, stack, top) - 1
            now = proceed(mesh, room, now, k, i64_at(stack, top), top)
        while leaves != 0:
            k = lowest_bit(leaves)
            leaves &= leaves - 1
            lanes = advance(all_lanes, (k >> 4) * LANE_WORDS)
            reach = float_at(lanes, END_AT + (k & 15))
            block = i64_at(room, NEXT + k) & (LEAF - 1)
            met = filter_block(blocks, block * BLOCK_FLOATS, triangle_ray_of(lanes, k & 15), reach)
            hit, maybe = met.surely != 0, met.maybe
            while maybe != 0 and not hit:
                packet = advance(packets, lane_of(k))
                o, s = packet_vec3(packet, ORIGIN), shear(packet_vec3(packet, DIRECTION))
                hit = meet_triangle(mesh, block, lowest_bit(maybe), o, s, t_min, f64_at(packet, END)).prim >= 0
                maybe &= maybe - 1
            if hit:
                blocked |= 1 << k
            else:
                top = i64_at(room, TOPS + k) - 1
                now = proceed(mesh, room, now, k, i64_at(room, STACKS + k * STRIDE + top), top)
    return blocked
