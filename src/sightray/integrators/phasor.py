"""Light by the length of its way: what a camera with a modulated lamp gets to see."""

from __future__ import annotations

import math
from typing import Any

from sightray._jit import implements, kernel
from sightray.accelerators.item import CLEAR, THIN
from sightray.cameras.base import Ray
from sightray.fields import derived_number, integer
from sightray.fields import number as real
from sightray.integrators.base import Integrator, Radiance, radiance
from sightray.integrators.direct import FAR, unblocked
from sightray.integrators.nesting import Nest, around_eye, crossing
from sightray.integrators.shading import Frame, first_step, frame_of, into, on_true_side, out_of
from sightray.integrators.terminator import lifted, shadow_ray
from sightray.lights.base import WHOLE, illuminate
from sightray.materials.base import bsdf, emitted, local, sample_bsdf
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, i64_at, is_null, no_table
from sightray.mathlib.vec import Vec3, grey, max3
from sightray.media.base import transmittance
from sightray.samplers.base import Draws, nested, number, pair
from sightray.scene.world import Point, find_closest, lamp_count, light_at, on_seen_side, point_of, sight_beam

SPEED_OF_LIGHT = 299_792_458.0  # m/s


class PhasorTracer(Integrator):
    """The light of lamps whose brightness swings, as a phasor: the sum of L cos p, of L sin p, and of L.

    A lamp that shines as 1 + cos(2 pi f t) is seen, after a way of optical length s (metres times refractive index), as
    1 + cos(2 pi f t - p) with the phase p = 2 pi f s / c. Light that came on several ways adds up to one swing again,
    whose amplitude and phase are those of the sum of L exp(i p) over the ways: that is why cameras that measure time of
    flight err in corners (M. Gupta, S. Nayar, M. Hullin, J. Martin, "Phasor imaging", ACM TOG 34(5), 2015).

    A walk from the eye looks for every lamp of the scene at each surface, as `PathTracer` does, and carries the length of
    its way, that behind glass with the index of the d line; the "picture" holds the three sums in place of red, green and
    blue, with either sign. All lamps swing together. Red stands for the near infrared: reflectances and lamps count with
    that. Lamps that are infinitely far and surfaces that glow are steady and do not show; lamps with an area are met
    also by rays of sight, and in mirrors. Media weaken light on its way; what they scatter is lost.
    """

    frequency: float = real("of the lamps' swing", default=20e6, above=0, unit="Hz")
    max_depth: int = integer("bounces after the ray of sight", default=4, at_least=0, at_most=1000)
    _wave: Any = derived_number("phase per metre", lambda p: 2.0 * math.pi * p.frequency / SPEED_OF_LIGHT)


_, DEPTH, WAVE = PhasorTracer.offsets()
WAY, CHOICE, PLACE = 0, 1, 2  # dimensions of a bounce's draws; every lamp takes one from PLACE on
MEDIUM = 0  # number of the nested draws for a medium
MOST_SURFACES = 10_000  # boundaries of media that a ray may pass, with all the rest


@implements(radiance, PhasorTracer)
def phasor_radiance(integrator: Table, world: Table, ray: Ray, draws: Draws) -> Radiance:
    wave = f64_at(integrator, WAVE)
    o, d = ray.origin, ray.direction
    found, beta = grey(0.0), grey(1.0)  # beta: path throughput
    nest, beam = around_eye(world, o, d), sight_beam(world, draws, no_table())
    gone, index = 0.0, 1.0  # optical length of the way so far; refractive index around
    mirrored = True  # whether lamps cannot have been found by looking for them
    t_min = 0.0
    rays = depth = event = 0
    while event < MOST_SURFACES:
        rays += 1
        own = nested(draws, event)
        event += 1
        hit = find_closest(world, o, d, t_min, math.inf)
        if hit.item < 0:
            break
        if not is_null(nest.here):
            beta = beta * transmittance(nest.here, o, d, min(hit.t, FAR), no_table(), nested(own, MEDIUM))
        point = on_seen_side(point_of(world, hit, o, d, beam), d)
        t_min = first_step(math.nan, point.p, hit.t)
        gone += index * hit.t
        if point.flags & CLEAR != 0:
            nest = crossing(world, nest, point, d)
            o = point.p
            continue
        if mirrored and 0 <= point.light < lamp_count(world):
            shine = emitted(point.material, point.where, point.cos_view)
            found += swing(wave * gone, beta.x * shine.x)
        if depth >= i64_at(integrator, DEPTH):
            break

        # Look for all lamps.
        frame = frame_of(point)
        wo = into(frame, -d)
        start = lifted(world, hit, point)
        for k in range(lamp_count(world)):
            lit = from_lamp(world, light_at(world, k), k, point, start, frame, wo, t_min, nest, own)
            rays += lit.rays
            found += swing(wave * (gone + index * lit.color.y), beta.x * lit.color.x)

        # Go on in a direction that the material chooses.
        way = pair(own, WAY)
        chosen = sample_bsdf(point.material, point.where, wo, way.u, way.v, number(own, CHOICE))
        beta = beta * chosen.weight
        if max3(beta) <= 0.0:
            break
        passes = wo.z * chosen.wi.z < 0.0
        if passes and point.flags & THIN == 0:
            index /= local(point.material, point.where, point.cos_view).eta
        d = on_true_side(point, d, out_of(frame, chosen.wi), passes)
        if passes:
            nest = crossing(world, nest, point, d)
        o = point.p
        mirrored = chosen.density <= 0.0
        depth += 1
    return Radiance(found, rays)


@kernel
def swing(phase: f64, light: f64) -> Vec3:
    """Light with that phase, in the three lanes of the sum."""
    return Vec3(light * math.cos(phase), light * math.sin(phase), light)


@kernel
def from_lamp(
    world: Table, lamp: Table, which: i64, point: Point, start: Vec3, frame: Frame, wo: Vec3, t_min: f64,
    nest: Nest, own: Draws,
) -> Radiance:  # fmt: skip
    """Light that a surface reflects from one of the lamp's points: its radiance in x, the distance of the lamp in y."""
    place = pair(own, PLACE + which)
    sample = illuminate(lamp, point.p, WHOLE, place.u, place.v)
    if not sample.distance < math.inf:
        return Radiance(grey(0.0), 0)
    wi = into(frame, sample.direction)
    light = bsdf(point.material, point.where, wo, wi).value.x * sample.irradiance.x
    if not light > 0.0:
        return Radiance(grey(0.0), 0)
    through = wo.z * wi.z < 0.0
    behind = crossing(world, nest, point, sample.direction) if through else nest
    ray = shadow_ray(point.p if through else start, point.p, sample.direction, sample.distance)
    left = unblocked(world, ray.o, ray.d, t_min, ray.distance - t_min, behind, no_table(), own)
    return Radiance(Vec3(light * left.x, sample.distance, 0.0), 1)
