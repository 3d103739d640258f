"""The path tracer of the lecture's assignments, with a switch for each of its steps."""

from __future__ import annotations

import math

from sightray._jit import implements, kernel
from sightray.cameras.base import Ray
from sightray.fields import choice, flag, integer
from sightray.integrators.base import Integrator, Radiance, radiance
from sightray.integrators.direct import lit_normal
from sightray.integrators.nesting import outside
from sightray.integrators.searching import BRDF, COSINE, Search, behind, chance, density_of, from_lights
from sightray.integrators.shading import first_step, frame_of, into, on_true_side, out_of
from sightray.integrators.solid import closest_solid
from sightray.integrators.terminator import lifted
from sightray.materials.base import BsdfSample, bsdf, emitted, sample_bsdf
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, i64_at, no_table
from sightray.mathlib.vec import Vec3, grey, max3
from sightray.mathlib.warp import power_cosine
from sightray.samplers.base import Draws, nested, pair
from sightray.scene.world import Point, on_seen_side, point_of, sight_beam

NEXT_EVENT = ("on", "off", "mis")  # as LIGHT, MATERIAL and BOTH of integrators/searching.py
DIRECTIONS = ("hemisphere", "cosine", "brdf")  # at its indices HEMISPHERE, COSINE, BRDF
ENDLESS = 100_000  # bounces of a walk without a bound: between perfect mirrors it has to end somewhere


class CoursePathTracer(Integrator):
    """Path tracing step by step: the same picture by each combination of switches, with less and less noise.

    Walks look for lights at each step (`next_event_estimation` "on"), or only meet them by chance ("off"), or do both
    with the weights of the power heuristic ("mis"; E. Veach, L. Guibas, SIGGRAPH 1995). They go on in a direction that
    is chosen evenly over the hemisphere, by its cosine, or as the material reflects (`importance_sampling`). With
    `russian_roulette` they end with the probability 1 - max(r, g, b) of what they still weigh (J. Arvo, D. Kirk,
    SIGGRAPH 1990).

    Point lights are never met, so they are looked for whatever is chosen. Mirrors and glass have no value in directions
    that are not their own: they are black unless `importance_sampling` is "brdf". For pictures, and scenes with media, take
    `PathTracer`.
    """

    next_event_estimation: str = choice("whether lights are looked for", NEXT_EVENT, default="off")
    importance_sampling: str = choice("how directions are chosen", DIRECTIONS, default="hemisphere")
    russian_roulette: bool = flag("whether walks end by chance", default=False)
    light_samples: int = integer("shadow rays to each cell of a light", default=1, at_least=1, at_most=1 << 16)
    max_depth: int = integer("bounces after the ray of sight; -1 for no bound", default=5, at_least=-1, at_most=1000)


NEE, IMPORTANCE, ROULETTE, LIGHT_SAMPLES, DEPTH = CoursePathTracer.offsets()
WAY, CHOICE = 0, 1  # dimensions of a bounce's draws, before those of searching.py


@implements(radiance, CoursePathTracer)
def course_path_radiance(integrator: Table, world: Table, ray: Ray, draws: Draws) -> Radiance:
    search = Search(i64_at(integrator, NEE), i64_at(integrator, IMPORTANCE), i64_at(integrator, LIGHT_SAMPLES), True)
    bound = i64_at(integrator, DEPTH) if i64_at(integrator, DEPTH) >= 0 else ENDLESS
    o, d = ray.origin, ray.direction
    color, beta = grey(0.0), grey(1.0)  # beta: path throughput
    start, n, density, t_min = o, grey(0.0), 0.0, 0.0
    rays = 0
    for depth in range(bound + 1):
        # Take the light of the nearest surface, as far as it is left to chance.
        rays += 1
        hit = closest_solid(world, o, d, t_min, math.inf)
        if hit.item < 0:
            color += beta * behind(search, world, start, n, d, density)
            break
        point = on_seen_side(point_of(world, hit, o, d, sight_beam(world, draws, no_table())), d)
        own_light = emitted(point.material, point.where, point.cos_view)
        if max3(own_light) > 0.0:
            color += beta * own_light * chance(search, world, point.light, start, n, d, hit.t, density)
        if depth == bound:
            break

        # Look for lights.
        own = nested(draws, depth)
        frame = frame_of(point)
        wo = into(frame, -d)
        t_min = first_step(math.nan, point.p, hit.t)
        lit = from_lights(search, world, point, lifted(world, hit, point), frame, wo, t_min, outside(world), own)
        color += beta * lit.color
        rays += lit.rays

        # Choose a direction, and whether the walk ends.
        way, other = pair(own, WAY), pair(own, CHOICE)
        chosen = direction_of(search, point, wo, way.u, way.v, other.u)
        beta = beta * chosen.weight
        odds = min(1.0, max3(beta)) if i64_at(integrator, ROULETTE) != 0 else 1.0
        if max3(beta) <= 0.0 or other.v >= odds:
            break
        beta = beta / odds
        d = on_true_side(point, d, out_of(frame, chosen.wi), wo.z * chosen.wi.z < 0.0)
        o, start, n, density = point.p, point.p, lit_normal(point), chosen.density
    return Radiance(color, rays)


@kernel
def direction_of(search: Search, point: Point, wo: Vec3, u: f64, v: f64, choice: f64) -> BsdfSample:
    """A direction to go on in, by the chosen kind of importance sampling."""
    if search.directions == BRDF:
        return sample_bsdf(point.material, point.where, wo, u, v, choice)
    wi = power_cosine(1.0 if search.directions == COSINE else 0.0, u, v)
    wi = wi if wo.z >= 0.0 else -wi
    density = density_of(search, wi, 0.0)
    if density <= 0.0:
        return BsdfSample(wi, grey(0.0), 1.0)
    return BsdfSample(wi, bsdf(point.material, point.where, wo, wi).value / density, density)
