"""Neighbouring pixels share a sequence, so that their errors cancel."""

from __future__ import annotations

from itertools import permutations

from sightray._jit import implements, kernel
from sightray.mathlib.digits import LOW, shuffled
from sightray.mathlib.rng import stream, word
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table
from sightray.samplers.base import BLOCK, Draws, Pair, Sampler, begin, draw
from sightray.samplers.sobol import scrambled_pair, sobol_pair

RUN = 4  # samples that are spread together where it is not known how many there will be
LEVELS = 6  # of quadrants: a sequence serves a square of 64 by 64 pixels
SIDE = 1 << LEVELS
NEAR = 3 * BLOCK  # dimensions of the ray of sight and its first bounce


def _orders() -> tuple[int, ...]:
    """The 24 orders of four quadrants: two bits for each quadrant's place, eight orders to a word."""
    bits = [sum(place << (2 * child) for child, place in enumerate(order)) for order in permutations(range(4))]
    words = [sum(order << (8 * k) for k, order in enumerate(bits[first : first + 8])) for first in (0, 8, 16)]
    return tuple(w - (1 << 64) if w >> 63 else w for w in words)


ORDERS = _orders()


class BlueNoiseSampler(Sampler):
    """The same error as `SobolSampler`, spread over the picture as fine grain that the eye averages out.

    One Sobol sequence runs through the pixels of a square, quadrant by quadrant, each quadrant's four parts in random
    order: so every quadrant of every size gets a run of points that is evenly spread as a whole, and if one pixel's
    estimate is too high, its neighbours' is too low (A. G. M. Ahmed, P. Wonka, "Screen-space blue-noise diffusion of
    Monte Carlo sampling error via hierarchical ordering of pixels", ACM TOG 39(6), 2020). Bounces after the first are
    drawn as in `SobolSampler`. Best with few samples, in powers of two, and a narrow filter.
    """

    counts = True


@implements(begin, BlueNoiseSampler)
def begin_in_run(sampler: Table, x: i64, y: i64, seed: i64, sample: i64, samples: i64) -> Draws:
    run: i64 = 1
    while run < (samples if samples > 0 else RUN):
        run *= 2
    key = stream(stream(stream(seed, sample // run), x // SIDE), y // SIDE)
    return Draws(sampler, x + (y << 16), key, sample % run, run, 0)


@implements(draw, BlueNoiseSampler)
def draw_blue_noise(sampler: Table, draws: Draws, dimension: i64) -> Pair:
    if dimension >= NEAR:
        return sobol_pair(draws.sample, stream(draws.key, draws.pixel), dimension)
    key = stream(draws.key, dimension)
    place = quadrants(draws.pixel, key)
    index = place * draws.samples + shuffled(draws.sample, word(key, place) & LOW) % draws.samples
    return scrambled_pair(index, word(key, -1))


@kernel
def quadrants(pixel: i64, key: i64) -> i64:
    """Number of a pixel in its square: a base-4 digit for each level of quadrants, in an order of that quadrant's own."""
    x, y = pixel & (SIDE - 1), (pixel >> 16) & (SIDE - 1)
    place = 0
    for level in range(LEVELS - 1, -1, -1):
        above = (1 << LEVELS) + ((y >> (level + 1)) << LEVELS) + (x >> (level + 1))
        order = ((word(key, -2 - (above << 3) - level) & LOW) * 24) >> 32
        orders = ORDERS[0] if order < 8 else ORDERS[1] if order < 16 else ORDERS[2]
        child = 2 * ((y >> level) & 1) + ((x >> level) & 1)
        place = 4 * place + ((orders >> (8 * (order & 7) + 2 * child)) & 3)
    return place
