"""Halton's sequence, one prime for every dimension, scrambled."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray._jit import implements, kernel
from sightray.fields import derived_array
from sightray.mathlib.digits import LOW, reverse_bits, scramble_reversed, shuffled
from sightray.mathlib.rng import uniform, word
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, i64_at, table_at
from sightray.samplers.base import Draws, Pair, Sampler, draw

GROUP = 4  # pairs that are spread together: with larger primes, too few samples make lattices of their pairs
PRIMES = np.array([p for p in range(2, 20) if all(p % q for q in range(2, p))], np.int64)
RUN = 4096  # samples whose order is shuffled; as many digits are scrambled as number them


class HaltonSampler(Sampler):
    """Every dimension is a van der Corput sequence in a base of its own, the primes from 2 on.

    Coordinate k of sample i mirrors the digits of i in base p_k at the point: 0.d0 d1 d2 ... (J. H. Halton, Numerische
    Mathematik 2, 1960). Eight dimensions of a bounce are evenly spread *together*, which pairs of `SobolSampler` are not;
    but the higher the prime, the more samples that takes. Each digit d becomes (a d + c) mod p with random a and c of
    its place (J. Matousek, "On the L2-discrepancy for anchored boxes", J. Complexity 14, 1998). After eight
    dimensions primes start with 2 and 3 again, over a shuffled order of the samples, which knows nothing of the others; so
    there are no large primes, of which few samples would show stripes, however many dimensions a path has.
    """

    _primes: Any = derived_array("one prime for each of the dimensions that belong together", lambda sampler: PRIMES)


(PRIMES_AT,) = HaltonSampler.offsets()


@implements(draw, HaltonSampler)
def draw_halton(sampler: Table, draws: Draws, dimension: i64) -> Pair:
    group, axis = dimension // GROUP, dimension % GROUP
    order = shuffled(draws.sample, word(draws.key, -1 - group) & LOW)
    index = draws.sample // RUN * RUN + order % RUN
    primes = table_at(sampler, PRIMES_AT)
    a, b = word(draws.key, 2 * dimension), word(draws.key, 2 * dimension + 1)
    if axis == 0:
        u = ((reverse_bits(scramble_reversed(index, a & LOW)) >> 32) & LOW) * 2.0**-32
    else:
        u = radical_inverse(index, i64_at(primes, 2 * axis), a)
    return Pair(u, radical_inverse(index, i64_at(primes, 2 * axis + 1), b))


@kernel
def radical_inverse(index: i64, base: i64, key: i64) -> f64:
    """The digits of an index, scrambled and mirrored at the point, with random digits behind."""
    value, scale = 0.0, 1.0
    reach = 1  # numbers that the digits so far can tell apart
    place = 0
    while reach < RUN or index > 0:
        bits = word(key, place)
        factor = 1 + (((bits & LOW) * (base - 1)) >> 32)
        offset = (((bits >> 32) & LOW) * base) >> 32
        scale /= base
        value += ((factor * (index % base) + offset) % base) * scale
        index //= base
        reach *= base
        place += 1
    return min(value + uniform(key, place) * scale, 1.0 - 2.0**-53)
