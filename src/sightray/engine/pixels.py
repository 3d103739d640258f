"""The kernel that takes the samples of a tile's pixels: the outermost loop of every picture."""

from __future__ import annotations

import math

from sightray._jit import kernel
from sightray.cameras.base import generate_ray
from sightray.film.film import add_sample
from sightray.filters.table import sample_filter
from sightray.integrators.base import radiance
from sightray.mathlib.rng import stream, uniform
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, i32_at, i64_at, is_null, table_at
from sightray.scene.world import CAMERA

# Dimensions of a sample's random stream that the engine takes; integrators have a stream of their own.
DX, DY, OWN = 0, 1, 2


@kernel
def render_tile(
    world: Table, integrator: Table, film: Table, filters: Table, plan: Table, stop: Table,
    x0: i64, y0: i64, x1: i64, y1: i64, width: i64, first: i64, samples: i64, seed: i64,
) -> i64:  # fmt: skip
    """Take samples in all pixels of a tile; returns the number of rays that were shot.

    Sample numbers start at `first`. `plan` holds a count for each pixel, or is null where all take `samples`. A
    single sample goes through the pixel's centre; more are jittered in the cells of a grid and spread by the filter.
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
            columns = i64(math.sqrt(float(count)))
            rows = count // max(columns, 1)
            for s in range(count):
                key = stream(stream(seed, pixel), first + s)
                u, v = uniform(key, DX), uniform(key, DY)
                if s < columns * rows:
                    u = (s % columns + u) / columns
                    v = (s // columns + v) / rows
                fx, fy = sample_filter(filters, u), sample_filter(filters, v)
                dx, dy, weight = fx.offset, fy.offset, fx.weight * fy.weight
                if first == 0 and samples == 1:
                    dx, dy, weight = 0.0, 0.0, 1.0
                ray = generate_ray(camera, x + 0.5 + dx, y + 0.5 + dy)
                found = radiance(integrator, world, ray, stream(key, OWN))
                add_sample(film, pixel, found.color, weight)
                rays += found.rays
    return rays
