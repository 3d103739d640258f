"""Light that comes from lights without detours, found in three ways."""

from __future__ import annotations

import math

from sightray._jit import implements
from sightray.accelerators.item import CLEAR
from sightray.cameras.base import Ray
from sightray.fields import choice, flag, integer
from sightray.integrators.base import Integrator, Radiance, radiance
from sightray.integrators.direct import FAR, lit_normal
from sightray.integrators.nesting import around_eye, crossing
from sightray.integrators.searching import BRDF, Search, behind, chance, from_lights
from sightray.integrators.shading import first_step, frame_of, into, on_true_side, out_of
from sightray.integrators.terminator import lifted
from sightray.materials.base import emitted, sample_bsdf
from sightray.mathlib.table import Table, i64_at, is_null, no_table
from sightray.mathlib.vec import grey, max3
from sightray.media.base import transmittance
from sightray.samplers.base import Draws, nested, number, pair
from sightray.scene.world import find_closest, on_seen_side, point_of, sight_beam

STRATEGIES = ("light", "material", "both")  # at the indices of integrators/searching.py


class DirectLighting(Integrator):
    """The first bounce of the rendering equation: L = L_e + integral of f(wo, wi) L_e(wi) |cos wi| over all directions.

    The integral can be sampled where the lights are, or where the material sends its light. The first is noisy for
    large lights in glossy surfaces, the second for small lights on matte ones. With ``"both"``, each sample counts with
    the weight n² p² / (n² p² + q²) of its own density p and the other strategy's q, n the number of samples (E. Veach,
    L. Guibas, "Optimally combining sampling techniques for Monte Carlo rendering", SIGGRAPH 1995: the power heuristic),
    which is about as good as the better one everywhere.

    All three have the same expectation: what one strategy cannot find (a point light by chance, the mirror image of a
    light by looking for it) is left to the other. Mirrors and smooth glass are followed for `max_depth` bounces, as a
    random walk. Light that media absorb or scatter on the way is lost.
    """

    strategy: str = choice("where samples are taken", STRATEGIES, default="both")
    light_samples: int = integer("shadow rays to each cell of a light", default=1, at_least=1, at_most=1 << 16)
    every_light: bool = flag("ask all lights, instead of one that is chosen by chance", default=True)
    max_depth: int = integer("bounces off mirrors and through glass", default=5, at_least=0, at_most=1000)


STRATEGY, LIGHT_SAMPLES, EVERY_LIGHT, DEPTH = DirectLighting.offsets()

WAY, CHOICE = 0, 1  # dimensions of a bounce's draws, before those of searching.py
MEDIUM = 0  # number of the nested draws for a medium
MOST_SURFACES = 10_000  # boundaries of media that a ray may pass, with all the rest


@implements(radiance, DirectLighting)
def direct_lighting_radiance(integrator: Table, world: Table, ray: Ray, draws: Draws) -> Radiance:
    every = i64_at(integrator, EVERY_LIGHT) != 0
    search = Search(i64_at(integrator, STRATEGY), BRDF, i64_at(integrator, LIGHT_SAMPLES), every)
    o, d = ray.origin, ray.direction
    color, beta = grey(0.0), grey(1.0)  # beta: path throughput
    nest, beam = around_eye(world, o, d), sight_beam(world, draws, no_table())
    # Where the direction d was chosen, the normal there, and with which density; 0 for rays of sight and mirrors.
    start, n, density, gone = o, grey(0.0), 0.0, 0.0
    t_min = 0.0
    rays = mirrors = event = 0
    while event < MOST_SURFACES:
        rays += 1
        own = nested(draws, event)
        event += 1
        hit = find_closest(world, o, d, t_min, math.inf)
        if not is_null(nest.here):
            beta = beta * transmittance(nest.here, o, d, min(hit.t, FAR), no_table(), nested(own, MEDIUM))

        # Take the light that is there, as far as the strategy leaves it to chance.
        if hit.item < 0:
            color += beta * behind(search, world, start, n, d, density)
            break
        point = on_seen_side(point_of(world, hit, o, d, beam), d)
        t_min = first_step(math.nan, point.p, hit.t)
        gone += hit.t
        if point.flags & CLEAR != 0:
            nest = crossing(world, nest, point, d)
            o = point.p
            continue
        shine = emitted(point.material, point.where, point.cos_view)
        if max3(shine) > 0.0:
            color += beta * shine * chance(search, world, point.light, start, n, d, gone, density)
        if density > 0.0:
            break

        # Look for lights.
        frame = frame_of(point)
        wo = into(frame, -d)
        lit = from_lights(search, world, point, lifted(world, hit, point), frame, wo, t_min, nest, own)
        color += beta * lit.color
        rays += lit.rays

        # Let the material choose a direction; the way ends at what is there, unless this was a mirror.
        way = pair(own, WAY)
        chosen = sample_bsdf(point.material, point.where, wo, way.u, way.v, number(own, CHOICE))
        beta = beta * chosen.weight
        if max3(beta) <= 0.0:
            break
        if chosen.density <= 0.0:
            if mirrors >= i64_at(integrator, DEPTH):
                break
            mirrors += 1
        passes = wo.z * chosen.wi.z < 0.0
        d = on_true_side(point, d, out_of(frame, chosen.wi), passes)
        if passes:
            nest = crossing(world, nest, point, d)
        o, start, n, density, gone = point.p, point.p, lit_normal(point), chosen.density, 0.0
    return Radiance(color, rays)
