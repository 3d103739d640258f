"""One sample in every cell of a grid, with the fine strata of both axes filled too."""

from __future__ import annotations

import math

from sightray._jit import implements
from sightray.mathlib.digits import permuted
from sightray.mathlib.rng import stream, uniform, word
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table
from sightray.samplers.base import Draws, Pair, Sampler, begin, draw

PATTERN = 16  # samples of a pattern where it is not known how many there will be


class StratifiedSampler(Sampler):
    """Correlated multi-jittered samples: n samples lie one in each cell of a grid, and one in each of n strips.

    A grid of about root n columns and rows is jittered so that every one of the n strips along y, and where the grid
    is full along x, has one sample; strips are chosen by row and column alone, which keeps samples of neighbouring
    cells apart (A. Kensler, "Correlated multi-jittered sampling", Pixar technical memo 13-01, 2013). Pairs are
    shuffled against one another. Samples beyond the number asked for start further patterns; where that number is not
    known, a pattern has 16.
    """

    counts = True


@implements(begin, StratifiedSampler)
def begin_pattern(sampler: Table, x: i64, y: i64, seed: i64, sample: i64, samples: i64) -> Draws:
    count = samples if samples > 0 else PATTERN
    pixel = x + (y << 16)
    return Draws(sampler, pixel, stream(stream(seed, pixel), sample // count), sample % count, count, 0)


@implements(draw, StratifiedSampler)
def draw_stratified(sampler: Table, draws: Draws, dimension: i64) -> Pair:
    key = stream(draws.key, dimension)
    count = draws.samples
    columns = int(math.sqrt(float(count)))
    rows = (count + columns - 1) // columns
    s = permuted(draws.sample, count, word(key, 0))
    column = permuted(s % columns, columns, word(key, 1))
    strip = permuted(s // columns, rows, word(key, 2))
    jitter = word(key, 3)
    u = (column + (strip + uniform(jitter, 2 * s)) / rows) / columns
    return Pair(min(u, 1.0 - 2.0**-53), min((s + uniform(jitter, 2 * s + 1)) / count, 1.0 - 2.0**-53))
