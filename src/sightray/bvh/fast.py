"""Nearest hits decided in single precision: what ``precision="fast"`` asks for.

The filters of `triangles` and `sixteen` propose triangles, and here their word is final: no corner is read in double
precision, and t is the numerator of the length over the determinant, as the filter has them, to about 2^-20 of the tree's
size. Between t_min and t_max it is as exact as that.

To be sure that no hit is lost, filters make triangles larger, by a bound of all rounding errors that is seldom reached;
answers that are final should not be so wide. A small part of that slack is left (`KEPT`), lest rays slip between triangles:
4u of the larger edge, which is what rounding amounts to as a rule. Of lengths none is left.

Reference: T. Möller, B. Trumbore, "Fast, minimum storage ray/triangle intersection" (JGT 1997).
"""

from __future__ import annotations

from typing import NamedTuple

from sightray._jit import kernel
from sightray.bvh.bundles import (
    NEXT,
    STACKS,
    STRIDE,
    TOPS,
    Bundle,
    board,
    box_ray_of,
    lane_of,
    proceed,
    triangle_ray_of,
)
from sightray.bvh.bvh8 import CHILD, LEAF, NODES, float_at, int_at, pop_near, visit_nearest
from sightray.bvh.casting import ALONG, END, END_AT, LANE_WORDS, PACKET_WORDS, PRIM, SIDE, SPEED, START, WORK_WORDS
from sightray.bvh.triangles import BLOCK_FLOATS, BLOCKS, EDGES, NUMBERS, SIDES, TriangleRay
from sightray.mathlib.lanes import (
    F32x4,
    F32x16,
    flip4,
    load4,
    load16,
    load16d,
    lowest_bit,
    mask16,
    movemask4,
    movemask16,
    select16,
    select16d,
    splat4,
    splat16,
    splat16d,
    store4,
    store16,
    store16d,
    vmax4,
    vmin4,
)
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, advance, f32_put, f64_at, f64_put, i64_at, scratch, table_at

KEPT = 4 / (16 * SIDES)  # of the slack of the barycentric coordinates


@kernel
def tighten(lanes: Table, count: i64) -> None:
    """Let the filters' answers be final for `count` packets: after their boxes were prepared, which need all slack."""
    for p in range(count):
        side = p * LANE_WORDS * 2 + SIDE
        store16(lanes, side, load16(lanes, side) * splat16(KEPT))
        store16(lanes, p * LANE_WORDS * 2 + ALONG, splat16(0.0))


@kernel
def keep_nearer(packet: Table, lanes: Table, length: F32x16, prim: i64, maybe: i64) -> i64:
    """Note which of the rays `maybe` meet a triangle nearer than anything so far."""
    end = load16(lanes, END_AT)
    better = mask16(maybe) & (length > splat16(0.0)) & (length < end)
    store16(lanes, END_AT, select16(better, length, end))
    store16d(packet, PRIM, select16d(better, splat16d(float(prim)), load16d(packet, PRIM)))
    return movemask16(better)


class NearBlock(NamedTuple):
    """Triangles of a block."""

    maybe: i64  # those that are met, a bit each
    length: F32x4  # how far away


