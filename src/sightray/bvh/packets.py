"""Rays in packets of sixteen through the triangles of a mesh: up to sixteen packets, 256 rays, at a time.

Rays are **coherent** if they run into the same octant, share their largest component, and lie close together compared to
the tree. Packets of coherent rays that lie next to each other form a **group** of up to four, which walks the tree as one
(see `hulls`): one test of eight boxes tells which children no ray of the group can meet, and at a leaf each triangle is met
by the packets whose own interval ray meets its box, sixteen rays at a time (see `sixteen`). Groups take turns, so that one
waits for memory while another computes. All other packets are left to `bundles`.

References: I. Wald, P. Slusallek, C. Benthin, M. Wagner, "Interactive rendering with coherent ray tracing" (Eurographics
2001); S. Boulos, I. Wald, P. Shirley, "Geometric and arithmetic culling methods for entire ray packets" (2006).
"""

from __future__ import annotations

from typing import NamedTuple

from sightray._jit import kernel
from sightray.bvh.bundles import BUNDLE_WORDS, any_in_turns, closest_in_turns, prefetch_child
from sightray.bvh.bvh8 import BOTTOM, CHILD, CHILDREN, LEAF, NODE_FLOATS, NODES, float_at, int_at, pop_near
from sightray.bvh.casting import (
    END,
    END_AT,
    LANE_WORDS,
    PACKET_WORDS,
    WORK_WORDS,
    cast_packet,
    share,
)
from sightray.bvh.fast import end_fast, fast_in_turns, keep_nearer, tighten
from sightray.bvh.hulls import (
    ALIVE,
    AXES,
    FIRST,
    GROUP_WORDS,
    KEY,
    LEFT,
    MET,
    OCTANT,
    PACKET_REACHES,
    REACHES,
    SHEARED,
    STACK,
    TOP,
    all_joined,
    are_close,
    cull_triangles,
    extremes,
    extremes_at,
    meet_interval,
    put_extremes,
    put_hull,
    put_reach,
    put_slabs,
)
from sightray.bvh.sixteen import decide_triangle, edge_sizes, filter_triangle, keep_decided, prepare_shear
from sightray.bvh.triangles import BLOCK_FLOATS, BLOCKS, INDICES, NUMBERS
from sightray.mathlib.lanes import (
    count_bits,
    highest_bit,
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
    sort8,
    splat16,
    splat16d,
    store16,
)
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, advance, f64_at, i64_at, i64_put, scratch, table_at

# How far the origins of rays that go together may lie apart, and their directions, in the tree's unit frame: of a packet,
# and of a group.
SPREAD, GROUP_SPREAD = 0.02, 0.08

# Words of the room: lanes, working memory and extremes of packets; then groups and, when these are done, bundles.
PACKETS = 16
LANES = 0
WORKS = LANES + PACKETS * LANE_WORDS
EXTREMES = WORKS + PACKETS * WORK_WORDS
GROUPS = EXTREMES + PACKETS * 16
ROOM_WORDS = GROUPS + max(PACKETS * GROUP_WORDS, BUNDLE_WORDS)


class Turns(NamedTuple):
    """Groups on their way, a bit each."""

    nodes: i64  # groups that visit a node next
    leaves: i64  # groups that visit a leaf next


@kernel
def group_at(room: Table, g: i64) -> Table:
    """The row of a group."""
    return advance(room, GROUPS + g * GROUP_WORDS)


@kernel
def go_on(mesh: Table, group: Table, now: Turns, g: i64, key: i64, top: i64) -> Turns:
    """Note what group g visits next and ask for its memory; the root means that nothing is left."""
    i64_put(group, KEY, key)
    i64_put(group, TOP, top)
    child = key & CHILD
    prefetch_child(table_at(mesh, NODES), table_at(mesh, BLOCKS), child)
    leaf = child >> 30
    node = 1 - leaf if child != 0 else 0
    return Turns(now.nodes | node << g, now.leaves | leaf << g)


@kernel
def pop_and_go_on(mesh: Table, group: Table, now: Turns, g: i64) -> Turns:
    """Go on with what is next on the stack and not farther than the best hits."""
    next = pop_near(advance(group, STACK), i64_at(group, TOP), f64_at(group, REACHES))
    return go_on(mesh, group, now, g, next.key, next.top)


