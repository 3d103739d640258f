"""The walks of `path`, eight side by side, in scenes that are made of few pieces (`scene.pieces`).

All pieces are met in single precision; where the filter is not sure, the lane is asked for by itself.
"""

from __future__ import annotations

import math

from sightray._jit import implements, kernel
from sightray.integrators.base import LINE, Batch, radiance_of_batch
from sightray.integrators.direct import chance_weight
from sightray.integrators.eightpaths import (
    MORE,
    Lit8,
    Paths8,
    Sent8,
    Surface8,
    Taken,
    bsdf_of_kinds,
    enter8,
    go_on8,
    keep_paths,
    lamp8,
    limited8,
    lit_by8,
    load_paths,
    sample_of_kinds,
    store_sent,
    way8,
    with_skies,
    write_found,
)
from sightray.integrators.path import DEPTH, LIGHT_SAMPLES, PathTracer, limited
from sightray.materials.base import emitted
from sightray.mathlib.eight_paths import (
    frame_about8,
    gather8v,
    into8,
    lane_at,
    load8v,
    out_of8,
    put_lane,
    store8v,
)
from sightray.mathlib.eights import (
    F64x8,
    I64x8,
    Vec3x8,
    abs8d,
    dot8,
    gather8i,
    load8i,
    mask8,
    not8,
    select8i,
    select8v,
    sign8d,
    splat8i,
    sqrt8d,
    store8d,
    store8i,
    store_chosen8i,
    vmax8d,
)
from sightray.mathlib.lanes import Mask8, count_bits, lowest_bit, movemask8
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, advance, f64_at, i64_at, i64_put, no_table, scratch, table_at
from sightray.mathlib.vec import grey
from sightray.samplers.base import nested8, one_of8
from sightray.scene.kinds import GLOWING, NUMBER, kinds_of
from sightray.scene.piece_kernels import Met8, Shade8, Spot8, blocked8, meet8, spot8
from sightray.scene.pieces import (
    FIRSTS,
    FLATS,
    KIND,
    LIGHT_OF,
    LIGHTS,
    MATERIAL,
    NORMAL,
    PIECE_WORDS,
    PIECES_OF,
    ROWS,
)
from sightray.scene.world import PIECES, find_closest, is_blocked, light_count
from sightray.textures.base import Where

OWN = MORE  # the piece that a path leaves, or -1
assert OWN + LINE == 2584  # as `radiance_of_paths` has it


class _AmongPieces(PathTracer):
    """`PathTracer` for scenes that are made of pieces."""


@implements(radiance_of_batch, _AmongPieces)
def radiance_of_paths(integrator: Table, world: Table, batch: Batch) -> i64:
    paths, count = scratch(2584), batch.size
    for k in range(0, count, 8):
        enter8(paths, batch.lines, k)
        store8i(paths, OWN + k, splat8i(-1))
    rays, event = 0, 0
    while count > 0:
        left = 0
        for k in range(0, count, 8):
            taken = step8(integrator, world, paths, batch, k, mask8((1 << min(8, count - k)) - 1), event, left)
            left, rays = taken.left, rays + taken.rays
        count = left
        event += 1
    return rays


@kernel
def step8(
    integrator: Table, world: Table, lines: Table, batch: Batch, first: i64, chosen: Mask8, event: i64, left: i64
) -> Taken:
    """Follow eight paths, from number `first` on, to their next surface; those that go on become numbers `left` and up."""
    paths, own_piece = load_paths(lines, first, batch), select8i(chosen, load8i(lines, OWN + first), splat8i(-1))
    pieces, rays = table_at(world, PIECES), count_bits(movemask8(chosen))
    met = surely_met(world, pieces, meet8(pieces, paths.o, paths.d, own_piece), paths, chosen)
    color, missed = paths.found, chosen & (met < 0)
    if movemask8(missed) != 0:
        color = with_skies(integrator, world, sent8(pieces, paths, own_piece), color, missed, event)
    piece, going = some_piece(met), chosen & (met >= 0)
    spot = spot8(pieces, paths.o, paths.d, own_piece, piece)
    offset, rows = piece * PIECE_WORDS, table_at(pieces, ROWS)
    kind = gather8i(rows, offset + KIND)
    glows = movemask8((kind >= GLOWING) & going)
    if glows != 0:
        color = add_glow(integrator, world, pieces, paths, own_piece, spot, piece, color, glows, event)
    if event >= i64_at(integrator, DEPTH) or movemask8(going) == 0:
        write_found(batch.lines, paths.place, color, movemask8(chosen))
        return Taken(left, rays)

    # Choose where to go on, and whether to.
    own = nested8(paths.draws, event)
    frame = frame_about8(spot.normal)
    wo = into8(frame, -paths.d)
    size = vmax8d(vmax8d(abs8d(spot.p.x), abs8d(spot.p.y)), abs8d(spot.p.z))
    t_min, material = vmax8d(spot.t, size) * 1e-9, gather8i(rows, offset + MATERIAL)
    lit_side = select8v(wo.z >= 0.0, spot.normal, -spot.normal)
    here = Surface8(spot.p, lit_side, kind & NUMBER, material, t_min, frame, wo)
    way = way8(integrator, world, own, event)
    next = sample_of_kinds(kinds_of(world), here, way)
    onward = go_on8(integrator, next, way, paths.beta, going, event)
    on = onward.on

    # Look for lights.
    count = i64_at(integrator, LIGHT_SAMPLES) if event == 0 else 1
    for k in range(count if light_count(world) > 0 else 0):
        lamp = lamp8(world, here, one_of8(own, k, count), going)
        lit = lit_by8(here, lamp, bsdf_of_kinds(kinds_of(world), here, into8(frame, lamp.sample.direction)), going)
        asked = count_bits(movemask8(lit.asked))
        if asked > 0:
            target = gather8i(table_at(pieces, LIGHTS), lamp.number)
            reach = lamp.sample.distance - t_min
            shade = blocked8(pieces, spot.p, lamp.sample.direction, reach, piece, target)
            bright = lit.asked & not8(surely_blocked(world, here, lit, lamp.sample.direction, shade, reach))
            brought = limited8(integrator, paths.beta * lit.light, event + 1) * (1.0 / count)
            color = select8v(bright, color + brought, color)
            rays += asked

    write_found(batch.lines, paths.place, color, movemask8(chosen & not8(on)))
    keep_paths(lines, left, paths, spot.p, out_of8(frame, onward.next.wi), onward, color, t_min)
    store_chosen8i(lines, OWN + left, piece, on)
    return Taken(left + count_bits(movemask8(on)), rays)


