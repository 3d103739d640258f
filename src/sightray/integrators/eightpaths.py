"""The walks of `path`, eight side by side: what is the same in rooms of few pieces and in scenes with trees.

A path waits: for one result after the other, and for branches that were guessed wrong. Eight paths in the lanes of the same
registers wait together. So a batch of paths is followed surface by surface; those that end make room, and the others move
up. The same random numbers decide the same things as in `path.walk`, so a path is the same but for rounding. What is
rare, or has no form for eight paths, is asked lane by lane.

What a step needs of the scene is answered in two ways: `eightpieces` where a few surfaces are all met, `eighttrees`
otherwise.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.integrators.base import FOUND, KEY, LINE, ORIGIN, PIXEL, SAMPLE, Batch
from sightray.integrators.base import WAY as WAY_OUT
from sightray.integrators.direct import LIGHT, PLACE
from sightray.integrators.path import CHOICE, CLAMP, ROULETTE_DEPTH, WAY
from sightray.lights.base import WHOLE, LightSample8, density_eight, illuminate, illuminate_eight, sky_eight
from sightray.materials.base import Sample8, Value8, bsdf_eight, sample_eight
from sightray.mathlib.eight_paths import (
    Frame8,
    brightest8,
    grey8,
    lane_at,
    lines_at,
    load8v,
    put_lane,
    put_lines,
    store8v,
)
from sightray.mathlib.eights import (
    F64x8,
    I64x8,
    Vec3x8,
    load8d,
    load8i,
    select8d,
    select8i,
    select8v,
    splat8d,
    splat8i,
    splat8v,
    store8d,
    store8i,
    store_chosen8d,
    store_chosen8i,
    vmax8d,
    vmin8d,
)
from sightray.mathlib.lanes import Mask8, lowest_bit, movemask8
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import (
    Table,
    f64_at,
    f64_put,
    i64_at,
    i64_put,
    scratch,
    table_at,
    vec3_at,
    words_to,
)
from sightray.mathlib.vec import Vec3, grey
from sightray.samplers.base import Draws8, Pair8, pair8
from sightray.scene.kinds import CHOOSES, COUNT, ROWS, kinds_of
from sightray.scene.light_choice import choose_light, light_probability
from sightray.scene.world import BACKGROUND, SKIES, SKY_COUNT, light_at, light_count

# What is known of a path: where its next ray begins and goes, its throughput, what it has found, the density of the
# direction, from where on the ray counts, its random numbers, and which of the batch it is; then come lines of the caller's.
START, GOES, BETA, COLOR = 0, 3 * LINE, 6 * LINE, 9 * LINE
DENSITY, BEGIN, ITS_KEY, ITS_PIXEL, ITS_SAMPLE, PLACE_IN_BATCH, MORE = (k * LINE for k in range(12, 19))


class Paths8(NamedTuple):
    """Eight paths before their next ray."""

    o: Vec3x8
    d: Vec3x8
    beta: Vec3x8
    found: Vec3x8
    density: F64x8
    t_min: F64x8
    place: I64x8
    draws: Draws8


class Taken(NamedTuple):
    """After a step."""

    left: i64  # paths that go on
    rays: i64


class Surface8(NamedTuple):
    """What eight rays have met."""

    p: Vec3x8
    lit: Vec3x8  # see `direct.lit_normal`
    kind: I64x8  # classes of materials; negative where none is to be asked
    material: I64x8  # addresses of their rows
    t_min: F64x8  # for rays that leave from there
    frame: Frame8
    wo: Vec3x8


class Lamp8(NamedTuple):
    """One point of one light for each of eight surfaces."""

    sample: LightSample8
    number: I64x8  # of the light


class Lit8(NamedTuple):
    """Light that may arrive, and is sent on."""

    light: Vec3x8  # what the surface makes of it, weighed
    asked: Mask8  # where it is worth a shadow ray


class Way8(NamedTuple):
    """Numbers by which paths choose where to go on, and whether to."""

    turn: Pair8
    choice: Pair8


class Onward8(NamedTuple):
    """How eight paths go on."""

    next: Sample8  # in the surfaces' frames
    beta: Vec3x8
    on: Mask8  # who goes on


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
    for i in range(k, k + 8):
        i64_put(paths, PLACE_IN_BATCH + i, i)


@kernel
def load_paths(paths: Table, k: i64, batch: Batch) -> Paths8:
    """Eight paths, from number k on, whether they are there or not."""
    draws = Draws8(
        batch.sampler, load8i(paths, ITS_PIXEL + k), load8i(paths, ITS_KEY + k), load8i(paths, ITS_SAMPLE + k),
        batch.samples, batch.dimension,
    )  # fmt: skip
    return Paths8(
        lines_at(paths, START + k, LINE), lines_at(paths, GOES + k, LINE), lines_at(paths, BETA + k, LINE),
        lines_at(paths, COLOR + k, LINE), load8d(paths, DENSITY + k), load8d(paths, BEGIN + k),
        load8i(paths, PLACE_IN_BATCH + k), draws,
    )  # fmt: skip


@kernel
def keep_paths(
    lines: Table, left: i64, paths: Paths8, p: Vec3x8, d: Vec3x8, onward: Onward8, color: Vec3x8, t_min: F64x8
) -> None:
    """Write the paths that go on, from the points p in directions d, as numbers `left` and up."""
    on = onward.on
    keep_lines(lines, START + left, p, on)
    keep_lines(lines, GOES + left, d, on)
    keep_lines(lines, BETA + left, onward.beta, on)
    keep_lines(lines, COLOR + left, color, on)
    store_chosen8d(lines, DENSITY + left, onward.next.density, on)
    store_chosen8d(lines, BEGIN + left, t_min, on)
    store_chosen8i(lines, ITS_KEY + left, paths.draws.key, on)
    store_chosen8i(lines, ITS_PIXEL + left, paths.draws.pixel, on)
    store_chosen8i(lines, ITS_SAMPLE + left, paths.draws.sample, on)
    store_chosen8i(lines, PLACE_IN_BATCH + left, paths.place, on)


@kernel
def keep_lines(paths: Table, index: i64, a: Vec3x8, chosen: Mask8) -> None:
    """Write the chosen of eight vectors."""
    store_chosen8d(paths, index, a.x, chosen)
    store_chosen8d(paths, index + LINE, a.y, chosen)
    store_chosen8d(paths, index + 2 * LINE, a.z, chosen)


@kernel
def way8(integrator: Table, world: Table, own: Draws8, event: i64) -> Way8:
    """Draw the numbers by which paths go on; those that nobody asks for are 0."""
    turn, choice = pair8(own, WAY), Pair8(splat8d(0.0), splat8d(0.0))
    if i64_at(kinds_of(world), CHOOSES) != 0 or event >= i64_at(integrator, ROULETTE_DEPTH):
        choice = pair8(own, CHOICE)
    return Way8(turn, choice)


@kernel
def go_on8(integrator: Table, next: Sample8, way: Way8, beta: Vec3x8, going: Mask8, event: i64) -> Onward8:
    """Decide which paths go on to `next`."""
    beta = beta * next.weight
    odds = survival8(integrator, beta, event + 1)
    if event >= i64_at(integrator, ROULETTE_DEPTH):
        beta = beta * (1.0 / odds)
    return Onward8(next, beta, going & (way.choice.v < odds))


@kernel
def sample_of_kinds(kinds: Table, here: Surface8, way: Way8) -> Sample8:
    """The materials' choices of directions: one class of materials after the other."""
    wi, weight, density = here.wo, grey8(0.0), splat8d(0.0)
    for k in range(i64_at(kinds, COUNT)):
        mine = here.kind == k
        if movemask8(mine) != 0:
            material = table_at(table_at(kinds, ROWS), k)
            rows = rows_of(material, here.material, mine)
            found = sample_eight(material, rows, here.wo, way.turn.u, way.turn.v, way.choice.u)
            wi, weight = select8v(mine, found.wi, wi), select8v(mine, found.weight, weight)
            density = select8d(mine, found.density, density)
    return Sample8(wi, weight, density)


