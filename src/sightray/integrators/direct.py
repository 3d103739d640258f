"""Looking for lights: one light, one of its points, one shadow ray; and the weights where chance could find it too."""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.accelerators.item import CLEAR, TRANSLUCENT
from sightray.integrators.base import Radiance
from sightray.integrators.nesting import Nest, crossing
from sightray.integrators.shading import Frame, first_step, into
from sightray.integrators.terminator import shadow_ray
from sightray.lights.base import WHOLE, direction_density, illuminate, light_in, sky
from sightray.materials.base import bsdf
from sightray.mathlib.bands import as_light
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, i64_at, is_null, table_at, vec3_at
from sightray.mathlib.vec import Vec3, dot, grey, max4
from sightray.media.base import phase, transmittance
from sightray.samplers.base import Draws, nested, number, pair
from sightray.scene.light_choice import choose_light, light_probability
from sightray.scene.world import (
    BACKGROUND,
    FLAGS,
    SKIES,
    SKY_COUNT,
    Point,
    find_closest,
    is_blocked,
    light_at,
    light_count,
    point_of,
    thin_beam,
)

# Dimensions of a bounce's draws, and the number of the nested ones for media between here and the light.
LIGHT, PLACE, BETWEEN = 2, 3, 1
FAR = 1e30  # metres to what is infinitely far, for media: so that nothing times infinity is not met
PANES = 64  # boundaries of media that a shadow ray may pass


@kernel
def lit_normal(point: Point) -> Vec3:
    """The shading normal on the side that is seen, from behind which no light counts; zero where it does."""
    if point.flags & TRANSLUCENT != 0:
        return grey(0.0)
    return point.shading if point.cos_view >= 0.0 else -point.shading


@kernel
def which_light(world: Table, own: Draws) -> f64:
    """The number that chooses a light; none is drawn where there is no choice."""
    return number(own, LIGHT) if light_count(world) > 1 else 0.0


class Arriving(NamedTuple):
    """Light from one point of one light; a surface reflects `value * light` of it."""

    light: Vec3  # over the probability of the choice, times the weight that it has beside chance
    wi: Vec3  # where it comes from, in the surface's frame
    value: Vec3  # f(wo, wi) |cos wi|
    rays: i64


@kernel
def direct_light(
    world: Table, point: Point, start: Vec3, frame: Frame, wo: Vec3, t_min: f64, nest: Nest, bands: Table, own: Draws
) -> Radiance:
    """Light that a surface reflects from one light, at one of its points, over the probability of that choice."""
    found = look_for_light(world, point, start, frame, wo, t_min, nest, bands, own)
    return Radiance(found.value * found.light, found.rays)


@kernel
def look_for_light(
    world: Table, point: Point, start: Vec3, frame: Frame, wo: Vec3, t_min: f64, nest: Nest, bands: Table, own: Draws
) -> Arriving:
    """Choose a light and one of its points, and see what arrives from there."""
    place = pair(own, PLACE)
    dark = grey(0.0)
    chosen = choose_light(world, point.p, lit_normal(point), which_light(world, own))
    if chosen.light < 0:
        return Arriving(dark, dark, dark, 0)
    light = light_at(world, chosen.light)
    sample = illuminate(light, point.p, WHOLE, place.u, place.v)
    wi = into(frame, sample.direction)
    answer = bsdf(point.material, point.where, wo, wi)
    coming = light_in(bands, light, sample.irradiance) * (1.0 / chosen.probability)
    if max4(answer.value * coming) <= 0.0:
        return Arriving(dark, wi, dark, 0)
    behind = crossing(world, nest, point, sample.direction) if wo.z * wi.z < 0.0 else nest
    ray = shadow_ray(point.p if wo.z * wi.z < 0.0 else start, point.p, sample.direction, sample.distance)
    left = unblocked(world, ray.o, ray.d, t_min, ray.distance - t_min, behind, bands, own)
    if max4(left) <= 0.0:
        return Arriving(dark, wi, dark, 1)
    p = sample.density * chosen.probability
    weight = power_heuristic(p, answer.density) if p > 0.0 else 1.0
    return Arriving(coming * left * weight, wi, answer.value, 1)


@kernel
def direct_light_within(world: Table, p: Vec3, d: Vec3, nest: Nest, bands: Table, own: Draws) -> Radiance:
    """Light that the medium at p scatters from one light into the way back along d."""
    place = pair(own, PLACE)
    chosen = choose_light(world, p, grey(0.0), which_light(world, own))
    if chosen.light < 0:
        return Radiance(grey(0.0), 0)
    light = light_at(world, chosen.light)
    sample = illuminate(light, p, WHOLE, place.u, place.v)
    density = phase(nest.here, dot(d, sample.direction))
    found = light_in(bands, light, sample.irradiance) * (density / chosen.probability)
    if max4(found) <= 0.0:
        return Radiance(grey(0.0), 0)
    before = (sample.distance - first_step(math.nan, p, 0.0)) * (1.0 - 1e-9)  # the light's own surface is no obstacle
    left = unblocked(world, p, sample.direction, 0.0, before, nest, bands, own)
    q = sample.density * chosen.probability
    return Radiance(found * left * (power_heuristic(q, density) if q > 0.0 else 1.0), 1)


@kernel
def unblocked(world: Table, p: Vec3, way: Vec3, t_min: f64, t_max: f64, nest: Nest, bands: Table, own: Draws) -> Vec3:
    """Share of light that comes through from p + t_max * way to p: what media on the way leave, nothing behind surfaces."""
    if i64_at(world, FLAGS) & CLEAR == 0:
        if is_blocked(world, p, way, t_min, t_max):
            return grey(0.0)
        if is_null(nest.here):
            return grey(1.0)
        return transmittance(nest.here, p, way, min(t_max, FAR), bands, nested(own, BETWEEN))
    share = grey(1.0)
    t = t_min
    for pane in range(PANES):
        hit = find_closest(world, p, way, t, t_max)
        end = t_max if hit.item < 0 else hit.t
        if not is_null(nest.here):
            share = share * transmittance(
                nest.here, p + way * t, way, min(end - t, FAR), bands, nested(own, BETWEEN + pane)
            )
        if hit.item < 0:
            return share
        point = point_of(world, hit, p, way, thin_beam())
        if point.flags & CLEAR == 0:
            return grey(0.0)
        nest = crossing(world, nest, point, way)
        t = hit.t
    return grey(0.0)


@kernel
def chance_weight(world: Table, light: i64, p: Vec3, n: Vec3, d: Vec3, distance: f64, density: f64) -> f64:
    """Weight of light that a ray from p met by chance: 1 unless next-event estimation could have found it too."""
    if light < 0 or density <= 0.0:
        return 1.0
    q = direction_density(light_at(world, light), p, d, distance)
    if q <= 0.0:
        return 1.0
    return power_heuristic(density, q * light_probability(world, p, n, light))


@kernel
def light_of_skies(world: Table, p: Vec3, n: Vec3, d: Vec3, density: f64, bands: Table) -> Vec3:
    """Radiance, in the path's lanes, where a ray from p meets nothing, weighed as `chance_weight` does."""
    color = as_light(bands, vec3_at(world, BACKGROUND))
    for k in range(i64_at(world, SKY_COUNT)):
        index = i64_at(table_at(world, SKIES), k)
        light = light_at(world, index)
        color += light_in(bands, light, sky(light, d)) * chance_weight(world, index, p, n, d, math.inf, density)
    return color


@kernel
def power_heuristic(p: f64, q: f64) -> f64:
    """Weight of a sample chosen with density p, where another strategy has density q."""
    return p * p / (p * p + q * q)