@kernel
def meet_four(blocks: Table, at: i64, ray: TriangleRay, reach: f64) -> NearBlock:
    """`filter_block`, with lengths."""
    ax, ay, az = load4(blocks, at), load4(blocks, at + 4), load4(blocks, at + 8)
    bx, by, bz = load4(blocks, at + EDGES), load4(blocks, at + EDGES + 4), load4(blocks, at + EDGES + 8)
    cx, cy, cz = load4(blocks, at + 2 * EDGES), load4(blocks, at + 2 * EDGES + 4), load4(blocks, at + 2 * EDGES + 8)
    px, py, pz = ray.dy * cz - ray.dz * cy, ray.dz * cx - ray.dx * cz, ray.dx * cy - ray.dy * cx  # d x c
    sx, sy, sz = ray.ox - ax, ray.oy - ay, ray.oz - az
    qx, qy, qz = sy * bz - sz * by, sz * bx - sx * bz, sx * by - sy * bx  # s x b
    signed = bx * px + by * py + bz * pz
    det = flip4(signed, signed)
    u = flip4(sx * px + sy * py + sz * pz, signed)
    v = flip4(ray.dx * qx + ray.dy * qy + ray.dz * qz, signed)
    t = flip4(cx * qx + cy * qy + cz * qz, signed)
    size = vmax4(flip4(bx, bx) + flip4(by, by) + flip4(bz, bz), flip4(cx, cx) + flip4(cy, cy) + flip4(cz, cz))
    zero = splat4(0.0)
    ahead = vmin4(t, det * splat4(reach) - t)
    maybe = (vmin4(vmin4(u, v), det - (u + v)) + size * ray.side >= zero) & (ahead >= zero)
    return NearBlock(movemask4(maybe), t / det)


@kernel
def keep_nearest(mesh: Table, near: NearBlock, block: i64, packet: Table, lanes: Table, lane: i64, reach: f64) -> f64:
    """Note the nearest triangle of a block for one ray, if it is nearer than `reach`; how far it reaches then."""
    lengths, maybe, prim = scratch(2), near.maybe, -1
    store4(lengths, 0, near.length)
    while maybe != 0:
        bit = lowest_bit(maybe)
        maybe &= maybe - 1
        length = float_at(lengths, bit)
        if 0.0 < length < reach:
            reach, prim = length, int_at(table_at(mesh, NUMBERS), 4 * block + bit)
    if prim >= 0:
        f32_put(lanes, END_AT + lane, reach)
        f64_put(packet, PRIM, float(prim))
    return reach


@kernel
def fast_in_turns(
    mesh: Table, packets: Table, t_min: f64, alive: i64, works: Table, all_lanes: Table, room: Table
) -> i64:
    """`closest_in_turns`, but what the filter finds is final, so that nothing waits for corners."""
    board(alive, alive, works, all_lanes, room)
    nodes, blocks = table_at(mesh, NODES), table_at(mesh, BLOCKS)
    now, found = Bundle(alive, 0), 0
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
            next = visit_nearest(nodes, node, box_ray_of(lanes, k & 15), reach, stack, top)
            now = proceed(mesh, room, now, k, next.key, next.top)
        while leaves != 0:
            k = lowest_bit(leaves)
            leaves &= leaves - 1
            lanes = advance(all_lanes, (k >> 4) * LANE_WORDS)
            reach = float_at(lanes, END_AT + (k & 15))
            block = i64_at(room, NEXT + k) & (LEAF - 1)
            near = meet_four(blocks, block * BLOCK_FLOATS, triangle_ray_of(lanes, k & 15), reach)
            if near.maybe != 0:
                nearer = keep_nearest(mesh, near, block, advance(packets, lane_of(k)), lanes, k & 15, reach)
                found |= (1 if nearer < reach else 0) << k
                reach = nearer
            next = pop_near(advance(room, STACKS + k * STRIDE), i64_at(room, TOPS + k), reach)
            now = proceed(mesh, room, now, k, next.key, next.top)
    return found


@kernel
def end_fast(packets: Table, works: Table, lanes: Table, found: Table, count: i64) -> None:
    """Write where rays of packets end that have met something, from the lengths."""
    for p in range(count):
        packet, work, bits = advance(packets, p * PACKET_WORDS), advance(works, p * WORK_WORDS), i64_at(found, p)
        while bits != 0:
            lane = lowest_bit(bits)
            bits &= bits - 1
            length = float_at(lanes, 2 * p * LANE_WORDS + END_AT + lane)
            f64_put(packet, END + lane, (length + f64_at(work, START + lane)) / f64_at(work, SPEED + lane))
