"""Drawing from cells against a search by NumPy among all sums."""

from __future__ import annotations

import numpy as np
import pytest

from sightray._jit import kernel, native
from sightray.mathlib.distribution import coarsest, cumulated, draw_cell, places_of
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, f64_at, f64_put


@kernel
def draw_all(table: Table, w: i64, h: i64, numbers: Table, n: i64, out: Table) -> None:
    """Row, column, probability and place in the cell for n pairs of numbers."""
    for k in range(n):
        drawn = draw_cell(table, w, h, f64_at(numbers, 2 * k), f64_at(numbers, 2 * k + 1))
        f64_put(out, 5 * k, float(drawn.row))
        f64_put(out, 5 * k + 1, float(drawn.column))
        f64_put(out, 5 * k + 2, drawn.probability)
        f64_put(out, 5 * k + 3, drawn.u)
        f64_put(out, 5 * k + 4, drawn.v)


def pictures():
    rng = np.random.default_rng(1)
    spots = np.zeros((40, 70))
    spots[3, 5], spots[3, 69], spots[39, 0] = 1.0, 1e-9, 1e9
    yield "one cell", np.ones((1, 1))
    yield "nothing", np.zeros((4, 3))
    yield "even", np.ones((16, 64))
    yield "noise", rng.random((33, 57))
    yield "holes", rng.random((20, 31)) * (rng.random((20, 31)) < 0.2) * (rng.random((20, 1)) < 0.5)
    yield "spots", spots
    yield "steep", 10.0 ** rng.uniform(-30, 30, (25, 50))
    for width in (7, 8, 63, 64, 65, 127, 128):  # about whole lines of a cache
        yield f"{width} columns", rng.random((3, width)) ** 4
    yield "row", rng.random((1, 500)) ** 8
    yield "column", rng.random((500, 1)) ** 8


@pytest.mark.parametrize("weights", [pytest.param(w, id=name) for name, w in pictures()])
def test_cells_are_those_whose_sums_hold_the_numbers(weights):
    h, w = weights.shape
    table = cumulated(weights)
    rows, within = table[: h + 1], table[places_of(w, h).every :].reshape(h, 64 * coarsest(w))[:, : w + 1]
    rng = np.random.default_rng(2)
    # Numbers anywhere, and at and beside the sums.
    sums = np.concatenate([rows, within.ravel()])
    special = rng.choice(np.concatenate([sums, np.nextafter(sums, 0), np.nextafter(sums, 1)]), (3000, 2))
    numbers = np.clip(np.concatenate([rng.random((3000, 2)), special]), 0.0, 1.0 - 2.0**-53)
    out = np.empty((len(numbers), 5))
    native(draw_all)(Table(table), w, h, Table(np.ascontiguousarray(numbers)), len(numbers), Table(out))

    row = np.searchsorted(rows, numbers[:, 1], side="right") - 1
    column = np.array(
        [np.searchsorted(within[r], x, side="right") - 1 for r, x in zip(row, numbers[:, 0], strict=True)]
    )
    np.testing.assert_array_equal(out[:, 0], row)
    np.testing.assert_array_equal(out[:, 1], column)
    share = weights / weights.sum() if weights.any() else np.full((h, w), 1.0 / (h * w))
    np.testing.assert_allclose(out[:, 2], share[row, column], rtol=1e-6, atol=1e-15)
    assert (out[:, 2] > 0.0).all()
    assert ((out[:, 3:] >= 0.0) & (out[:, 3:] < 1.0)).all()
