"""The walks of `path`, eight side by side, in scenes that are made of few pieces (`scene.pieces`).

A path waits: for one result after the other, and for branches that were guessed wrong. Eight paths in the lanes of the same
registers wait together. So a batch of paths is followed surface by surface; those that end make room, and the others move
up. The same random numbers decide the same things as in `path.walk`, so a path is the same but for rounding: where
something is not sure in single precision, or rare, or has no form for eight paths, the lane is asked for by itself.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import implements, kernel
from sightray.integrators.base import FOUND, KEY, LINE, ORIGIN, PIXEL, SAMPLE, Batch, radiance_of_batch
from sightray.integrators.base import WAY as WAY_OUT
from sightray.integrators.direct import LIGHT, PLACE, chance_weight, light_of_skies
from sightray.integrators.path import (
    CHOICE,
    CLAMP,
    DEPTH,
    LIGHT_SAMPLES,
    ROULETTE_DEPTH,
    WAY,
    PathTracer,
    limited,
)
from sightray.lights.base import WHOLE, LightSample8, illuminate, illuminate_eight
from sightray.materials.base import Sample8, Value8, bsdf_eight, emitted, sample_eight
from sightray.mathlib.eight_paths import (
    Frame8,
    brightest8,
    frame_about8,
    gather8v,
    grey8,
    into8,
    lane_at,
    lines_at,
    load8v,
    out_of8,
    put_lane,
    put_lines,
    store8v,
)
from sightray.mathlib.eights import (
    F64x8,
    I64x8,
    Vec3x8,
    abs8d,
    dot8,
    gather8i,
    load8d,
    load8i,
    mask8,
    not8,
    select8d,
    select8i,
    select8v,
    sign8d,
    splat8d,
    splat8i,
    splat8v,
    sqrt8d,
    store8d,
    store8i,
    store_chosen8d,
    store_chosen8i,
    vmax8d,
    vmin8d,
)
from sightray.mathlib.lanes import Mask8, count_bits, lowest_bit, movemask8
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import (
    Table,
    advance,
    f64_at,
    f64_put,
    i64_at,
    i64_put,
    no_table,
    scratch,
    table_at,
    vec3_at,
    words_to,
)
from sightray.mathlib.vec import grey
from sightray.samplers.base import Draws8, Pair8, nested8, one_of8, pair8
from sightray.scene.light_choice import choose_light
from sightray.scene.piece_kernels import Met8, Shade8, Spot8, blocked8, meet8, spot8
from sightray.scene.pieces import (
    CHOOSES,
    FIRSTS,
    FLATS,
    GLOWING,
    KIND,
    KIND_COUNT,
    KINDS,
    LIGHT_OF,
    LIGHTS,
    MATERIAL,
    NORMAL,
    PIECE_WORDS,
    PIECES_OF,
    ROWS,
)
from sightray.scene.world import BACKGROUND, PIECES, SKY_COUNT, find_closest, is_blocked, light_at, light_count
from sightray.textures.base import Where

# What is known of a path: where its next ray begins and goes, its throughput, what it has found, the density of the
# direction, from where on the ray counts, its random numbers, the piece that it leaves, and which of the batch it is.
START, GOES, BETA, COLOR = 0, 3 * LINE, 6 * LINE, 9 * LINE
DENSITY, BEGIN, ITS_KEY, ITS_PIXEL, ITS_SAMPLE, OWN, PLACE_IN_BATCH = (k * LINE for k in range(12, 19))
assert 19 * LINE == 2584  # as `radiance_of_paths` has it


class Paths8(NamedTuple):
    """Eight paths before their next ray."""

    o: Vec3x8
    d: Vec3x8
    beta: Vec3x8
    found: Vec3x8
    density: F64x8
    t_min: F64x8
    own: I64x8  # the piece that the ray leaves, or -1
    place: I64x8
    draws: Draws8


class Surface8(NamedTuple):
    """What eight rays have met."""

    spot: Spot8
    piece: I64x8
    kind: I64x8  # classes of materials
    material: I64x8  # addresses of their rows
    t_min: F64x8  # for rays that leave from there
    frame: Frame8
    wo: Vec3x8


@implements(radiance_of_batch, PathTracer)
def radiance_of_paths(integrator: Table, world: Table, batch: Batch) -> i64:
    paths, count = scratch(2584), batch.size
    for k in range(0, count, 8):
        enter8(paths, batch.lines, k)
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
def enter8(paths: Table, lines: Table, k: i64) -> None:
    """Begin eight paths of a batch, from number k on."""
    put_lines(paths, START + k, LINE, lines_at(lines, ORIGIN + k, LINE))
    put_lines(paths, GOES + k, LINE, lines_at(lines, WAY_OUT + k, LINE))
    put_lines(paths, BETA + k, LINE, grey8(1.0))
    put_lines(paths, COLOR + k, LINE, grey8(0.0))
    store8d(paths, DENSITY + k, splat8d(0.0))
    store8d(paths, BEGIN + k, splat8d(0.0))
    store8i(paths, ITS_KEY + k, load8i(lines, KEY + k))
    store8i(paths, ITS_PIXEL + k, load8i(lines, PIXEL + k))
    store8i(paths, ITS_SAMPLE + k, load8i(lines, SAMPLE + k))
    store8i(paths, OWN + k, splat8i(-1))
    for i in range(k, k + 8):
        i64_put(paths, PLACE_IN_BATCH + i, i)


@kernel
def keep_lines(paths: Table, index: i64, a: Vec3x8, chosen: Mask8) -> None:
    """Write the chosen of eight vectors."""
    store_chosen8d(paths, index, a.x, chosen)
    store_chosen8d(paths, index + LINE, a.y, chosen)
    store_chosen8d(paths, index + 2 * LINE, a.z, chosen)


@kernel
def load_paths(paths: Table, k: i64, batch: Batch, chosen: Mask8) -> Paths8:
    """Eight paths, from number k on; only the chosen ones are there."""
    draws = Draws8(
        batch.sampler, load8i(paths, ITS_PIXEL + k), load8i(paths, ITS_KEY + k), load8i(paths, ITS_SAMPLE + k),
        batch.samples, batch.dimension,
    )  # fmt: skip
    return Paths8(
        lines_at(paths, START + k, LINE), lines_at(paths, GOES + k, LINE), lines_at(paths, BETA + k, LINE),
        lines_at(paths, COLOR + k, LINE), load8d(paths, DENSITY + k), load8d(paths, BEGIN + k),
        select8i(chosen, load8i(paths, OWN + k), splat8i(-1)), load8i(paths, PLACE_IN_BATCH + k), draws,
    )  # fmt: skip


class Taken(NamedTuple):
    """After a step."""

    left: i64  # paths that go on
    rays: i64


@kernel
def step8(
    integrator: Table, world: Table, lines: Table, batch: Batch, first: i64, chosen: Mask8, event: i64, left: i64
) -> Taken:
    """Follow eight paths, from number `first` on, to their next surface; those that go on become numbers `left` and up."""
    paths = load_paths(lines, first, batch, chosen)
    pieces, rays = table_at(world, PIECES), count_bits(movemask8(chosen))
    met = surely_met(world, pieces, meet8(pieces, paths.o, paths.d, paths.own), paths, chosen)
    color, missed = paths.found, chosen & (met < 0)
    if movemask8(missed) != 0:
        color = with_skies(integrator, world, paths, color, missed, event)
    piece, going = some_piece(met), chosen & (met >= 0)
    spot = spot8(pieces, paths.o, paths.d, paths.own, piece)
    offset, rows = piece * PIECE_WORDS, table_at(pieces, ROWS)
    kind = gather8i(rows, offset + KIND)
    glows = movemask8((kind >= GLOWING) & going)
    if glows != 0:
        color = add_glow(integrator, world, pieces, paths, spot, piece, color, glows, event)
    if event >= i64_at(integrator, DEPTH) or movemask8(going) == 0:
        write_found(batch.lines, paths.place, color, movemask8(chosen))
        return Taken(left, rays)

    # Choose where to go on, and whether to.
    own = nested8(paths.draws, event)
    way, choice = pair8(own, WAY), Pair8(splat8d(0.0), splat8d(0.0))
    if i64_at(pieces, CHOOSES) != 0 or event >= i64_at(integrator, ROULETTE_DEPTH):
        choice = pair8(own, CHOICE)
    frame = frame_about8(spot.normal)
    wo = into8(frame, -paths.d)
    size = vmax8d(vmax8d(abs8d(spot.p.x), abs8d(spot.p.y)), abs8d(spot.p.z))
    t_min, material = vmax8d(spot.t, size) * 1e-9, gather8i(rows, offset + MATERIAL)
    here = Surface8(spot, piece, kind & (GLOWING - 1), material, t_min, frame, wo)
    next = sample_of_kinds(pieces, here, way, choice.u)
    d, beta = out_of8(frame, next.wi), paths.beta * next.weight
    odds = survival8(integrator, beta, event + 1)
    on = going & (choice.v < odds)
    if event >= i64_at(integrator, ROULETTE_DEPTH):
        beta = beta * (1.0 / odds)

    # Look for lights.
    count = i64_at(integrator, LIGHT_SAMPLES) if event == 0 else 1
    for k in range(count if light_count(world) > 0 else 0):
        lit = light8(world, pieces, here, one_of8(own, k, count), going)
        asked = count_bits(movemask8(lit.asked))
        if asked > 0:
            shade = blocked8(pieces, spot.p, lit.direction, lit.reach, piece, lit.target)
            bright = lit.asked & not8(surely_blocked(world, here, lit, shade))
            brought = limited8(integrator, paths.beta * lit.light, event + 1) * (1.0 / count)
            color = select8v(bright, color + brought, color)
            rays += asked

    write_found(batch.lines, paths.place, color, movemask8(chosen & not8(on)))
    keep_lines(lines, START + left, spot.p, on)
    keep_lines(lines, GOES + left, d, on)
    keep_lines(lines, BETA + left, beta, on)
    keep_lines(lines, COLOR + left, color, on)
    store_chosen8d(lines, DENSITY + left, next.density, on)
    store_chosen8d(lines, BEGIN + left, t_min, on)
    store_chosen8i(lines, ITS_KEY + left, paths.draws.key, on)
    store_chosen8i(lines, ITS_PIXEL + left, paths.draws.pixel, on)
    store_chosen8i(lines, ITS_SAMPLE + left, paths.draws.sample, on)
    store_chosen8i(lines, OWN + left, piece, on)
    store_chosen8i(lines, PLACE_IN_BATCH + left, paths.place, on)
    return Taken(left + count_bits(movemask8(on)), rays)


@kernel
def sample_of_kinds(pieces: Table, here: Surface8, way: Pair8, choice: F64x8) -> Sample8:
    """The materials' choices of directions: one class of materials after the other."""
    wi, weight, density = here.wo, grey8(0.0), splat8d(0.0)
    for k in range(i64_at(pieces, KIND_COUNT)):
        mine = here.kind == k
        if movemask8(mine) != 0:
            material = table_at(table_at(pieces, KINDS), k)
            found = sample_eight(material, rows_of(material, here.material, mine), here.wo, way.u, way.v, choice)
            wi, weight = select8v(mine, found.wi, wi), select8v(mine, found.weight, weight)
            density = select8d(mine, found.density, density)
    return Sample8(wi, weight, density)