@kernel
def some_piece(piece: I64x8) -> I64x8:
    """Numbers of pieces, 0 instead of none."""
    return piece & ((piece >> 63) ^ -1)


# ------------------------------------------------------------------------------------------- lanes asked for one by one


@kernel
def surely_met(world: Table, pieces: Table, met: Met8, paths: Paths8, chosen: Mask8) -> I64x8:
    """The nearest pieces: those of which the filter is not sure, exactly."""
    bits = movemask8(met.unsure & chosen)
    if bits == 0:
        return met.piece
    words = scratch(64)
    store8v(words, 0, paths.o)
    store8v(words, 24, paths.d)
    store8d(words, 48, paths.t_min)
    store8i(words, 56, met.piece)
    while bits != 0:
        k = lowest_bit(bits)
        bits &= bits - 1
        hit = find_closest(world, lane_at(words, k), lane_at(words, 24 + k), f64_at(words, 48 + k), math.inf)
        found = -1
        if hit.item >= 0:
            found = i64_at(table_at(pieces, PIECES_OF), i64_at(table_at(pieces, FIRSTS), hit.item) + hit.prim)
        i64_put(words, 56 + k, found)
    return load8i(words, 56)


@kernel
def surely_blocked(world: Table, here: Surface8, lit: Lit8, d: Vec3x8, shade: Shade8, reach: F64x8) -> Mask8:
    """Which shadow rays are blocked: those of which the filter is not sure, exactly."""
    bits = movemask8(shade.unsure & lit.asked)
    if bits == 0:
        return shade.blocked
    words = scratch(64)
    store8v(words, 0, here.p)
    store8v(words, 24, d)
    store8d(words, 48, here.t_min)
    store8d(words, 56, reach)
    found = 0
    while bits != 0:
        k = lowest_bit(bits)
        bits &= bits - 1
        if is_blocked(world, lane_at(words, k), lane_at(words, 24 + k), f64_at(words, 48 + k), f64_at(words, 56 + k)):
            found |= 1 << k
    return shade.blocked | mask8(found)


@kernel
def sent8(pieces: Table, paths: Paths8, own_piece: I64x8) -> Sent8:
    """Where rays come from."""
    rows, offset = table_at(pieces, ROWS), some_piece(own_piece) * PIECE_WORDS
    normal = gather8v(rows, offset + NORMAL)
    normal = select8v(own_piece >= i64_at(pieces, FLATS), paths.o - normal, normal)
    normal = normal * (sign8d(dot8(normal, paths.d)) / sqrt8d(dot8(normal, normal)))
    return Sent8(paths.o, normal, paths.d, paths.density, paths.beta)


@kernel
def add_glow(
    integrator: Table, world: Table, pieces: Table, paths: Paths8, own_piece: I64x8, spot: Spot8, at: I64x8, color: Vec3x8,
    bits: i64, event: i64,
) -> Vec3x8:  # fmt: skip
    """What the surfaces in `bits` give off, weighed as `path.given_off` does."""
    words = scratch(176)
    store_sent(words, sent8(pieces, paths, own_piece))
    store8v(words, 104, color)
    store8d(words, 128, spot.t)
    store8d(words, 136, -dot8(spot.normal, paths.d))
    store8i(words, 144, at)
    while bits != 0:
        k = lowest_bit(bits)
        bits &= bits - 1
        piece = i64_at(words, 144 + k)
        row = advance(table_at(pieces, ROWS), piece * PIECE_WORDS)
        zero = grey(0.0)
        where = Where(0.0, 0.0, zero, zero, 0.0, no_table())
        glow = emitted(table_at(row, MATERIAL), where, f64_at(words, 136 + k))
        number = i64_at(table_at(pieces, LIGHT_OF), piece)
        weight = chance_weight(
            world, number, lane_at(words, k), lane_at(words, 56 + k), lane_at(words, 24 + k), f64_at(words, 128 + k),
            f64_at(words, 48 + k),
        )  # fmt: skip
        light = lane_at(words, 80 + k) * glow * weight
        put_lane(words, 104 + k, lane_at(words, 104 + k) + limited(integrator, light, event))
    return load8v(words, 104)
