"""The kernel that takes the samples of a tile's pixels for integrators that follow many paths at once.

A batch is up to 128 samples, of one pixel or of several: their rays are aimed eight at a time, handed over together, and
what they find is added to the film in the order of the samples. So the picture is the same as if they came one by one.
"""

from __future__ import annotations

from sightray._jit import kernel
from sightray.cameras.base import CHANCE, MOMENT, generate_eight, moments
from sightray.cameras.base import LENS as THROUGH_LENS
from sightray.engine.pixels import LENS, PLACE
from sightray.engine.pixels import TIME as WHEN
from sightray.film.film import add_sample, samples_taken
from sightray.filters.table import sample_filter8
from sightray.integrators.base import (
    BATCH,
    FOUND,
    KEY,
    LINE,
    MINE_TOO,
    ORIGIN,
    PIXEL,
    SAMPLE,
    TIME,
    WAY,
    Batch,
    radiance_of_batch,
)
from sightray.mathlib.eight_paths import put_lines
from sightray.mathlib.eights import load8d, load8i, select8d, splat8d, store8d, store8i
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, f64_at, f64_put, i32_at, i64_at, i64_put, scratch, table_at
from sightray.mathlib.vec import Vec3, dot, grey
from sightray.samplers.base import BLOCK, Draws8, Pair8, begin, nested8, pair8
from sightray.scene.world import CAMERA

# What the engine notes beside a batch's rays: the pixel's place in the film, the sample's weight, the pixel's middle, and
# whether the sample goes there.
SPOT, WEIGHT, X, Y, CENTRED = (MINE_TOO + k * LINE for k in range(5))
assert MINE_TOO + 5 * LINE == 2448  # as `render_tile_in_batches` has it


@kernel
def render_tile_in_batches(
    world: Table, integrator: Table, sampler: Table, film: Table, filters: Table, target: Table, stop: Table,
    x0: i64, y0: i64, x1: i64, y1: i64, width: i64, expected: i64, centred: i64, seed: i64,
) -> i64:  # fmt: skip
    """`render_tile` for integrators that take many rays at once."""
    batch = scratch(2448)
    rays, count = 0, 0
    first = begin(sampler, x0, y0, seed, 0, expected)  # of all it has the number of samples, and of dimensions
    for y in range(y0, y1):
        for x in range(x0, x1):
            pixel = y * width + x
            for s in range(samples_taken(film, pixel), i64(i32_at(target, pixel))):
                draws = begin(sampler, x, y, seed, s, expected)
                i64_put(batch, KEY + count, draws.key)
                i64_put(batch, PIXEL + count, draws.pixel)
                i64_put(batch, SAMPLE + count, draws.sample)
                i64_put(batch, SPOT + count, pixel)
                f64_put(batch, X + count, x + 0.5)
                f64_put(batch, Y + count, y + 0.5)
                f64_put(batch, CENTRED + count, 0.0 if s == 0 and centred != 0 else 1.0)
                count += 1
                if count == BATCH:
                    if i64_at(stop, 0) != 0:
                        return rays
                    rays += render_batch(
                        world, integrator, sampler, film, filters, batch, count, first.samples, first.dimension
                    )  # fmt: skip
                    count = 0
    return rays + render_batch(
        world, integrator, sampler, film, filters, batch, count, first.samples, first.dimension
    )  # fmt: skip


@kernel
def render_batch(
    world: Table, integrator: Table, sampler: Table, film: Table, filters: Table, batch: Table, count: i64, samples: i64,
    dimension: i64,
) -> i64:  # fmt: skip
    """Take the samples of a batch; how many rays that took."""
    if count == 0:
        return 0
    for k in range(0, count, 8):
        draws = Draws8(
            sampler, load8i(batch, PIXEL + k), load8i(batch, KEY + k), load8i(batch, SAMPLE + k), samples, dimension
        )  # fmt: skip
        aim8(world, filters, batch, k, draws)
    rays = radiance_of_batch(integrator, world, Batch(batch, count, sampler, samples, dimension + BLOCK))
    for k in range(count):
        d, color = vector_at(batch, WAY + k), vector_at(batch, FOUND + k)
        seen = dot(d, d) > 0.0  # see `pixels.look`
        rays -= 0 if seen else 1
        add_sample(film, i64_at(batch, SPOT + k), color if seen else grey(0.0), f64_at(batch, WEIGHT + k))
    return rays


@kernel
def vector_at(batch: Table, index: i64) -> Vec3:
    """A vector of a batch."""
    return Vec3(f64_at(batch, index), f64_at(batch, index + LINE), f64_at(batch, index + 2 * LINE))


@kernel
def aim8(world: Table, filters: Table, batch: Table, k: i64, draws: Draws8) -> None:
    """The rays of sight of eight samples of a batch, from number k on; see `pixels.aim`."""
    camera, half = table_at(world, CAMERA), splat8d(0.5)
    chance = i64_at(camera, CHANCE)
    place, lens, when = pair8(draws, PLACE), Pair8(half, half), half
    if chance & THROUGH_LENS != 0:
        lens = pair8(draws, LENS)
    if chance & MOMENT != 0:
        when = pair8(draws, WHEN).u
    fx, fy = sample_filter8(filters, place.u), sample_filter8(filters, place.v)
    off = load8d(batch, CENTRED + k)
    x, y = load8d(batch, X + k) + fx.offset * off, load8d(batch, Y + k) + fy.offset * off
    time = moments(camera, y, when)
    ray = generate_eight(camera, x, y, lens.u, lens.v, time)
    store8d(batch, TIME + k, time)
    store8d(batch, WEIGHT + k, select8d(off > 0.0, fx.weight * fy.weight, splat8d(1.0)))
    put_lines(batch, ORIGIN + k, LINE, ray.origin)
    put_lines(batch, WAY + k, LINE, ray.direction)
    store8i(batch, KEY + k, nested8(draws, 0).key)
