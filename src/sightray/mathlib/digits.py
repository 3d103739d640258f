"""Digits of whole numbers, scrambled and permuted: what low-discrepancy samplers are made of.

Owen scrambling flips every binary digit of a number by a random bit that belongs to the digits before it (A. Owen,
"Randomly permuted (t,m,s)-nets and (t,s)-sequences", MCQMC 1995). A hash in which every bit depends on the bits below
it alone does that to a number whose digits stand in reverse order (S. Laine, T. Karras, "Stratified sampling for
stochastic transparency", EGSR 2011); the constants are those of N. Vegdahl, "Building a better LK hash" (2021), who
searched for the most even ones. Used on the digits of an index, the same shuffles a sequence without breaking its runs
of 2, 4, 8 ... points apart (B. Burley, "Practical hash-based Owen scrambling", JCGT 9(4), 2020).
"""

from __future__ import annotations

from sightray._jit import kernel, primitive
from sightray.mathlib.rng import word
from sightray.mathlib.scalars import i64

LOW = 0xFFFFFFFF  # numbers here have 32 bits
TURNS = 3  # of a hash: with fewer, some permutations of five numbers come up a fifth more often than others


@primitive
def reverse_bits(x: i64) -> i64:
    """All 64 bits in reverse order."""
    reversed_ = int(f"{x & ((1 << 64) - 1):064b}"[::-1], 2)
    return reversed_ - (1 << 64) if reversed_ >> 63 else reversed_


@kernel
def scramble_reversed(x: i64, seed: i64) -> i64:
    """Owen-scramble 32 digits of which the lowest bit is the leading one; `seed` has 32 bits."""
    x = (x ^ (x * 0x3D20ADEA)) & LOW
    x = ((x + seed) * ((seed >> 16) | 1)) & LOW
    x = (x ^ (x * 0x05526C56)) & LOW
    return (x ^ (x * 0x53A22864)) & LOW


@kernel
def shuffled(index: i64, seed: i64) -> i64:
    """An index of 32 bits, moved about within every aligned run of 2, 4, 8 ... indices."""
    digits = scramble_reversed((reverse_bits(index) >> 32) & LOW, seed)
    return (reverse_bits(digits) >> 32) & LOW


@kernel
def sobol_y(index: i64) -> i64:
    """Second coordinate of Sobol's point of that index, as 32 reversed digits; the first is the index itself.

    Its generator matrix is Pascal's triangle modulo 2, the fifth Kronecker power of ((1, 1), (0, 1)): so five steps do.
    """
    index ^= (index & 0xAAAAAAAA) >> 1
    index ^= (index & 0xCCCCCCCC) >> 2
    index ^= (index & 0xF0F0F0F0) >> 4
    index ^= (index & 0xFF00FF00) >> 8
    return index ^ ((index & 0xFFFF0000) >> 16)


@kernel
def permuted(i: i64, n: i64, key: i64) -> i64:
    """Where a random permutation of the numbers 0 to n - 1 puts `i`; `key`, 64 random bits, says which permutation.

    A hash that is one-to-one on the next power of two is applied until it comes back into range (A. Kensler,
    "Correlated multi-jittered sampling", Pixar technical memo 13-01, 2013).
    """
    mask: i64 = 1
    half: i64 = 1
    while mask < n - 1:
        mask = 2 * mask + 1
    while mask >> (2 * half) > 0:
        half += 1
    while True:
        for turn in range(TURNS):
            k = word(key, turn)
            i = ((i ^ k) * ((k >> 16) | 1)) & mask
            i ^= i >> half
            i = ((i + (k >> 32)) * ((k >> 48) | 1)) & mask
            i ^= i >> 1
        i = (i + key) & mask
        if i < n:
            return i
