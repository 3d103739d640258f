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

import functools
from typing import ClassVar, NamedTuple

from sightray._jit import implements, kernel, method
from sightray.mathlib.eights import F64x8, I64x8, load8d, splat8i, store8i, stream8
from sightray.mathlib.rng import stream
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_put, i64_at, scratch
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


class Pair8(NamedTuple):
    """A pair for each of eight paths."""

    u: F64x8
    v: F64x8


class Draws8(NamedTuple):
    """Which random numbers come next, for eight paths that are equally far."""

    sampler: Table
    pixel: I64x8
    key: I64x8
    sample: I64x8
    samples: i64
    dimension: i64


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


@method(2, form_of=(draw,))
def draw_eight(sampler: Table, draws: Draws8, dimension: i64) -> Pair8:
    """`draw` for eight paths."""
    raise NotImplementedError


@implements(draw_eight, Sampler)
def draw_one_by_one(sampler: Table, draws: Draws8, dimension: i64) -> Pair8:
    words = scratch(40)
    store8i(words, 0, draws.pixel)
    store8i(words, 8, draws.key)
    store8i(words, 16, draws.sample)
    for k in range(8):
        one = Draws(
            sampler, i64_at(words, k), i64_at(words, 8 + k), i64_at(words, 16 + k), draws.samples, draws.dimension
        )  # fmt: skip
        found = draw(sampler, one, dimension)
        f64_put(words, 24 + k, found.u)
        f64_put(words, 32 + k, found.v)
    return Pair8(load8d(words, 24), load8d(words, 32))


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
def pair8(draws: Draws8, dimension: i64) -> Pair8:
    """`pair` for eight paths."""
    return draw_eight(draws.sampler, draws, draws.dimension + dimension)


@kernel
def nested8(draws: Draws8, level: i64) -> Draws8:
    """`nested` for eight paths."""
    return Draws8(
        draws.sampler, draws.pixel, stream8(draws.key, splat8i(level)), draws.sample, draws.samples,
        draws.dimension + (level + 1) * BLOCK,
    )  # fmt: skip


@kernel
def one_of8(draws: Draws8, k: i64, count: i64) -> Draws8:
    """`one_of` for eight paths."""
    return Draws8(
        draws.sampler, draws.pixel, draws.key, draws.sample * count + k, draws.samples * count, draws.dimension
    )  # fmt: skip


@kernel
def one_of(draws: Draws, k: i64, count: i64) -> Draws:
    """The draws of number k of `count` samples that stand in the place of one, spread as evenly as all others are."""
    return Draws(
        draws.sampler, draws.pixel, draws.key, draws.sample * count + k, draws.samples * count, draws.dimension
    )  # fmt: skip


@functools.cache
def default_sampler() -> Sampler:
    """The sampler of pictures for which none is chosen; always the same, so that a scene packs it once."""
    from sightray.samplers.sobol import SobolSampler

    return SobolSampler()
