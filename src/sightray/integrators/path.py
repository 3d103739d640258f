"""Path tracing with next-event estimation, multiple importance sampling and Russian roulette."""

from __future__ import annotations

import math

from sightray._jit import implements, kernel
from sightray.cameras.base import Ray
from sightray.fields import integer, number
from sightray.integrators.base import Integrator, Radiance, radiance
from sightray.integrators.shading import Frame, first_step, frame_of, into, out_of
from sightray.lights.base import cells, direction_density, illuminate
from sightray.materials.base import bsdf, emitted, interior, sample_bsdf
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, i64_at, is_null, no_table
from sightray.mathlib.vec import Vec3, grey, max3
from sightray.media.base import transmittance
from sightray.samplers.base import Draws, nested, pair
from sightray.scene.world import (
    Point,
    background,
    find_closest,
    is_blocked,
    light_at,
    light_count,
    on_seen_side,
    point_of,
    sight_beam,
)


class PathTracer(Integrator):
    """Estimates the rendering equation by random walks that look for lights at every step.

    At each surface one light is chosen and one point on it (next-event estimation), beside the direction in which the
    walk goes on. Where both could have found the same light, each counts with the weight p² / (p² + q²) of their
    densities p and q (E. Veach, L. Guibas, "Optimally combining sampling techniques for Monte Carlo rendering",
    SIGGRAPH 1995: the power heuristic). From `roulette_depth` on, a walk goes on with a probability that follows its
    weight (J. Arvo, D. Kirk, SIGGRAPH 1990). `SimplePathTracer` is the same without all that.
    """

    max_depth: int = integer("bounces after the ray of sight", default=8, at_least=0, at_most=1000)
    roulette_depth: int = integer("bounces before Russian roulette begins", default=4, at_least=0)
    clamp: float | None = number(
        "most that one walk may add after its first bounce, against fireflies; None for no bias", default=None, above=0,
        optional=True)  # fmt: skip


DEPTH, ROULETTE_DEPTH, CLAMP = PathTracer.offsets()

# Dimensions of a bounce's draws.
WAY, CHOICE, LIGHT, PLACE = 0, 1, 2, 3
LONGEST_ODDS = 0.95  # of going on in Russian roulette


@implements(radiance, PathTracer)
def path_radiance(integrator: Table, world: Table, ray: Ray, draws: Draws) -> Radiance:
    o, d = ray.origin, ray.direction
    color, beta = grey(0.0), grey(1.0)  # beta: path throughput
    density = 0.0  # with which the last direction was chosen; 0 for rays of sight and mirrors
    t_min = 0.0
    rays = 0
    depth = 0
    while True:
        # Take the light that the nearest surface gives off, unless looking for lights has taken it already.
        rays += 1
        hit = find_closest(world, o, d, t_min, math.inf)
        if hit.item < 0:
            color += limited(integrator, beta * background(world, d), depth)
            break
        point = on_seen_side(point_of(world, hit, o, d, sight_beam(world)), d)
        if point.cos_view < 0.0:
            inside = interior(point.material)
            if not is_null(inside):
                beta = beta * transmittance(inside, o, d, hit.t, no_table(), draws)
        own_light = emitted(point.material, point.where, point.cos_view)
        if max3(own_light) > 0.0:
            weight = chance_weight(world, point.light, o, d, hit.t, density)
            color += limited(integrator, beta * own_light * weight, depth)
        if depth >= i64_at(integrator, DEPTH):
            break

        # Look for a light.
        own = nested(draws, depth)
        frame = frame_of(point)
        wo = into(frame, -d)
        t_min = first_step(math.nan, point.p, hit.t)
        if light_count(world) > 0:
            direct = direct_light(world, point, frame, wo, t_min, own)
            rays += direct.rays
            color += limited(integrator, beta * direct.color, depth + 1)

        # Go on in a direction that the material chooses, or end the walk if it has become unimportant.
        way, choice = pair(own, WAY), pair(own, CHOICE)
        chosen = sample_bsdf(point.material, point.where, wo, way.u, way.v, choice.u)
        beta = beta * chosen.weight
        density = chosen.density
        odds = 1.0
        if depth >= i64_at(integrator, ROULETTE_DEPTH):
            odds = min(max3(beta), LONGEST_ODDS)
        if max3(beta) <= 0.0 or choice.v >= odds:
            break
        beta = beta / odds
        o, d = point.p, out_of(frame, chosen.wi)
        depth += 1
    return Radiance(color, rays)


@kernel
def direct_light(world: Table, point: Point, frame: Frame, wo: Vec3, t_min: f64, own: Draws) -> Radiance:
    """Light from one light, chosen evenly, at one of its points, over the probability of that choice."""
    count = light_count(world)
    which, place = pair(own, LIGHT), pair(own, PLACE)
    light = light_at(world, min(count - 1, int(which.u * count)))
    parts = cells(light)
    cell = min(parts - 1, int(which.v * parts))
    sample = illuminate(light, point.p, cell, place.u, place.v)
    answer = bsdf(point.material, point.where, wo, into(frame, sample.direction))
    found = answer.value * sample.irradiance * float(count * parts)
    if max3(found) <= 0.0:
        return Radiance(grey(0.0), 0)
    if is_blocked(world, point.p, sample.direction, t_min, sample.distance - t_min):
        return Radiance(grey(0.0), 1)
    p = direction_density(light, point.p, sample.direction, sample.distance) / count
    if p > 0.0:
        found = found * power_heuristic(p, answer.density)
    return Radiance(found, 1)


@kernel
def chance_weight(world: Table, light: i64, o: Vec3, d: Vec3, t: f64, density: f64) -> f64:
    """Weight of light that a ray met by chance: 1 unless next-event estimation could have found it too."""
    if light < 0 or density <= 0.0:
        return 1.0
    q = direction_density(light_at(world, light), o, d, t) / light_count(world)
    return power_heuristic(density, q)


@kernel
def power_heuristic(p: f64, q: f64) -> f64:
    """Weight of a sample chosen with density p, where another strategy has density q."""
    return p * p / (p * p + q * q)


@kernel
def limited(integrator: Table, color: Vec3, depth: i64) -> Vec3:
    """A contribution, scaled down to the clamp if one is set; what is seen directly is never touched."""
    most = f64_at(integrator, CLAMP)
    brightest = max3(color)
    if most == most and depth > 1 and brightest > most:
        return color * (most / brightest)
    return color
