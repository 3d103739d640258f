"""Sorting rows of a table in place."""

from __future__ import annotations

from sightray._jit import kernel
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, f64_at, i64_at, i64_put


@kernel
def swap_rows(rows: Table, a: i64, b: i64, first_word: i64, words: i64) -> None:
    """Exchange the words of two rows of `words` words each, from `first_word` on."""
    for k in range(first_word, words):
        kept = i64_at(rows, a * words + k)
        i64_put(rows, a * words + k, i64_at(rows, b * words + k))
        i64_put(rows, b * words + k, kept)


@kernel
def sort_rows(rows: Table, first: i64, count: i64, words: i64) -> None:
    """Sort rows of `words` words by the double in their first word, ascending, in place (D. Shell, 1959).

    Lists are short as a rule, and then this is insertion sort; long ones cost about n^1.3.
    """
    gap = 1
    while gap < count // 3:
        gap = 3 * gap + 1  # the gaps of D. Knuth (1973)
    while gap > 0:
        for i in range(first + gap, first + count):
            j = i
            while j >= first + gap and f64_at(rows, (j - gap) * words) > f64_at(rows, j * words):
                swap_rows(rows, j - gap, j, 0, words)
                j -= gap
        gap //= 3