@kernel
def bsdf_of_kinds(pieces: Table, here: Surface8, wi: Vec3x8) -> Value8:
    """What the materials make of light from one direction each."""
    value, density = grey8(0.0), splat8d(0.0)
    for k in range(i64_at(pieces, KIND_COUNT)):
        mine = here.kind == k
        if movemask8(mine) != 0:
            material = table_at(table_at(pieces, KINDS), k)
            found = bsdf_eight(material, rows_of(material, here.material, mine), here.wo, wi)
            value, density = select8v(mine, found.value, value), select8d(mine, found.density, density)
    return Value8(value, density)


@kernel
def rows_of(material: Table, address: I64x8, mine: Mask8) -> I64x8:
    """How many words it is from a material to others of its class, and 0 where they are of another."""
    return select8i(mine, (address >> 3) + words_to(material, 0), splat8i(0))


class Lit8(NamedTuple):
    """Light that may arrive, and is sent on."""

    light: Vec3x8  # what the surface makes of it, weighed
    direction: Vec3x8
    reach: F64x8  # up to where nothing may stand
    target: I64x8  # the piece that the light is, or -1
    asked: Mask8  # where it is worth a shadow ray


@kernel
def light8(world: Table, pieces: Table, here: Surface8, own: Draws8, going: Mask8) -> Lit8:
    """Choose a light and one of its points for eight surfaces; see `direct.look_for_light`."""
    place = pair8(own, PLACE)
    if light_count(world) == 1:
        sample = illuminate_eight(light_at(world, 0), here.spot.p, place.u, place.v)
        target = splat8i(i64_at(table_at(pieces, LIGHTS), 0))
    else:
        words = scratch(112)
        illuminate_by_chosen(world, here, pair8(own, LIGHT).u, place, words)
        sample = LightSample8(load8v(words, 0), load8d(words, 48), load8v(words, 24), load8d(words, 56))
        target = load8i(words, 64)
    answer = bsdf_of_kinds(pieces, here, into8(here.frame, sample.direction))
    q = sample.density
    weight = select8d(q > 0.0, q * q / (q * q + answer.density * answer.density), splat8d(1.0))
    light = answer.value * sample.irradiance * weight
    return Lit8(light, sample.direction, sample.distance - here.t_min, target, going & (brightest8(light) > 0.0))


