"""Path tracing, the plain way: nothing clever, to be read first and to test the clever one."""

from __future__ import annotations

import math

from sightray._jit import implements
from sightray.cameras.base import Ray
from sightray.fields import integer
from sightray.integrators.base import Integrator, Radiance, radiance
from sightray.integrators.shading import first_step, frame_about, into, out_of
from sightray.materials.base import emitted, interior, sample_bsdf
from sightray.mathlib.rng import stream, uniform
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, i64_at, vec3_at
from sightray.mathlib.vec import grey, max3, vexp
from sightray.scene.world import BACKGROUND, find_closest, on_seen_side, point_of


class SimplePathTracer(Integrator):
    """Estimates the rendering equation by one random walk a sample, from the eye until it meets light by chance.

    L(x, wo) = L_e(x, wo) + integral of f(wo, wi) L(x, wi) |cos wi| over all directions wi (J. Kajiya, "The rendering
    equation", SIGGRAPH 1986). At each surface one direction is chosen by the material. Small lights are found seldom
    and point lights never: `PathTracer` looks for them.
    """

    max_depth: int = integer("bounces after the ray of sight", default=8, at_least=0, at_most=1000)


(DEPTH,) = SimplePathTracer.offsets()


@implements(radiance, SimplePathTracer)
def simple_path_radiance(integrator: Table, world: Table, ray: Ray, key: i64) -> Radiance:
    o, d = ray.origin, ray.direction
    color, beta = grey(0.0), grey(1.0)  # beta: path throughput
    t_min = 0.0
    rays = 0
    for depth in range(i64_at(integrator, DEPTH) + 1):
        # Take the light that the nearest surface gives off, or the background.
        rays += 1
        hit = find_closest(world, o, d, t_min, math.inf)
        if hit.item < 0:
            color += beta * vec3_at(world, BACKGROUND)
            break
        point = on_seen_side(point_of(world, hit, o, d), d)
        if point.cos_view < 0.0:
            beta = beta * vexp(interior(point.material) * -hit.t)
        color += beta * emitted(point.material, point.where, point.cos_view)

        # Go on in a direction that the material chooses.
        own = stream(key, depth)
        frame = frame_about(point.shading)
        u, v, choice = uniform(own, 0), uniform(own, 1), uniform(own, 2)
        chosen = sample_bsdf(point.material, point.where, into(frame, -d), u, v, choice)
        beta = beta * chosen.weight
        if max3(beta) <= 0.0:
            break
        t_min = first_step(math.nan, point.p, hit.t)
        o, d = point.p, out_of(frame, chosen.wi)
    return Radiance(color, rays)
