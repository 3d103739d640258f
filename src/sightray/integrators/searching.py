"""Lights that are looked for, and lights that are met by chance: who counts how much."""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.integrators.base import Radiance
from sightray.integrators.direct import lit_normal, power_heuristic, unblocked
from sightray.integrators.nesting import Nest, crossing
from sightray.integrators.shading import Frame, into
from sightray.integrators.terminator import shadow_ray
from sightray.lights.base import cells, direction_density, illuminate, sky
from sightray.materials.base import bsdf
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, i64_at, no_table, table_at, vec3_at
from sightray.mathlib.vec import Vec3, grey, max3
from sightray.samplers.base import Draws, pair
from sightray.scene.light_choice import Choice, choose_light, light_probability
from sightray.scene.world import BACKGROUND, SKIES, SKY_COUNT, Point, light_at, light_count

LIGHT, MATERIAL, BOTH = 0, 1, 2  # which samples are taken: of lights, of directions, of both with weights
HEMISPHERE, COSINE, BRDF = 0, 1, 2  # how directions are sampled: evenly, by their cosine, as the material does
WHICH, PLACE = 2, 3  # dimensions of a bounce's draws; every shadow ray takes one from PLACE on


class Search(NamedTuple):
    """How light is searched for.

    What one strategy cannot find (a point light by chance, the mirror image of a light by looking for it) is always
    left to the other, so all strategies have the same expectation.
    """

    strategy: i64  # LIGHT, MATERIAL or BOTH
    directions: i64  # HEMISPHERE, COSINE or BRDF
    light_samples: i64  # to each cell of a light
    every: bool  # all lights, instead of one by chance


@kernel
def from_lights(
    search: Search, world: Table, point: Point, start: Vec3, frame: Frame, wo: Vec3, t_min: f64, nest: Nest, own: Draws
) -> Radiance:
    """Light that is found by looking for it: from all lights, or from one over the probability of that choice.

    `start` is where shadow rays begin on the side that is seen; `terminator.lifted` says where that is.
    """
    color = grey(0.0)
    rays = dimension = 0
    for k in range(light_count(world) if search.every else min(1, light_count(world))):
        chosen = Choice(k, 1.0)
        if not search.every:
            chosen = choose_light(world, point.p, lit_normal(point), pair(own, WHICH).u)
        light = light_at(world, chosen.light)
        parts, repeats = cells(light), search.light_samples
        for index in range(parts * repeats):
            place = pair(own, PLACE + dimension)
            dimension += 1
            sample = illuminate(light, point.p, index % parts, place.u, place.v)
            wi = into(frame, sample.direction)
            answer = bsdf(point.material, point.where, wo, wi)
            p = sample.density * chosen.probability
            q = density_of(search, wi, answer.density)
            found = answer.value * sample.irradiance * looked_for(search, parts * repeats * p, q)
            if max3(found) > 0.0:
                rays += 1
                through = wo.z * wi.z < 0.0
                ahead = crossing(world, nest, point, sample.direction) if through else nest
                ray = shadow_ray(point.p if through else start, point.p, sample.direction, sample.distance)
                left = unblocked(world, ray.o, ray.d, t_min, ray.distance - t_min, ahead, no_table(), own)
                color += found * left / (repeats * chosen.probability)
    return Radiance(color, rays)


@kernel
def looked_for(search: Search, p: f64, q: f64) -> f64:
    """Weight of light that was looked for with density p, where the material's is q; p is 0 if chance never meets it."""
    if p <= 0.0 or search.strategy == LIGHT:
        return 1.0
    return 0.0 if search.strategy == MATERIAL else power_heuristic(p, q)


@kernel
def chance(search: Search, world: Table, light: i64, p: Vec3, n: Vec3, d: Vec3, distance: f64, density: f64) -> f64:
    """Weight of light that a ray from p met by chance: 1 unless looking for lights could have found it too."""
    if light < 0 or density <= 0.0 or search.strategy == MATERIAL:
        return 1.0
    row = light_at(world, light)
    q = direction_density(row, p, d, distance)
    if q <= 0.0:
        return 1.0
    if search.strategy == LIGHT:
        return 0.0
    share = 1.0 if search.every else light_probability(world, p, n, light)
    return power_heuristic(density, cells(row) * search.light_samples * q * share)


@kernel
def behind(search: Search, world: Table, p: Vec3, n: Vec3, d: Vec3, density: f64) -> Vec3:
    """Radiance where a ray from p meets nothing, as far as it is left to chance."""
    color = vec3_at(world, BACKGROUND)
    for k in range(i64_at(world, SKY_COUNT)):
        light = i64_at(table_at(world, SKIES), k)
        color += sky(light_at(world, light), d) * chance(search, world, light, p, n, d, math.inf, density)
    return color


@kernel
def density_of(search: Search, wi: Vec3, density: f64) -> f64:
    """With which density directions are sampled; `density` is that of the material."""
    if search.directions == BRDF:
        return density
    return abs(wi.z) / math.pi if search.directions == COSINE else 0.5 / math.pi
