"""Path tracing, the plain way: nothing clever, to be read first and to test the clever one."""

from __future__ import annotations

import math

from sightray._jit import implements
from sightray.cameras.base import Ray
from sightray.fields import integer
from sightray.integrators.base import Integrator, Radiance, radiance
from sightray.integrators.shading import first_step, frame_of, into, out_of
from sightray.materials.base import emitted, interior, sample_bsdf
from sightray.mathlib.table import Table, i64_at, is_null, no_table
from sightray.mathlib.vec import grey, max3
from sightray.media.base import transmittance
from sightray.samplers.base import Draws, nested, number, pair
from sightray.scene.world import background, find_closest, on_seen_side, point_of, sight_beam


class SimplePathTracer(Integrator):
    """Estimates the rendering equation by one random walk a sample, from the eye until it meets light by chance.

    L(x, wo) = L_e(x, wo) + integral of f(wo, wi) L(x, wi) |cos wi| over all directions wi (J. Kajiya, "The rendering
    equation", SIGGRAPH 1986). At each surface one direction is chosen by the material. Small lights are found seldom
    and point lights never: `PathTracer` looks for them.
    """

    max_depth: int = integer("bounces after the ray of sight", default=8, at_least=0, at_most=1000)


(DEPTH,) = SimplePathTracer.offsets()
WAY, CHOICE = 0, 1  # dimensions of a bounce's draws


@implements(radiance, SimplePathTracer)
def simple_path_radiance(integrator: Table, world: Table, ray: Ray, draws: Draws) -> Radiance:
    o, d = ray.origin, ray.direction
    color, beta = grey(0.0), grey(1.0)  # beta: path throughput
    t_min = 0.0
    rays = 0
    for depth in range(i64_at(integrator, DEPTH) + 1):
        # Take the light that the nearest surface gives off, or the background.
        rays += 1
        hit = find_closest(world, o, d, t_min, math.inf)
        if hit.item < 0:
            color += beta * background(world, d)
            break
        point = on_seen_side(point_of(world, hit, o, d, sight_beam(world, draws, no_table())), d)
        if point.cos_view < 0.0:
            inside = interior(point.material)
            if not is_null(inside):
                beta = beta * transmittance(inside, o, d, hit.t, no_table(), draws)
        color += beta * emitted(point.material, point.where, point.cos_view)

        # Go on in a direction that the material chooses.
        own = nested(draws, depth)
        frame = frame_of(point)
        way = pair(own, WAY)
        chosen = sample_bsdf(point.material, point.where, into(frame, -d), way.u, way.v, number(own, CHOICE))
        beta = beta * chosen.weight
        if max3(beta) <= 0.0:
            break
        t_min = first_step(math.nan, point.p, hit.t)
        o, d = point.p, out_of(frame, chosen.wi)
    return Radiance(color, rays)
