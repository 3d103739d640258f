"""A density on the unit square that is constant in each cell of a grid, and how to draw points from it.

A row is drawn by the sums of the rows' weights, then a column of it by the sums within the row, each by inverting the
cumulated sums. Neighbouring numbers give neighbouring points, so well-distributed numbers stay well distributed
(M. Pharr, W. Jakob, G. Humphreys, "Physically Based Rendering", 4th ed. 2023, section A.5).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sightray._jit import kernel
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at

BELOW_ONE = 1.0 - 2.0**-53


class CellDraw(NamedTuple):
    """A point that was drawn: its cell, and where in it."""

    row: i64
    column: i64
    probability: f64  # of the cell
    u: f64  # along the row, in [0, 1)
    v: f64  # across


def cumulated(weights: np.ndarray) -> np.ndarray:
    """The table that the kernels read, float64: h + 1 sums over rows, then w + 1 within each of the h rows.

    `weights` is (h, w) and not negative; cells without weight are never drawn. If there is no weight at all, all cells
    are alike.
    """
    h, w = weights.shape
    weights = np.asarray(weights, np.float64)
    rows = weights.sum(axis=1)
    if not rows.any():
        weights, rows = np.ones((h, w)), np.full(h, float(w))
    table = np.zeros(h + 1 + h * (w + 1))
    table[1 : h + 1] = rows.cumsum()
    table[1 : h + 1] /= table[h]
    within = table[h + 1 :].reshape(h, w + 1)
    np.cumsum(weights, axis=1, out=within[:, 1:])
    within[:, 1:] /= np.where(within[:, -1:] > 0.0, within[:, -1:], 1.0)
    return table


@kernel
def draw_cell(table: Table, w: i64, h: i64, u: f64, v: f64) -> CellDraw:
    """Draw a point by two uniform numbers: u for the column, v for the row."""
    row = interval(table, 0, h, v)
    start = h + 1 + row * (w + 1)
    column = interval(table, start, w, u)
    low, share = f64_at(table, row), f64_at(table, row + 1) - f64_at(table, row)
    left, part = f64_at(table, start + column), f64_at(table, start + column + 1) - f64_at(table, start + column)
    return CellDraw(row, column, share * part, min((u - left) / part, BELOW_ONE), min((v - low) / share, BELOW_ONE))


@kernel
def cell_probability(table: Table, w: i64, h: i64, row: i64, column: i64) -> f64:
    """Probability with which `draw_cell` draws a cell."""
    at = h + 1 + row * (w + 1) + column
    return (f64_at(table, row + 1) - f64_at(table, row)) * (f64_at(table, at + 1) - f64_at(table, at))


@kernel
def interval(table: Table, first: i64, count: i64, x: f64) -> i64:
    """The interval k of `count` with sums[k] <= x < sums[k + 1], of sums that start at word `first`, for x < 1."""
    low, left = first, count
    while left > 1:  # without branches that depend on x, which nobody could foresee
        half = left >> 1
        low = low + half if f64_at(table, low + half) <= x else low
        left -= half
    return low - first