@kernel
def bsdf_of_kinds(kinds: Table, here: Surface8, wi: Vec3x8) -> Value8:
    """What the materials make of light from one direction each."""
    value, density = grey8(0.0), splat8d(0.0)
    for k in range(i64_at(kinds, COUNT)):
        mine = here.kind == k
        if movemask8(mine) != 0:
            material = table_at(table_at(kinds, ROWS), k)
            found = bsdf_eight(material, rows_of(material, here.material, mine), here.wo, wi)
            value, density = select8v(mine, found.value, value), select8d(mine, found.density, density)
    return Value8(value, density)


@kernel
def rows_of(material: Table, address: I64x8, mine: Mask8) -> I64x8:
    """How many words it is from a material to others of its class, and 0 where they are of another."""
    return select8i(mine, (address >> 3) + words_to(material, 0), splat8i(0))


@kernel
def lamp8(world: Table, here: Surface8, own: Draws8, going: Mask8) -> Lamp8:
    """Choose a light and one of its points for eight surfaces; see `direct.look_for_light`."""
    place = pair8(own, PLACE)
    if light_count(world) == 1:
        return Lamp8(illuminate_eight(light_at(world, 0), here.p, place.u, place.v), splat8i(0))
    words = scratch(72)
    illuminate_by_chosen(world, here, pair8(own, LIGHT).u, place, words, movemask8(going))
    sample = LightSample8(load8v(words, 0), load8d(words, 48), load8v(words, 24), load8d(words, 56))
    return Lamp8(sample, load8i(words, 64))