@kernel
def closest_together(mesh: Table, packets: Table, t_min: f64, groups: i64, fast: bool, room: Table) -> None:
    """`closest_rays` or `fast_rays` for all groups, in turns."""
    nodes = table_at(mesh, NODES)
    now = Turns((1 << groups) - 1, 0)
    while now.nodes | now.leaves != 0:
        turn, leaves = now.nodes, now.leaves
        now = Turns(0, 0)
        while turn != 0:
            g = lowest_bit(turn)
            turn &= turn - 1
            group = group_at(room, g)
            at, top = (i64_at(group, KEY) & CHILD) * NODE_FLOATS, i64_at(group, TOP)
            met = meet_interval(nodes, at, group)
            count = count_bits(movemask8(met.met))
            push_all8(advance(group, STACK), top, sort8(met.near, load8(nodes, at + CHILDREN), met.met))
            i64_put(group, TOP, top + count)
            now = pop_and_go_on(mesh, group, now, g)
        while leaves != 0:
            g = lowest_bit(leaves)
            leaves &= leaves - 1
            group = group_at(room, g)
            meet_block_closest(mesh, packets, t_min, i64_at(group, KEY) & (LEAF - 1), fast, group, room)
            now = pop_and_go_on(mesh, group, now, g)


@kernel
def sheared_axis(group: Table, packet: Table, work: Table, p: i64) -> i64:
    """The axis of the largest component of a packet, whose shear is prepared after this."""
    axis, sheared = i64_at(group, AXES) >> (2 * p) & 3, i64_at(group, SHEARED)
    if sheared >> p & 1 == 0:
        prepare_shear(packet, axis, work)
        i64_put(group, SHEARED, sheared | 1 << p)
    return axis


@kernel
def meet_block_closest(
    mesh: Table, packets: Table, t_min: f64, block: i64, fast: bool, group: Table, room: Table
) -> None:
    """Meet the triangles of a block with the rays of a group."""
    blocks, first = table_at(mesh, BLOCKS), i64_at(group, FIRST)
    culled, sizes = cull_triangles(blocks, block * BLOCK_FLOATS, group), scratch(2)
    edge_sizes(blocks, block * BLOCK_FLOATS, sizes)
    while culled != 0:
        bit = lowest_bit(culled)
        culled &= culled - 1
        p, at = bit >> 2, block * BLOCK_FLOATS + (bit & 3)
        lanes = advance(room, LANES + (first + p) * LANE_WORDS)
        met = filter_triangle(blocks, at, float_at(sizes, bit & 3), lanes)
        maybe = met.maybe & i64_at(group, ALIVE + p)
        if maybe != 0:
            packet, work = advance(packets, (first + p) * PACKET_WORDS), advance(room, WORKS + (first + p) * WORK_WORDS)
            found, prim = i64_at(group, MET + p), int_at(table_at(mesh, NUMBERS), 4 * block + (bit & 3))
            if fast:
                better = keep_nearer(packet, lanes, met.length, prim, maybe)
            else:
                t = decide_triangle(mesh, packet, work, sheared_axis(group, packet, work, p), at + INDICES)
                better = keep_decided(packet, work, lanes, t, prim, t_min, maybe, found)
            if better != 0:
                i64_put(group, MET + p, found | better)
                put_reach(group, p, lanes)


@kernel
def any_together(mesh: Table, packets: Table, t_min: f64, groups: i64, room: Table) -> None:
    """`any_rays` for all groups, in turns."""
    nodes = table_at(mesh, NODES)
    now = Turns((1 << groups) - 1, 0)
    while now.nodes | now.leaves != 0:
        turn, leaves = now.nodes, now.leaves
        now = Turns(0, 0)
        while turn != 0:
            g = lowest_bit(turn)
            turn &= turn - 1
            group = group_at(room, g)
            at, top = i64_at(group, KEY) * NODE_FLOATS, i64_at(group, TOP)
            bits = movemask8(meet_interval(nodes, at, group).met)
            last = highest_bit(bits | 1)
            stack = advance(group, STACK)
            below = i64_at(stack, top - 1)
            push8(stack, top, load8(nodes, at + CHILDREN), bits & ~(1 << last))
            child = int_at(nodes, at + CHILDREN + last) if bits != 0 else below
            now = go_on(mesh, group, now, g, child, top + count_bits(bits) - 1)
        while leaves != 0:
            g = lowest_bit(leaves)
            leaves &= leaves - 1
            group = group_at(room, g)
            meet_block_any(mesh, packets, t_min, i64_at(group, KEY) & (LEAF - 1), group, room)
            if i64_at(group, LEFT) > 0:
                top = i64_at(group, TOP) - 1
                now = go_on(mesh, group, now, g, i64_at(group, STACK + top), top)


