"""Path tracing with next-event estimation, multiple importance sampling and Russian roulette."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from sightray._jit import implements, kernel
from sightray.accelerators.item import CLEAR, ItemHit
from sightray.cameras.base import Ray
from sightray.fields import derived_array, flag, integer
from sightray.fields import number as real
from sightray.integrators.base import Integrator, Radiance, radiance
from sightray.integrators.direct import (
    FAR,
    chance_weight,
    direct_light,
    direct_light_within,
    light_of_skies,
    lit_normal,
)
from sightray.integrators.nesting import Nest, around_eye, crossing
from sightray.integrators.shading import first_step, frame_of, into, on_true_side, out_of
from sightray.integrators.spectral import choose_bands, seen_colour
from sightray.integrators.terminator import lifted
from sightray.materials.base import bsdf, emitted, glow_in, sample_bsdf
from sightray.mathlib.bands import BANDS_WORDS, ones
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, i64_at, is_null, no_table, scratch, table_at
from sightray.mathlib.vec import Vec3, grey, max4
from sightray.media.base import sample_distance, sample_phase
from sightray.samplers.base import Draws, nested, number, one_of, pair
from sightray.scene.world import Beam, Point, find_closest, light_count, on_seen_side, point_of, sight_beam
from sightray.spectra.upsampling import band_table


class PathTracer(Integrator):
    """Estimates the rendering equation by random walks that look for lights at every step.

    At each surface one light is chosen and one point on it (next-event estimation), beside the direction in which the
    walk goes on. Where both could have found the same light, each counts with the weight p² / (p² + q²) of their
    densities p and q (E. Veach, L. Guibas, "Optimally combining sampling techniques for Monte Carlo rendering",
    SIGGRAPH 1995: the power heuristic). From `roulette_depth` on, a walk goes on with a probability that follows its
    weight (J. Arvo, D. Kirk, SIGGRAPH 1990). `SimplePathTracer` is the same without all that.

    On the way a path goes through what fills the scene and the bodies it enters: media absorb, and scatter it as
    surfaces do (E. Lafortune, Y. Willems, "Rendering participating media with bidirectional path tracing", 1996), which
    is fog, and within marble or milk subsurface scattering. A walk's scatterings in media do not count as bounces.

    With `spectral`, colours are carried as four wavelengths: dispersion, measured metals and illuminants come out
    right, at some noise of colour.
    """

    max_depth: int = integer("bounces after the ray of sight", default=8, at_least=0, at_most=1000)
    roulette_depth: int = integer("bounces before Russian roulette begins", default=4, at_least=0)
    light_samples: int = integer(
        "shadow rays from the first surface of a path; more where the noise is that of direct light", default=1,
        at_least=1, at_most=1024)  # fmt: skip
    clamp: float | None = real(
        "most that a walk may add at once after its first turn, against fireflies; None for no bias", default=None, above=0,
        optional=True)  # fmt: skip
    spectral: bool = flag("follow wavelengths instead of red, green and blue", default=False)
    _bands: Any = derived_array("table of spectra, if spectral", lambda p: band_table() if p.spectral else None)

    def for_batches(self, compiled: Any) -> Integrator | None:
        from sightray.integrators.eightpieces import _AmongPieces
        from sightray.integrators.eighttrees import _AmongOthers, _AmongTrees

        if self.spectral or not compiled.for_eight or type(self).kernels[radiance] is not path_radiance:
            return None
        among = _AmongPieces if compiled.in_pieces else _AmongTrees if compiled.all_have_kinds else _AmongOthers
        return among(**{name: getattr(self, name) for name in PathTracer.given})


DEPTH, ROULETTE_DEPTH, LIGHT_SAMPLES, CLAMP, _, BAND_TABLE = PathTracer.offsets()

# Dimensions of a bounce's draws, beside those of direct.py, and the number of the nested ones for a medium.
WAVELENGTH, WAY, CHOICE, MEDIUM = 0, 0, 1, 0
MOST_EVENTS = 100_000  # a walk in a body that takes nothing away must end somewhere
WIDEST = 0.2  # spread of a beam after a matte surface, about what a filter can still tell apart
MATTE = 0.05  # density, per steradian, with which a matte surface sends light back to where it came from
LOBE = 0.1  # share of a lobe's width that one sample of it stands for


@implements(radiance, PathTracer)
def path_radiance(integrator: Table, world: Table, ray: Ray, draws: Draws) -> Radiance:
    table = table_at(integrator, BAND_TABLE)
    if is_null(table):
        found = walk(integrator, world, from_eye(world, ray, draws, no_table()), draws, 0)
        return Radiance(found.color, found.rays)
    bands = scratch(BANDS_WORDS)
    choose_bands(table, number(draws, WAVELENGTH), bands)
    found = walk(integrator, world, from_eye(world, ray, draws, bands), draws, 0)
    return Radiance(seen_colour(bands, found.color), found.rays)


class Step(NamedTuple):
    """A random walk before its next ray."""

    o: Vec3
    d: Vec3
    beta: Vec3  # path throughput
    nest: Nest
    beam: Beam
    start: Vec3  # where the direction d was chosen, the normal there, and with which density;
    n: Vec3
    density: f64  # 0 for rays of sight and mirrors
    gone: f64  # metres since then
    t_min: f64
    depth: i64  # bounces
    turns: i64  # those and scatterings in media
    event: i64  # rays of the walk so far


class Walked(NamedTuple):
    """What a walk has found; and where it is, if it paused."""

    color: Vec3
    rays: i64
    events: i64  # how many of them were steps of the walk, from the eye on
    hit: ItemHit  # the surface before which it paused; nothing (item -1) if it came to its end
    step: Step  # with which it would go on


@kernel
def from_eye(world: Table, ray: Ray, draws: Draws, bands: Table) -> Step:
    """The beginning of a walk."""
    beam = sight_beam(world, draws, bands)
    zero = grey(0.0)
    nest = around_eye(world, ray.origin, ray.direction)
    return Step(ray.origin, ray.direction, ones(bands), nest, beam, ray.origin, zero, 0.0, 0.0, 0.0, 0, 0, 0)


@kernel
def walk(integrator: Table, world: Table, first: Step, draws: Draws, pause: i64) -> Walked:
    """A random walk to its end, or until one of its first `pause` rays meets a matte surface."""
    o, d, beta, nest, beam = first.o, first.d, first.beta, first.nest, first.beam
    start, n, density, gone, t_min = first.start, first.n, first.density, first.gone, first.t_min
    depth, turns, event = first.depth, first.turns, first.event
    bands, color, rays = beam.bands, grey(0.0), 0
    while event < MOST_EVENTS:
        rays += 1
        hit = find_closest(world, o, d, t_min, math.inf)
        own = nested(draws, event)
        event += 1

        # Go through what fills the way; in the midst of it light may scatter.
        if not is_null(nest.here):
            went = sample_distance(nest.here, o, d, min(hit.t, FAR), beta, bands, nested(own, MEDIUM))
            beta = beta * went.weight
            if max4(beta) <= 0.0:
                break
            if went.scattered:
                o = o + d * went.t
                if light_count(world) > 0:
                    direct = direct_light_within(world, o, d, nest, bands, own)
                    rays += direct.rays
                    color += limited(integrator, beta * direct.color, turns + 1)
                turns += 1
                way, choice = pair(own, WAY), pair(own, CHOICE)
                turned = sample_phase(nest.here, d, way.u, way.v)
                d, start, n, density, gone, t_min = turned.direction, o, grey(0.0), turned.density, 0.0, 0.0
                odds = survival(integrator, beta, event)
                if choice.v >= odds:
                    break
                beta = beta / odds
                continue

        # Take the light that the nearest surface gives off, unless looking for lights has taken it already.
        if hit.item < 0:
            behind = light_of_skies(world, start, n, d, density, bands)
            color += limited(integrator, beta * behind, turns)
            break
        point = on_seen_side(point_of(world, hit, o, d, beam), d)
        if event <= pause and point.flags & CLEAR == 0 and is_null(nest.here) and is_matte(point):
            here = Step(o, d, beta, nest, beam, start, n, density, gone, t_min, depth, turns, event - 1)
            return Walked(color, rays - 1, event - 1, hit, here)
        t_min = first_step(math.nan, point.p, hit.t)
        gone += hit.t
        if point.flags & CLEAR != 0:
            nest = crossing(world, nest, point, d)
            o = point.p
            continue
        color += limited(integrator, beta * given_off(world, point, start, n, d, gone, density, bands), turns)
        if depth >= i64_at(integrator, DEPTH):
            break

        # Choose where to go on, which does not wait for the shadow ray; then look for a light.
        frame = frame_of(point)
        wo = into(frame, -d)
        way, choice = pair(own, WAY), pair(own, CHOICE)
        chosen = sample_bsdf(point.material, point.where, wo, way.u, way.v, choice.u)
        if light_count(world) > 0:
            lit_from = lifted(world, hit, point)
            count = i64_at(integrator, LIGHT_SAMPLES) if depth == 0 else 1
            for k in range(count):
                direct = direct_light(world, point, lit_from, frame, wo, t_min, nest, bands, one_of(own, k, count))
                rays += direct.rays
                color += limited(integrator, beta * direct.color, turns + 1) * (1.0 / count)

        # Go on in a direction that the material chooses, or end the walk if it has become unimportant.
        beta = beta * chosen.weight
        odds = survival(integrator, beta, event)
        if choice.v >= odds:
            break
        beta = beta / odds
        passes = wo.z * chosen.wi.z < 0.0
        d = on_true_side(point, d, out_of(frame, chosen.wi), passes)
        if passes:
            nest = crossing(world, nest, point, d)
        beam = onward(beam, hit.t, chosen.density)
        o, start, n, density, gone = point.p, point.p, lit_normal(point), chosen.density, 0.0
        depth += 1
        turns += 1
    return Walked(color, rays, event, ItemHit(math.inf, -1, 0, 0.0, 0.0), first)


@kernel
def given_off(world: Table, point: Point, start: Vec3, n: Vec3, d: Vec3, gone: f64, density: f64, bands: Table) -> Vec3:
    """Light that a surface gives off itself, weighed as `chance_weight` does: looking for lights finds it, too."""
    glow = glow_in(bands, point.material, emitted(point.material, point.where, point.cos_view))
    if max4(glow) > 0.0:
        return glow * chance_weight(world, point.light, start, n, d, gone, density)
    return glow


@kernel
def is_matte(point: Point) -> bool:
    """Whether a surface answers light from all around on the side that is seen; mirrors do not."""
    return sent_back(point) > MATTE


@kernel
def sent_back(point: Point) -> f64:
    """The density, per steradian, with which a surface sends light that meets it head on back: 1/pi of a matte one."""
    side = Vec3(0.0, 0.0, 1.0 if point.cos_view >= 0.0 else -1.0)
    return bsdf(point.material, point.where, side, side).density


@kernel
def survival(integrator: Table, beta: Vec3, event: i64) -> f64:
    """Probability with which a walk goes on: 1 in the beginning, later by what it still weighs."""
    if max4(beta) <= 0.0:
        return 0.0
    if event <= i64_at(integrator, ROULETTE_DEPTH):
        return 1.0
    return min(max4(beta), 1.0)


@kernel
def onward(beam: Beam, t: f64, density: f64) -> Beam:
    """The beam after a surface: mirrors keep it narrow, rough surfaces spread it as wide as their lobe is."""
    spread = beam.spread if density <= 0.0 else min(WIDEST, max(beam.spread, LOBE / math.sqrt(density)))
    return Beam(beam.width + beam.spread * t, spread, beam.bands)


@kernel
def limited(integrator: Table, color: Vec3, turns: i64) -> Vec3:
    """A contribution, scaled down to the clamp if one is set; what is seen directly is never touched."""
    most = f64_at(integrator, CLAMP)
    brightest = max4(color)
    if most == most and turns > 1 and brightest > most:
        return color * (most / brightest)
    return color