@kernel
def limited8(integrator: Table, color: Vec3x8, turns: i64) -> Vec3x8:
    """`path.limited` for eight contributions."""
    most = f64_at(integrator, CLAMP)
    if most == most and turns > 1:
        return color * vmin8d(splat8d(1.0), most / vmax8d(brightest8(color), splat8d(1e-300)))
    return color


@kernel
def survival8(integrator: Table, beta: Vec3x8, event: i64) -> F64x8:
    """`path.survival` for eight walks."""
    brightest = brightest8(beta)
    if event <= i64_at(integrator, ROULETTE_DEPTH):
        return select8d(brightest > 0.0, splat8d(1.0), splat8d(0.0))
    return vmin8d(vmax8d(brightest, splat8d(0.0)), splat8d(1.0))


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
def surely_blocked(world: Table, here: Surface8, lit: Lit8, shade: Shade8) -> Mask8:
    """Which shadow rays are blocked: those of which the filter is not sure, exactly."""
    bits = movemask8(shade.unsure & lit.asked)
    if bits == 0:
        return shade.blocked
    words = scratch(64)
    store8v(words, 0, here.spot.p)
    store8v(words, 24, lit.direction)
    store8d(words, 48, here.t_min)
    store8d(words, 56, lit.reach)
    found = 0
    while bits != 0:
        k = lowest_bit(bits)
        bits &= bits - 1
        if is_blocked(world, lane_at(words, k), lane_at(words, 24 + k), f64_at(words, 48 + k), f64_at(words, 56 + k)):
            found |= 1 << k
    return shade.blocked | mask8(found)