@kernel
def meet_block_any(mesh: Table, packets: Table, t_min: f64, block: i64, group: Table, room: Table) -> None:
    """Find the rays of a group that the triangles of a block stop."""
    blocks, first = table_at(mesh, BLOCKS), i64_at(group, FIRST)
    culled, sizes = cull_triangles(blocks, block * BLOCK_FLOATS, group), scratch(2)
    edge_sizes(blocks, block * BLOCK_FLOATS, sizes)
    while culled != 0:
        bit = lowest_bit(culled)
        culled &= culled - 1
        p, at = bit >> 2, block * BLOCK_FLOATS + (bit & 3)
        alive = i64_at(group, ALIVE + p) & ~i64_at(group, MET + p)
        if alive == 0:
            continue
        lanes = advance(room, LANES + (first + p) * LANE_WORDS)
        met = filter_triangle(blocks, at, float_at(sizes, bit & 3), lanes)
        stopped, doubtful = met.surely & alive, met.maybe & alive & ~met.surely
        if doubtful != 0:
            packet, work = advance(packets, (first + p) * PACKET_WORDS), advance(room, WORKS + (first + p) * WORK_WORDS)
            t = decide_triangle(mesh, packet, work, sheared_axis(group, packet, work, p), at + INDICES)
            stopped |= movemask16((splat16d(t_min) < t) & (t < load16d(packet, END))) & doubtful
        if stopped != 0:  # rays that are done meet nothing
            i64_put(group, MET + p, i64_at(group, MET + p) | stopped)
            i64_put(group, LEFT, i64_at(group, LEFT) - count_bits(stopped))
            store16(lanes, END_AT, select16(mask16(stopped), splat16(-1.0), load16(lanes, END_AT)))
            if stopped == alive:
                put_reach(group, p, lanes)


@kernel
def form_groups(
    tree: Table, packets: Table, count: i64, t_min: f64, spread: f64, group_spread: f64, apart: Table, found: Table,
    room: Table,
) -> i64:  # fmt: skip
    """Put packets that go the same way into groups, whose number this is; the rays of the others go to `apart`.

    The two spreads say how far rays of a packet, and of a group, may lie apart, in the tree's unit frame.
    """
    groups, alive = 0, scratch(16)
    for first in range(0, count, 4):
        coherent, axes, octants = 0, 0, 0
        for number in range(first, min(first + 4, count)):
            packet, lanes = advance(packets, number * PACKET_WORDS), advance(room, LANES + number * LANE_WORDS)
            bits = cast_packet(tree, packet, t_min, advance(room, WORKS + number * WORK_WORDS), lanes)
            i64_put(found, number, 0)
            i64_put(alive, number, bits)
            i64_put(apart, number, bits)
            if bits == 0:
                continue
            shared, bounds, p = share(packet, lanes, bits), extremes(lanes), number - first
            if shared.same and are_close(bounds, spread):
                axes |= shared.axis << (2 * p)
                octants |= shared.octant << (4 * p)
                coherent |= 1 << p
                put_extremes(advance(room, EXTREMES + 16 * number), bounds)
                i64_put(apart, number, 0)
        while coherent != 0:
            group = group_at(room, groups)
            groups += 1
            i64_put(group, FIRST, first)
            i64_put(group, AXES, axes)
            coherent &= ~gather_group(group, coherent, advance(alive, first), octants, group_spread, room)
    return groups


@kernel
def note_groups(groups: i64, found: Table, room: Table) -> None:
    """Write down who met something in groups."""
    for g in range(groups):
        group = group_at(room, g)
        for p in range(4):
            if i64_at(group, MET + p) != 0:
                i64_put(found, i64_at(group, FIRST) + p, i64_at(group, MET + p))


@kernel
def rays_apart(apart: Table, first: i64, count: i64) -> i64:
    """The rays of four packets that go each on its own, a bit each."""
    bits = 0
    for number in range(first, min(first + 4, count)):
        bits |= i64_at(apart, number) << (16 * (number - first))
    return bits


@kernel
def note_apart(found: Table, first: i64, count: i64, bits: i64) -> None:
    """Write down who of these met something."""
    for number in range(first, min(first + 4, count)):
        its = (bits >> (16 * (number - first))) & 0xFFFF
        i64_put(found, number, i64_at(found, number) | its)


