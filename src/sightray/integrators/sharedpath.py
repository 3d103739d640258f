"""Path tracing in which neighbouring pixels share what their paths find behind the first surface."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from sightray._jit import implements, kernel
from sightray.accelerators.item import ItemHit
from sightray.fields import integer
from sightray.integrators.base import COLOR, SO_FAR, Integrator, Radiance, draws_in, radiance_of_group, ray_in, sight_of
from sightray.integrators.direct import direct_light, lit_normal, look_for_light
from sightray.integrators.nesting import crossing, outside
from sightray.integrators.path import (
    CHOICE,
    DEPTH,
    LIGHT_SAMPLES,
    MOST_EVENTS,
    WAY,
    PathTracer,
    Step,
    from_eye,
    given_off,
    limited,
    onward,
    sent_back,
    survival,
    walk,
)
from sightray.integrators.shading import Frame, first_step, frame_of, into, on_true_side, out_of
from sightray.integrators.terminator import lifted
from sightray.materials.base import BsdfSample, BsdfValue, bsdf, sample_bsdf
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import (
    Table,
    advance,
    f64_at,
    f64_put,
    i64_at,
    i64_put,
    is_null,
    no_table,
    scratch,
    table_at,
    table_put,
    vec3_at,
    vec3_put,
)
from sightray.mathlib.vec import Vec3, dot, grey, length, max4
from sightray.samplers.base import Draws, nested, one_of, pair
from sightray.scene.world import Beam, Point, find_closest, is_blocked, light_count, on_seen_side, point_of
from sightray.textures.base import Where


class SharedPathTracer(PathTracer):
    """`PathTracer` with squares of `share` by `share` pixels that use one another's paths: less noise for the same time.

    Light that comes over other surfaces is most of the noise of a room. The path of a pixel goes from the first matte
    surface that it sees, at x, on to a point y, and finds out what light comes from there. The neighbours see nearly
    the same x; so each of them looks at the y of all, with a ray to see that nothing stands between, and takes the
    light that y sends to its own x. Every y counts by its density over the sum of the densities with which each of the
    pixels would have found it, so the mean is right in any scene (P. Bekaert, M. Sbert, J. Halton, "Accelerating path
    tracing by re-using paths", Eurographics Workshop on Rendering 2002; the weights are the balance heuristic of
    E. Veach, L. Guibas, SIGGRAPH 1995). If y is on a mirror or on glass, the neighbours follow what they see in it by
    the same random numbers, where that led to a light: so caustics are shared, too (random replay: D. Lin et al.,
    "Generalized resampled importance sampling", SIGGRAPH 2022).

    The squares, or lattices of every second pixel, lie elsewhere for each sample. Noise of neighbouring pixels is alike,
    which denoisers do not expect. Pixels whose rays have different times (shutters) or wavelengths (`spectral`), or are in
    a medium, share nothing.
    """

    share: int = integer(
        "pixels to a side of the squares that share paths; 1: none do", default=6, at_least=1, at_most=8
    )

    def for_batches(self, compiled: Any) -> Integrator | None:
        return None

    @property
    def together(self) -> int:
        return 1 if self.spectral else self.share


NARROW = 2.0  # density, per steradian, from which on a surface is too shiny for neighbours to see the same in it
# Light behind y is shared if it would make the sample that many times as bright as the pixel: sharing the rest costs
# more than it brings. What is seen in mirrors has to be followed by every pixel, so only bright dots are worth it.
WORTHY, WORTHY_MIRRORED = 0.5, 8.0
CLOSE = 1e-6  # a ray that was sent to a point met it if it did so within this share of the distance

# Words of a vertex: its place, geometric normal on the side that is seen, frame, and material.
PLACE, NORMAL, FRAME, MATERIAL, U, V, WIDTH, WITHIN, INNER_NORMAL = 0, 4, 8, 20, 21, 22, 23, 24, 28
KIND, BOUNCES, STEP = 32, 33, 34  # what is noted here; bounces before x; where rays from here begin
# Of x: the viewer in its frame, path throughput, normal for looking for lights, and beam.
VIEWER, BETA, LIT_NORMAL, BEAM_WIDTH, BEAM_SPREAD, TURNS, LEAST = 36, 40, 44, 48, 49, 50, 51
# Of y: where from the light of a lamp arrives and how much, and the same of the walk that went on; and rays before y.
LAMP, LIT, ONWARD, FOUND, EVENTS = 36, 40, 44, 48, 35
VERTEX_WORDS = 52
NOTHING, MATTE, MIRRORING = 0, 1, 2


class Turn(NamedTuple):
    """A surface that a walk has come to, and how it goes on."""

    point: Point
    frame: Frame
    wo: Vec3
    own: Draws
    t_min: f64
    glow: Vec3  # what the surface gives off itself, weighed
    chosen: BsdfSample
    choice: f64  # number that decides whether the walk goes on
    d: Vec3
    direct: bool  # whether it goes on just where the material said, on the side where it came from


@implements(radiance_of_group, SharedPathTracer)
def share_paths(integrator: Table, world: Table, sights: Table, count: i64) -> i64:
    """Follow the path of each ray; then let all take what each has found."""
    firsts, seconds = scratch(3328), scratch(3328)  # 64 vertices each
    rays = 0
    for k in range(count):
        rays += follow(integrator, world, sight_of(sights, k), vertex(firsts, k), vertex(seconds, k))
    for k in range(count):
        kind = i64_at(vertex(seconds, k), KIND)
        if kind == MATTE:
            rays += share_matte(integrator, world, sights, firsts, vertex(seconds, k), k, count)
        elif kind == MIRRORING:
            rays += share_mirrored(integrator, world, sights, firsts, vertex(seconds, k), k, count)
    return rays


@kernel
def vertex(vertices: Table, k: i64) -> Table:
    """The words of vertex k."""
    return advance(vertices, k * VERTEX_WORDS)


@kernel
def turn_at(world: Table, hit: ItemHit, at: Step, draws: Draws) -> Turn:
    """What a walk that has paused finds at the surface before it, and a direction to go on."""
    x = on_seen_side(point_of(world, hit, at.o, at.d, at.beam), at.d)
    frame = frame_of(x)
    wo = into(frame, -at.d)
    own = nested(draws, at.event)
    light = given_off(world, x, at.start, at.n, at.d, at.gone + hit.t, at.density, at.beam.bands)
    way, choice = pair(own, WAY), pair(own, CHOICE)
    chosen = sample_bsdf(x.material, x.where, wo, way.u, way.v, choice.u)
    passes = wo.z * chosen.wi.z < 0.0
    straight = out_of(frame, chosen.wi)
    d = on_true_side(x, at.d, straight, passes)
    bend = d - straight
    direct = chosen.density > 0.0 and not passes and not dot(bend, bend) > 0.0
    t_min = first_step(math.nan, x.p, hit.t)
    return Turn(x, frame, wo, own, t_min, light, chosen, choice.v, d, direct)


@kernel
def ahead_of(world: Table, hit: ItemHit, at: Step, turn: Turn, beta: Vec3) -> Step:
    """The step with which a walk goes on after a turn."""
    x = turn.point
    passes = turn.wo.z * turn.chosen.wi.z < 0.0
    nest = crossing(world, at.nest, x, turn.d) if passes else at.nest
    return Step(
        x.p, turn.d, beta, nest, onward(at.beam, hit.t, turn.chosen.density), x.p, lit_normal(x), turn.chosen.density,
        0.0, turn.t_min, at.depth + 1, at.turns + 1, at.event + 1,
    )  # fmt: skip


@kernel
def follow(integrator: Table, world: Table, sight: Table, first: Table, second: Table) -> i64:
    """Trace the path of one ray; note x and y for others to use, and write down the light that they do not see."""
    i64_put(first, KIND, NOTHING)
    i64_put(second, KIND, NOTHING)
    draws = draws_in(sight)
    seen = walk(integrator, world, from_eye(world, ray_in(sight), draws, no_table()), draws, MOST_EVENTS)
    vec3_put(sight, COLOR, seen.color)
    if seen.hit.item < 0:
        return seen.rays

    # At x, look for a light; then go on from there.
    at, rays, color = seen.step, seen.rays + 1, seen.color
    x = turn_at(world, seen.hit, at, draws)
    color += limited(integrator, at.beta * x.glow, at.turns)
    if at.depth >= i64_at(integrator, DEPTH):
        vec3_put(sight, COLOR, color)
        return rays
    if light_count(world) > 0:
        lit_from, lights = lifted(world, seen.hit, x.point), i64_at(integrator, LIGHT_SAMPLES)
        for k in range(lights):
            own = one_of(x.own, k, lights)
            found = direct_light(world, x.point, lit_from, x.frame, x.wo, x.t_min, at.nest, no_table(), own)
            rays += found.rays
            color += limited(integrator, at.beta * found.color, at.turns + 1) * (1.0 / lights)
    weight = at.beta * x.chosen.weight
    if is_null(at.nest.here) and at.nest.depth == 0:
        note_surface(first, x.point, x.frame, at, x.t_min)
        note_first(first, x, at, seen.hit)
        enough = max(max4(color), f64_at(sight, SO_FAR))
        f64_put(first, LEAST, enough)
        if x.direct and max4(weight) > 0.0:
            found = go_on(
                integrator, world, ahead_of(world, seen.hit, at, x, grey(max4(weight))), weight, enough, draws, second
            )
            vec3_put(sight, COLOR, color + found.color)
            return rays + found.rays
    if max4(weight) > 0.0:
        alone = walk(integrator, world, ahead_of(world, seen.hit, at, x, weight), draws, 0)
        color += alone.color
        rays += alone.rays
    vec3_put(sight, COLOR, color)
    return rays


@kernel
def go_on(
    integrator: Table, world: Table, step: Step, weight: Vec3, enough: f64, draws: Draws, second: Table
) -> Radiance:
    """Go to y, and note it if others may go there, too; else its light, times `weight`."""
    met = walk(integrator, world, step, draws, step.event + 1)
    rays = met.rays
    if met.hit.item >= 0:
        y = turn_at(world, met.hit, met.step, draws)
        if sent_back(y.point) <= NARROW:
            return at_matte(integrator, world, met.hit, met.step, y, weight, enough, draws, second)
        met = walk(integrator, world, step, draws, 0)
        rays += met.rays
    color = weight * met.color * (1.0 / max4(weight))
    if met.events >= step.event + 2 and max4(color) > WORTHY_MIRRORED * enough:
        color = grey(0.0)
        hit = find_closest(world, step.o, step.d, step.t_min, math.inf)
        p = step.o + step.d * hit.t
        vec3_put(second, PLACE, Vec3(p.x, p.y, p.z, step.o.w))
        i64_put(second, KIND, MIRRORING)
        i64_put(second, BOUNCES, step.depth - 1)
        i64_put(second, EVENTS, step.event)
    return Radiance(color, rays)


@kernel
def at_matte(
    integrator: Table,
    world: Table,
    hit: ItemHit,
    at: Step,
    y: Turn,
    weight: Vec3,
    enough: f64,
    draws: Draws,
    second: Table,
) -> Radiance:
    """At a matte y, look for a light and go on; note from where how much light comes."""
    color, rays = limited(integrator, weight * y.glow, at.turns), 1
    if at.depth >= i64_at(integrator, DEPTH):
        return Radiance(color, rays)
    lamp, lit, went, seen = y.wo, grey(0.0), grey(0.0), grey(0.0)
    if light_count(world) > 0:
        lit_from = lifted(world, hit, y.point)
        coming = look_for_light(world, y.point, lit_from, y.frame, y.wo, y.t_min, at.nest, no_table(), y.own)
        rays += coming.rays
        lamp, lit, seen = coming.wi, coming.light, coming.value * coming.light

    # What the walk brings is noted as what it brings for each unit of `bsdf`.
    size = max4(weight * y.chosen.weight)
    odds = survival(integrator, grey(size), at.event + 1)
    if y.choice < odds:
        mirrored = y.chosen.density <= 0.0
        beta = weight * y.chosen.weight if mirrored else grey(size)
        found = walk(integrator, world, ahead_of(world, hit, at, y, beta * (1.0 / odds)), draws, 0)
        rays += found.rays
        if mirrored:
            color += found.color
        else:
            went = found.color * (1.0 / (size * y.chosen.density))
            seen += y.chosen.weight * found.color * (1.0 / size)
    if max4(weight * seen) <= WORTHY * enough:
        return Radiance(color + limited(integrator, weight * seen, at.turns + 1), rays)
    note_surface(second, y.point, y.frame, at, y.t_min)
    i64_put(second, KIND, MATTE)
    i64_put(second, BOUNCES, at.depth - 1)
    vec3_put(second, LAMP, lamp)
    vec3_put(second, LIT, lit)
    vec3_put(second, ONWARD, y.chosen.wi)
    vec3_put(second, FOUND, went)
    return Radiance(color, rays)


@kernel
def note_surface(row: Table, point: Point, frame: Frame, at: Step, t_min: f64) -> None:
    """Write what is needed to ask a surface later."""
    side = 1.0 if dot(point.normal, at.d) < 0.0 else -1.0
    vec3_put(row, PLACE, point.p)
    vec3_put(row, NORMAL, point.normal * side)
    vec3_put(row, FRAME, frame.s)
    vec3_put(row, FRAME + 4, frame.t)
    vec3_put(row, FRAME + 8, frame.n)
    table_put(row, MATERIAL, point.material)
    f64_put(row, U, point.where.u)
    f64_put(row, V, point.where.v)
    f64_put(row, WIDTH, point.where.width)
    vec3_put(row, WITHIN, point.where.p)
    vec3_put(row, INNER_NORMAL, point.where.normal)
    f64_put(row, STEP, t_min)


@kernel
def note_first(row: Table, x: Turn, at: Step, hit: ItemHit) -> None:
    """Write what is needed to look from x at what others have found."""
    i64_put(row, KIND, MATTE)
    i64_put(row, BOUNCES, at.depth)
    i64_put(row, TURNS, at.turns)
    vec3_put(row, VIEWER, x.wo)
    vec3_put(row, BETA, at.beta)
    vec3_put(row, LIT_NORMAL, lit_normal(x.point))
    f64_put(row, BEAM_WIDTH, at.beam.width + at.beam.spread * hit.t)
    f64_put(row, BEAM_SPREAD, at.beam.spread)


@kernel
def frame_in(row: Table) -> Frame:
    """The frame of a surface that was noted."""
    return Frame(vec3_at(row, FRAME), vec3_at(row, FRAME + 4), vec3_at(row, FRAME + 8))


@kernel
def answer_of(row: Table, wo: Vec3, wi: Vec3) -> BsdfValue:
    """What a surface that was noted makes of light from wi."""
    where = Where(
        f64_at(row, U), f64_at(row, V), vec3_at(row, WITHIN), vec3_at(row, INNER_NORMAL), f64_at(row, WIDTH), no_table()
    )
    return bsdf(table_at(row, MATERIAL), where, wo, wi)


class Sighting(NamedTuple):
    """y as seen from some x: what x would make of its light, and how far and in which direction it is."""

    answer: BsdfValue  # the density is 0 where a path from x could not have gone to y
    d: Vec3
    distance: f64


@kernel
def sighting(first: Table, second: Table) -> Sighting:
    """How x sees y, if nothing stands between."""
    x, y = vec3_at(first, PLACE), vec3_at(second, PLACE)
    way = y - x
    distance = length(way)
    none = Sighting(BsdfValue(grey(0.0), 0.0), way, distance)
    if i64_at(first, KIND) == NOTHING or i64_at(first, BOUNCES) != i64_at(second, BOUNCES) or x.w != y.w:
        return none
    if not distance > 0.0:
        return none
    d = way * (1.0 / distance)
    wo, wi = vec3_at(first, VIEWER), into(frame_in(first), d)
    if dot(vec3_at(first, NORMAL), d) <= 0.0 or wo.z * wi.z <= 0.0:
        return none
    return Sighting(answer_of(first, wo, wi), d, distance)


@kernel
def share_matte(
    integrator: Table, world: Table, sights: Table, firsts: Table, second: Table, finder: i64, count: i64
) -> i64:
    """Let every pixel that sees a matte y take the light there, over how likely all of them were to find it."""
    lit, found = vec3_at(second, LIT), vec3_at(second, FOUND)
    if max4(lit) <= 0.0 and max4(found) <= 0.0:
        return 0
    terms, likely, rays = scratch(256), 0.0, 0  # 64 terms
    frame, normal = frame_in(second), vec3_at(second, NORMAL)
    lamp, further = vec3_at(second, LAMP), vec3_at(second, ONWARD)
    for k in range(count):
        first = vertex(firsts, k)
        vec3_put(terms, 4 * k, grey(0.0))
        seen = sighting(first, second)
        cosine = -dot(normal, seen.d)
        if seen.answer.density <= 0.0 or cosine <= 0.0:
            continue
        wo = into(frame, -seen.d)
        light = answer_of(second, wo, lamp).value * lit
        if max4(found) > 0.0:
            light += answer_of(second, wo, further).value * found
        own = vec3_at(first, BETA) * seen.answer.value * light
        if max4(own) <= WORTHY * f64_at(first, LEAST) * seen.answer.density:
            continue
        if k != finder:
            rays += 1
            step = f64_at(first, STEP)
            end = seen.distance - max(step, f64_at(second, STEP))
            if is_blocked(world, vec3_at(first, PLACE), seen.d, step, end):
                continue
        turned = cosine / (seen.distance * seen.distance)  # steradians per square metre
        likely += seen.answer.density * turned
        vec3_put(terms, 4 * k, own * turned)
    share_out(integrator, sights, terms, likely, count)
    return rays


@kernel
def share_mirrored(
    integrator: Table, world: Table, sights: Table, firsts: Table, second: Table, finder: i64, count: i64
) -> i64:
    """Let every pixel follow what it sees in a mirror or glass at y, by the random numbers of the path that found it.

    Of all paths that these numbers give, only those that meet a light are shared; so only the pixels that would have
    met one could have found y.
    """
    draws = draws_in(sight_of(sights, finder))
    terms, likely, rays = scratch(512), 0.0, 0
    for k in range(count):
        first = vertex(firsts, k)
        vec3_put(terms, 4 * k, grey(0.0))
        seen = sighting(first, second)
        if seen.answer.density <= 0.0:
            continue
        step = towards(world, first, seen, i64_at(second, EVENTS))
        hit = find_closest(world, step.o, step.d, step.t_min, math.inf)
        rays += 1
        if abs(hit.t - seen.distance) > CLOSE * seen.distance:
            continue
        if max4(step.beta) <= 0.0:
            continue
        met = walk(integrator, world, step, draws, 0)
        rays += met.rays
        own = vec3_at(first, BETA) * seen.answer.value * met.color * (1.0 / max4(step.beta))
        if met.events >= step.event + 2 and max4(own) > WORTHY_MIRRORED * f64_at(first, LEAST) * seen.answer.density:
            point = point_of(world, hit, step.o, step.d, step.beam)
            turned = abs(dot(point.normal, seen.d)) / (seen.distance * seen.distance)
            likely += seen.answer.density * turned
            vec3_put(terms, 4 * k, own * turned)
    share_out(integrator, sights, terms, likely, count)
    return rays


@kernel
def towards(world: Table, first: Table, seen: Sighting, event: i64) -> Step:
    """The step of a walk from x to y."""
    x, density = vec3_at(first, PLACE), seen.answer.density
    size = max4(vec3_at(first, BETA) * seen.answer.value) / density
    beam = onward(Beam(f64_at(first, BEAM_WIDTH), f64_at(first, BEAM_SPREAD), no_table()), 0.0, density)
    return Step(
        x, seen.d, grey(size), outside(world), beam, x, vec3_at(first, LIT_NORMAL), density, 0.0, f64_at(first, STEP),
        i64_at(first, BOUNCES) + 1, i64_at(first, TURNS) + 1, event,
    )  # fmt: skip


@kernel
def share_out(integrator: Table, sights: Table, terms: Table, likely: f64, count: i64) -> None:
    """Add what the pixels see of y, each in its own weight, over the density with which y is found."""
    for k in range(count):
        light = vec3_at(terms, 4 * k)
        if max4(light) > 0.0:
            sight = sight_of(sights, k)
            vec3_put(sight, COLOR, vec3_at(sight, COLOR) + limited(integrator, light * (1.0 / likely), 2))
