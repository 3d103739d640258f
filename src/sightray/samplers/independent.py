"""Random numbers that know nothing of one another."""

from __future__ import annotations

from sightray._jit import implements
from sightray.mathlib.rng import stream, uniform
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table
from sightray.samplers.base import Draws, Pair, Sampler, draw


class IndependentSampler(Sampler):
    """Uniform and independent: the plain Monte Carlo method, whose error falls as one over the root of the samples.

    What all other samplers are measured against.
    """


@implements(draw, IndependentSampler)
def draw_independently(sampler: Table, draws: Draws, dimension: i64) -> Pair:
    key = stream(draws.key, draws.sample)
    return Pair(uniform(key, 2 * dimension), uniform(key, 2 * dimension + 1))
