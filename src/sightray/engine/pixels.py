"""The kernel that takes the samples of a tile's pixels: the outermost loop of every picture."""

from __future__ import annotations

from typing import NamedTuple

from sightray._jit import kernel
from sightray.cameras.base import CHANCE, MOMENT, Ray, sight_ray
from sightray.cameras.base import LENS as THROUGH_LENS
from sightray.film.film import add_sample, brightness_so_far, samples_taken
from sightray.filters.table import sample_filter
from sightray.integrators.base import (
    COLOR,
    MINE,
    SO_FAR,
    Radiance,
    radiance,
    radiance_of_group,
    sight_of,
    write_sight,
)
from sightray.mathlib.digits import LOW
from sightray.mathlib.rng import stream, word
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, f64_put, i32_at, i64_at, i64_put, scratch, table_at, vec3_at
from sightray.mathlib.vec import dot, grey
from sightray.samplers.base import Draws, Pair, begin, nested, number, pair
from sightray.scene.world import CAMERA

WIDEST = 2  # most pixels from one of a lattice to the next: neighbours are more alike, but wider ones make no squares
# Dimensions of a sample's draws that the engine takes; integrators have draws of their own.
PLACE, LENS, TIME = 0, 1, 2


@kernel
def look(integrator: Table, world: Table, ray: Ray, draws: Draws) -> Radiance:
    """What a ray of sight finds: black for a pixel that has none, as beside the image circle of a fisheye lens."""
    if not dot(ray.direction, ray.direction) > 0.0:
        return Radiance(grey(0.0), 0)
    return radiance(integrator, world, ray, draws)


class Look(NamedTuple):
    """A ray of sight, and what its sample weighs in the pixel."""

    ray: Ray
    draws: Draws
    weight: f64


@kernel
def aim(
    world: Table, sampler: Table, filters: Table, x: i64, y: i64, s: i64, expected: i64, centred: i64, seed: i64
) -> Look:
    """The ray of sample s of the pixel in column x and row y."""
    camera = table_at(world, CAMERA)
    chance = i64_at(camera, CHANCE)
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
    return Look(ray, nested(draws, 0), weight)


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
    rays = 0
    for y in range(y0, y1):
        for x in range(x0, x1):
            pixel = y * width + x
            for s in range(samples_taken(film, pixel), i64(i32_at(target, pixel))):
                if i64_at(stop, 0) != 0:
                    return rays
                at = aim(world, sampler, filters, x, y, s, expected, centred, seed)
                found = look(integrator, world, at.ray, at.draws)
                add_sample(film, pixel, found.color, at.weight)
                rays += found.rays
    return rays


class Lattice(NamedTuple):
    """Pixels whose rays go together."""

    x: i64  # the first of them
    y: i64
    across: i64  # from one to the next
    down: i64
    together: i64  # to a side


@kernel
def render_tile_in_groups(
    world: Table, integrator: Table, sampler: Table, film: Table, filters: Table, target: Table, stop: Table,
    x0: i64, y0: i64, x1: i64, y1: i64, width: i64, expected: i64, centred: i64, seed: i64, together: i64,
) -> i64:  # fmt: skip
    """The same, for integrators that want the rays of near pixels: square lattices of `together` by `together` of them.

    The lattices lie elsewhere for each sample and are as wide as chance will have it, so that none shows in the picture;
    at the edges of the tile they are cut. Where some pixels are to have more samples than others, they begin, so that all
    go together in the end.
    """
    rays, most, last = 0, 0, 0
    for y in range(y0, y1):
        for x in range(x0, x1):
            pixel = y * width + x
            goal = i64(i32_at(target, pixel))
            most, last = max(most, goal - samples_taken(film, pixel)), max(last, goal)
    for left in range(most, 0, -1):
        lattice = word(stream(seed, last - left), 0) & LOW
        across, down = 1 + (lattice & 255) % WIDEST, 1 + (lattice >> 8 & 255) % WIDEST
        top = y0 - (lattice >> 16 & 255) % (together * down)
        while top < y1:
            side = x0 - (lattice >> 24) % (together * across)
            while side < x1:
                for k in range(across * down):
                    if i64_at(stop, 0) != 0:
                        return rays
                    here = Lattice(side + k % across, top + k // across, across, down, together)
                    rays += render_group(
                        world, integrator, sampler, film, filters, target, here, x0, y0, x1, y1, width, left, expected,
                        centred, seed,
                    )  # fmt: skip
                side += together * across
            top += together * down
    return rays


@kernel
def render_group(
    world: Table, integrator: Table, sampler: Table, film: Table, filters: Table, target: Table, lattice: Lattice,
    x0: i64, y0: i64, x1: i64, y1: i64, width: i64, left: i64, expected: i64, centred: i64, seed: i64,
) -> i64:  # fmt: skip
    """Take a sample of those pixels of a lattice within the tile that have `left` to take; how many rays."""
    sights, count = scratch(1536), 0  # 64 rays
    for j in range(lattice.together):
        for i in range(lattice.together):
            x, y = lattice.x + i * lattice.across, lattice.y + j * lattice.down
            if x < x0 or x >= x1 or y < y0 or y >= y1:
                continue
            pixel = y * width + x
            s = samples_taken(film, pixel)
            if i64(i32_at(target, pixel)) - s != left:
                continue
            at = aim(world, sampler, filters, x, y, s, expected, centred, seed)
            if not dot(at.ray.direction, at.ray.direction) > 0.0:  # see `look`
                add_sample(film, pixel, grey(0.0), at.weight)
                continue
            sight = sight_of(sights, count)
            write_sight(sight, at.ray, at.draws)
            f64_put(sight, SO_FAR, brightness_so_far(film, pixel))
            i64_put(sight, MINE, pixel)
            f64_put(sight, MINE + 1, at.weight)
            count += 1
    rays = radiance_of_group(integrator, world, sights, count)
    for k in range(count):
        sight = sight_of(sights, k)
        add_sample(film, i64_at(sight, MINE), vec3_at(sight, COLOR), f64_at(sight, MINE + 1))
    return rays