@kernel
def gather_group(group: Table, coherent: i64, alive: Table, octants: i64, spread: f64, room: Table) -> i64:
    """Fill the row of a group with the first coherent packet of four and those that go with it; a bit for each."""
    leader, first = lowest_bit(coherent), i64_at(group, FIRST)
    octant, bounds = octants >> (4 * leader) & 7, extremes_at(advance(room, EXTREMES + 16 * (first + leader)))
    i64_put(group, KEY, 0)
    i64_put(group, TOP, 1)
    i64_put(group, STACK, BOTTOM)
    for p in range(4):
        i64_put(group, MET + p, 0)
        i64_put(group, ALIVE + p, 0)
    i64_put(group, SHEARED, 0)
    i64_put(group, OCTANT, octant)
    store16(group, PACKET_REACHES, splat16(-1.0))  # who takes no part reaches nowhere
    members, rays = 0, 0
    for p in range(leader, 4):
        if coherent >> p & 1 != 0 and octants >> (4 * p) & 7 == octant:
            its = extremes_at(advance(room, EXTREMES + 16 * (first + p)))
            both = all_joined(bounds, its)
            if are_close(both, spread):
                bounds = both
                members |= 1 << p
                rays += count_bits(i64_at(alive, p))
                i64_put(group, ALIVE + p, i64_at(alive, p))
                put_hull(group, p, its, octant)
                put_reach(group, p, advance(room, LANES + (first + p) * LANE_WORDS))
    i64_put(group, LEFT, rays)
    put_slabs(group, bounds, octant)
    return members


@kernel
def closest_rays(mesh: Table, packets: Table, count: i64, t_min: f64, found: Table, room: Table) -> None:
    """Nearest hits beyond t_min of the rays of up to sixteen packets: writes `END` and `PRIM` of those that meet the mesh.

    Their bits are written to `found`, a word for each packet. Their hits are what `closest_triangle` finds; of equal t the
    triangle that comes first.
    """
    apart = scratch(16)
    groups = form_groups(mesh, packets, count, t_min, SPREAD, GROUP_SPREAD, apart, found, room)
    if groups > 0:
        closest_together(mesh, packets, t_min, groups, False, room)
        note_groups(groups, found, room)
    for first in range(0, count, 4):
        bits = rays_apart(apart, first, count)
        if bits != 0:
            works, lanes = advance(room, WORKS + first * WORK_WORDS), advance(room, LANES + first * LANE_WORDS)
            packet, rest = advance(packets, first * PACKET_WORDS), advance(room, GROUPS)
            note_apart(found, first, count, closest_in_turns(mesh, packet, t_min, bits, works, lanes, rest))


@kernel
def fast_rays(mesh: Table, packets: Table, count: i64, t_min: f64, found: Table, room: Table) -> None:
    """`closest_rays`, decided in single precision (see `fast`)."""
    apart = scratch(16)
    groups = form_groups(mesh, packets, count, t_min, SPREAD, GROUP_SPREAD, apart, found, room)
    tighten(advance(room, LANES), count)
    if groups > 0:
        closest_together(mesh, packets, t_min, groups, True, room)
        note_groups(groups, found, room)
    for first in range(0, count, 4):
        bits = rays_apart(apart, first, count)
        if bits != 0:
            works, lanes = advance(room, WORKS + first * WORK_WORDS), advance(room, LANES + first * LANE_WORDS)
            packet, rest = advance(packets, first * PACKET_WORDS), advance(room, GROUPS)
            note_apart(found, first, count, fast_in_turns(mesh, packet, t_min, bits, works, lanes, rest))
    end_fast(packets, advance(room, WORKS), advance(room, LANES), found, count)


@kernel
def any_rays(mesh: Table, packets: Table, count: i64, t_min: f64, found: Table, room: Table) -> None:
    """The rays of up to sixteen packets that meet the mesh between t_min and their end: bits as for `closest_rays`."""
    apart = scratch(16)
    groups = form_groups(mesh, packets, count, t_min, SPREAD, GROUP_SPREAD, apart, found, room)
    if groups > 0:
        any_together(mesh, packets, t_min, groups, room)
        note_groups(groups, found, room)
    for first in range(0, count, 4):
        bits = rays_apart(apart, first, count)
        if bits != 0:
            works, lanes = advance(room, WORKS + first * WORK_WORDS), advance(room, LANES + first * LANE_WORDS)
            packet, rest = advance(packets, first * PACKET_WORDS), advance(room, GROUPS)
            note_apart(found, first, count, any_in_turns(mesh, packet, t_min, bits, works, lanes, rest))
