"""The contract of samplers.

A sample of a pixel is a point of a unit cube of many dimensions: two for the place in the pixel, two for the lens, one
for the time, and several for every bounce. A sampler says where the points fall. Whoever needs numbers is handed
`Draws`, asks for pairs (dimensions that belong together, such as the two coordinates on a light) by small constants,
and gives `nested` draws to the next bounce:

    u, v = pair(draws, LIGHT)
    below = nested(draws, depth)

All is stateless: a pair is a function of the pixel, the sample's number and the dimension, so a picture does not depend
on threads, tiles or order, and an interrupted one goes on where it was.
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple

from sightray._jit import implements, kernel, method
from sightray.mathlib.rng import stream
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table
from sightray.registry import Member

BLOCK = 16  # dimensions that a bounce may use


class Pair(NamedTuple):
    """Two numbers in [0, 1)."""

    u: f64
    v: f64


class Draws(NamedTuple):
    """Which random numbers come next."""

    sampler: Table
    pixel: i64  # column + 65536 row
    key: i64  # names the pixel and the bounce
    sample: i64  # its number in the pixel
    samples: i64  # that the pixel will take; 0 where that is not known
    dimension: i64  # dimensions that came before


class Sampler(Member, family="samplers"):
    """Base of all samplers."""

    counts: ClassVar[bool] = False  # whether the pattern depends on how many samples a pixel takes


@method(0)
def draw(sampler: Table, draws: Draws, dimension: i64) -> Pair:
    """The pair of numbers of one dimension; `dimension` counts pairs, from the first of all."""
    raise NotImplementedError


@method(1)
def begin(sampler: Table, x: i64, y: i64, seed: i64, sample: i64, samples: i64) -> Draws:
    """The draws of sample number `sample` of the pixel in column x and row y, which takes `samples`; 0: not known."""
    raise NotImplementedError


@implements(begin, Sampler)
def begin_with_pixel(sampler: Table, x: i64, y: i64, seed: i64, sample: i64, samples: i64) -> Draws:
    pixel = x + (y << 16)
    return Draws(sampler, pixel, stream(seed, pixel), sample, samples, 0)


@kernel
def pair(draws: Draws, dimension: i64) -> Pair:
    """Two numbers in [0, 1) that belong together."""
    return draw(draws.sampler, draws, draws.dimension + dimension)


@kernel
def number(draws: Draws, dimension: i64) -> f64:
    """One number in [0, 1); it takes a dimension of pairs for itself."""
    return pair(draws, dimension).u


@kernel
def nested(draws: Draws, level: i64) -> Draws:
    """Draws for bounce number `level` of a path, with a block of dimensions of its own."""
    return Draws(
        draws.sampler, draws.pixel, stream(draws.key, level), draws.sample, draws.samples,
        draws.dimension + (level + 1) * BLOCK,
    )  # fmt: skip


@kernel
def one_of(draws: Draws, k: i64, count: i64) -> Draws:
    """The draws of number k of `count` samples that stand in the place of one, spread as evenly as all others are."""
    return Draws(
        draws.sampler, draws.pixel, draws.key, draws.sample * count + k, draws.samples * count, draws.dimension
    )  # fmt: skip


def default_sampler() -> Sampler:
    """The sampler of pictures for which none is chosen."""
    from sightray.samplers.sobol import SobolSampler

    return SobolSampler()