@kernel
def with_skies(integrator: Table, world: Table, paths: Paths8, color: Vec3x8, missed: Mask8, event: i64) -> Vec3x8:
    """What paths have found, with what rays bring that meet nothing."""
    if i64_at(world, SKY_COUNT) > 0:
        return add_skies(integrator, world, paths, color, movemask8(missed), event)
    behind = paths.beta * splat8v(vec3_at(world, BACKGROUND))
    return select8v(missed, color + limited8(integrator, behind, event), color)


@kernel
def illuminate_by_chosen(world: Table, here: Surface8, which: F64x8, place: Pair8, words: Table) -> None:
    """One light for each surface and a point of it: direction, irradiance, distance, density and piece.

    Irradiance is divided by the probability of the choice, densities are multiplied by it.
    """
    mine, lights = scratch(88), table_at(table_at(world, PIECES), LIGHTS)
    store8v(mine, 0, here.spot.p)
    normal = here.spot.normal
    store8v(mine, 24, select8v(here.wo.z >= 0.0, normal, -normal))
    store8d(mine, 48, which)
    store8d(mine, 56, place.u)
    store8d(mine, 64, place.v)
    for k in range(8):
        p = lane_at(mine, k)
        choice = choose_light(world, p, lane_at(mine, 24 + k), f64_at(mine, 48 + k))
        put_lane(words, 24 + k, grey(0.0))
        if choice.light < 0:
            continue
        found = illuminate(light_at(world, choice.light), p, WHOLE, f64_at(mine, 56 + k), f64_at(mine, 64 + k))
        put_lane(words, k, found.direction)
        put_lane(words, 24 + k, found.irradiance * (1.0 / choice.probability))
        f64_put(words, 48 + k, found.distance)
        f64_put(words, 56 + k, found.density * choice.probability)
        i64_put(words, 64 + k, i64_at(lights, choice.light))


