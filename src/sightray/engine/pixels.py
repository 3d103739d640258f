"""The kernel that takes the samples of a tile's pixels: the outermost loop of every picture."""

from __future__ import annotations

from sightray._jit import kernel
from sightray.cameras.base import CHANCE, MOMENT, Ray, sight_ray
from sightray.cameras.base import LENS as THROUGH_LENS
from sightray.film.film import add_sample, samples_taken
from sightray.filters.table import sample_filter
from sightray.integrators.base import Radiance, radiance
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, i32_at, i64_at, table_at
from sightray.mathlib.vec import dot, grey
from sightray.samplers.base import Draws, Pair, begin, nested, number, pair
from sightray.scene.world import CAMERA

# Dimensions of a sample's draws that the engine takes; integrators have draws of their own.
PLACE, LENS, TIME = 0, 1, 2


@kernel
def look(integrator: Table, world: Table, ray: Ray, draws: Draws) -> Radiance:
    """What a ray of sight finds: black for a pixel that has none, as beside the image circle of a fisheye lens."""
    if not dot(ray.direction, ray.direction) > 0.0:
        return Radiance(grey(0.0), 0)
    return radiance(integrator, world, ray, draws)


@kernel
def render_tile(
    world: Table, integrator: Table, sampler: Table, film: Table, filters: Table, target: Table, stop: Table,
    x0: i64, y0: i64, x1: i64, y1: i64, width: i64, expected: i64, centred: i64, seed: i64,
) -> i64:  # fmt: skip
    """Take samples until each pixel of a tile has as many as `target` says; returns the number of rays shot.

    A pixel's next sample has the number of those it has taken, so a picture goes on where it stopped. `expected` is
    told to the sampler: how many there will be in all, or 0. Samples are placed by the sampler and spread by the
    filter; with `centred` the first one goes through the pixel's centre. A non-zero word in `stop` ends the tile.
    """
    camera = table_at(world, CAMERA)
    chance = i64_at(camera, CHANCE)
    rays = 0
    for y in range(y0, y1):
        for x in range(x0, x1):
            pixel = y * width + x
            for s in range(samples_taken(film, pixel), i64(i32_at(target, pixel))):
                if i64_at(stop, 0) != 0:
                    return rays
                draws = begin(sampler, x, y, seed, s, expected)
                place, lens, when = pair(draws, PLACE), Pair(0.5, 0.5), 0.5
                if chance & THROUGH_LENS != 0:
                    lens = pair(draws, LENS)
                if chance & MOMENT != 0:
                    when = number(draws, TIME)
                fx, fy = sample_filter(filters, place.u), sample_filter(filters, place.v)
                dx, dy, weight = fx.offset, fy.offset, fx.weight * fy.weight
                if s == 0 and centred != 0:
                    dx, dy, weight = 0.0, 0.0, 1.0
                ray = sight_ray(camera, x + 0.5 + dx, y + 0.5 + dy, lens.u, lens.v, when)
                found = look(integrator, world, ray, nested(draws, 0))
                add_sample(film, pixel, found.color, weight)
                rays += found.rays
    return rays
