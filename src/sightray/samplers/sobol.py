"""Sobol's first two dimensions, scrambled anew for every pair."""

from __future__ import annotations

from sightray._jit import implements, kernel
from sightray.mathlib.digits import LOW, reverse_bits, scramble_reversed, shuffled, sobol_y
from sightray.mathlib.eights import (
    I64x8,
    reverse8,
    scramble_reversed8,
    sobol_y8,
    splat8i,
    whole8d,
    word8,
)
from sightray.mathlib.rng import word
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table
from sightray.samplers.base import Draws, Draws8, Pair, Pair8, Sampler, draw, draw_eight

UNIT = 2.0**-32


class SobolSampler(Sampler):
    """Every pair of numbers is a (0,2)-sequence of its own: evenly spread after any number of samples.

    Of the first 2^k samples of a pixel, each of the 2^k rectangles of every division of the unit square into equal
    rectangles holds exactly one. Pairs, bounces and pixels know nothing of one another: each shuffles the sequence's
    order and scrambles its digits by hashes (B. Burley, "Practical hash-based Owen scrambling", JCGT 9(4), 2020). So a
    picture's error falls faster than one over the root of the samples wherever light changes smoothly with the numbers
    that are drawn, and is never worse than that of independent numbers in the long run. Powers of two of samples are
    best.
    """


@implements(draw, SobolSampler)
def draw_sobol(sampler: Table, draws: Draws, dimension: i64) -> Pair:
    return sobol_pair(draws.sample, draws.key, dimension)


@kernel
def sobol_pair(sample: i64, key: i64, dimension: i64) -> Pair:
    """A point of the sequence that belongs to a key and dimension: shuffled, then scrambled."""
    a, b = word(key, 2 * dimension), word(key, 2 * dimension + 1)
    return scrambled_pair(shuffled(sample, b & LOW), a)


@kernel
def scrambled_pair(index: i64, seeds: i64) -> Pair:
    """Sobol's point of an index, each coordinate scrambled by half of the seeds."""
    u = scramble_reversed(index, seeds & LOW)
    v = scramble_reversed(sobol_y(index), (seeds >> 32) & LOW)
    both = reverse_bits(u | (v << 32))
    return Pair(((both >> 32) & LOW) * UNIT, (both & LOW) * UNIT)


@implements(draw_eight, SobolSampler)
def draw_sobol_eight(sampler: Table, draws: Draws8, dimension: i64) -> Pair8:
    a, b = word8(draws.key, splat8i(2 * dimension)), word8(draws.key, splat8i(2 * dimension + 1))
    return scrambled_pair8(shuffled8(draws.sample, b & LOW), a)


@kernel
def shuffled8(index: I64x8, seed: I64x8) -> I64x8:
    """`shuffled` for eight indices."""
    digits = scramble_reversed8((reverse8(index) >> 32) & LOW, seed)
    return (reverse8(digits) >> 32) & LOW


@kernel
def scrambled_pair8(index: I64x8, seeds: I64x8) -> Pair8:
    """`scrambled_pair` for eight indices."""
    u = scramble_reversed8(index, seeds & LOW)
    v = scramble_reversed8(sobol_y8(index), (seeds >> 32) & LOW)
    both = reverse8(u | (v << 32))
    return Pair8(whole8d((both >> 32) & LOW) * UNIT, whole8d(both & LOW) * UNIT)