@kernel
def store_from(words: Table, world: Table, paths: Paths8) -> None:
    """Write where rays come from: point, direction, density, the normal there, and, 24 words later, the throughput."""
    rows, offset = table_at(table_at(world, PIECES), ROWS), some_piece(paths.own) * PIECE_WORDS
    normal = gather8v(rows, offset + NORMAL)
    normal = select8v(paths.own >= i64_at(table_at(world, PIECES), FLATS), paths.o - normal, normal)
    normal = normal * (sign8d(dot8(normal, paths.d)) / sqrt8d(dot8(normal, normal)))
    store8v(words, 0, paths.o)
    store8v(words, 24, paths.d)
    store8d(words, 48, paths.density)
    store8v(words, 56, normal)
    store8v(words, 104, paths.beta)


@kernel
def write_found(batch: Table, place: I64x8, color: Vec3x8, bits: i64) -> None:
    """Hand over what the paths in `bits`, which are at their end, have found."""
    words = scratch(32)
    store8v(words, 0, color)
    store8i(words, 24, place)
    while bits != 0:
        k = lowest_bit(bits)
        bits &= bits - 1
        at = FOUND + i64_at(words, 24 + k)
        f64_put(batch, at, f64_at(words, k))
        f64_put(batch, at + LINE, f64_at(words, 8 + k))
        f64_put(batch, at + 2 * LINE, f64_at(words, 16 + k))


@kernel
def add_skies(integrator: Table, world: Table, paths: Paths8, color: Vec3x8, bits: i64, event: i64) -> Vec3x8:
    """What the rays in `bits`, which meet nothing, bring."""
    words = scratch(128)
    store_from(words, world, paths)
    store8v(words, 80, color)
    while bits != 0:
        k = lowest_bit(bits)
        bits &= bits - 1
        light = light_of_skies(
            world, lane_at(words, k), lane_at(words, 56 + k), lane_at(words, 24 + k), f64_at(words, 48 + k), no_table()
        )  # fmt: skip
        put_lane(words, 80 + k, lane_at(words, 80 + k) + limited(integrator, lane_at(words, 104 + k) * light, event))
    return load8v(words, 80)


@kernel
def add_glow(
    integrator: Table, world: Table, pieces: Table, paths: Paths8, spot: Spot8, at: I64x8, color: Vec3x8, bits: i64,
    event: i64,
) -> Vec3x8:  # fmt: skip
    """What the surfaces in `bits` give off, weighed as `path.given_off` does."""
    words = scratch(176)
    store_from(words, world, paths)
    store8v(words, 80, color)
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
        light = lane_at(words, 104 + k) * glow * weight
        put_lane(words, 80 + k, lane_at(words, 80 + k) + limited(integrator, light, event))
    return load8v(words, 80)