@kernel
def lit_by8(here: Surface8, lamp: Lamp8, answer: Value8, going: Mask8) -> Lit8:
    """What surfaces make of the light of lamps, if it arrives, by their materials' answers."""
    q = lamp.sample.density
    weight = select8d(q > 0.0, q * q / (q * q + answer.density * answer.density), splat8d(1.0))
    light = answer.value * lamp.sample.irradiance * weight
    return Lit8(light, going & (brightest8(light) > 0.0))


@kernel
def illuminate_by_chosen(world: Table, here: Surface8, which: F64x8, place: Pair8, words: Table, bits: i64) -> None:
    """One light for each surface in `bits` and a point of it: direction, irradiance, distance, density and its number.

    Irradiance is divided by the probability of the choice, densities are multiplied by it.
    """
    mine = scratch(72)
    store8v(mine, 0, here.p)
    store8v(mine, 24, here.lit)
    store8d(mine, 48, which)
    store8d(mine, 56, place.u)
    store8d(mine, 64, place.v)
    store8v(words, 24, grey8(0.0))
    store8i(words, 64, splat8i(0))
    while bits != 0:
        k = lowest_bit(bits)
        bits &= bits - 1
        p = lane_at(mine, k)
        choice = choose_light(world, p, lane_at(mine, 24 + k), f64_at(mine, 48 + k))
        if choice.light < 0:
            continue
        found = illuminate(light_at(world, choice.light), p, WHOLE, f64_at(mine, 56 + k), f64_at(mine, 64 + k))
        put_lane(words, k, found.direction)
        put_lane(words, 24 + k, found.irradiance * (1.0 / choice.probability))
        f64_put(words, 48 + k, found.distance)
        f64_put(words, 56 + k, found.density * choice.probability)
        i64_put(words, 64 + k, choice.light)


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


class Sent8(NamedTuple):
    """Rays of eight paths: from where, the normal there (see `direct.lit_normal`), where to, density and throughput."""

    o: Vec3x8
    lit: Vec3x8
    d: Vec3x8
    density: F64x8
    beta: Vec3x8


@kernel
def with_skies(integrator: Table, world: Table, sent: Sent8, color: Vec3x8, missed: Mask8, event: i64) -> Vec3x8:
    """What paths have found, with what rays bring that meet nothing; see `direct.light_of_skies`."""
    behind = splat8v(vec3_at(world, BACKGROUND))
    d = select8v(missed, sent.d, splat8v(Vec3(0.0, 1.0, 0.0)))  # other lanes may hold anything
    for k in range(i64_at(world, SKY_COUNT)):
        index = i64_at(table_at(world, SKIES), k)
        light = light_at(world, index)
        chance = light_probability(world, grey(0.0), grey(0.0), index)  # skies stand apart: it is the same everywhere
        p, q = sent.density, density_eight(light, sent.o, d, splat8d(math.inf)) * chance
        found_by_both = (p > 0.0) & (q > 0.0)
        weight = select8d(found_by_both, p * p / (p * p + q * q), splat8d(1.0))
        behind = behind + sky_eight(light, d) * weight
    return select8v(missed, color + limited8(integrator, sent.beta * behind, event), color)


@kernel
def store_sent(words: Table, sent: Sent8) -> None:
    """Write where rays come from: point, direction, density, the normal there, throughput; 104 words."""
    store8v(words, 0, sent.o)
    store8v(words, 24, sent.d)
    store8d(words, 48, sent.density)
    store8v(words, 56, sent.lit)
    store8v(words, 80, sent.beta)


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
