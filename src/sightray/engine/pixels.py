"""The kernel that takes the samples of a tile's pixels: the outermost loop of every picture."""

from __future__ import annotations

from sightray._jit import kernel
from sightray.cameras.base import sight_ray
from sightray.film.film import add_sample
from sightray.filters.table import sample_filter
from sightray.integrators.base import radiance
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, i32_at, i64_at, is_null, table_at
from sightray.samplers.base import begin, nested, number, pair
from sightray.scene.world import CAMERA

# Dimensions of a sample's draws that the engine takes; integrators have draws of their own.
PLACE, LENS, TIME = 0, 1, 2


@kernel
def render_tile(
    world: Table, integrator: Table, sampler: Table, film: Table, filters: Table, plan: Table, stop: Table,
    x0: i64, y0: i64, x1: i64, y1: i64, width: i64, first: i64, samples: i64, seed: i64,
) -> i64:  # fmt: skip
    """Take samples in all pixels of a tile; returns the number of rays that were shot.

    Sample numbers start at `first`. `plan` holds a count for each pixel, or is null where all take `samples`. A
    single sample goes through the pixel's centre; more are placed by the sampler and spread by the filter.
    A non-zero word in `stop` ends the tile.
    """
    camera = table_at(world, CAMERA)
    rays = 0
    for y in range(y0, y1):
        for x in range(x0, x1):
            pixel = y * width + x
            count = samples if is_null(plan) else i64(i32_at(plan, pixel))
            if i64_at(stop, 0) != 0:
                return rays
            for s in range(count):
                draws = begin(sampler, x, y, seed, first + s, first + count)
                place, lens, when = pair(draws, PLACE), pair(draws, LENS), number(draws, TIME)
                fx, fy = sample_filter(filters, place.u), sample_filter(filters, place.v)
                dx, dy, weight = fx.offset, fy.offset, fx.weight * fy.weight
                if first == 0 and samples == 1:
                    dx, dy, weight = 0.0, 0.0, 1.0
                ray = sight_ray(camera, x + 0.5 + dx, y + 0.5 + dy, lens.u, lens.v, when)
                found = radiance(integrator, world, ray, nested(draws, 0))
                add_sample(film, pixel, found.color, weight)
                rays += found.rays
    return rays
