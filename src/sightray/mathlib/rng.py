"""Random numbers without state: a number is a hash of who asks for it.

`stream` names a pixel's sample; `uniform` gives the number of one of its dimensions. So the same seed gives the same
picture for any number of threads, any tile size and any order.

References: G. Steele, D. Lea, C. Flood, "Fast splittable pseudorandom number generators" (OOPSLA 2014), whose
output function (variant 13 of D. Stafford) mixes the bits.
"""

from __future__ import annotations

from sightray._jit import primitive
from sightray.mathlib.scalars import f64, i64

_MASK = (1 << 64) - 1
GOLDEN = 0x9E3779B97F4A7C15
MIX = ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB))


def _mix(x: int) -> int:
    for shift, factor in MIX:
        x = ((x ^ (x >> shift)) * factor) & _MASK
    return x ^ (x >> 31)


def _signed(x: int) -> int:
    return x - (1 << 64) if x >> 63 else x


@primitive
def stream(key: i64, index: i64) -> i64:
    """The key of sub-stream `index` of stream `key`: nest seed, pixel and sample."""
    return _signed(_mix((_mix((key + GOLDEN) & _MASK) + index * GOLDEN) & _MASK))


@primitive
def word(key: i64, dimension: i64) -> i64:
    """The 64 random bits from which `uniform` takes its number."""
    return _signed(_mix((key + (dimension + 1) * GOLDEN) & _MASK))


@primitive
def uniform(key: i64, dimension: i64) -> f64:
    """Uniform number in [0, 1) with 53 random bits, for one dimension of a stream."""
    return (_mix((key + (dimension + 1) * GOLDEN) & _MASK) >> 11) * 2.0**-53
