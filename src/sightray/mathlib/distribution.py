"""A density on the unit square that is constant in each cell of a grid, and how to draw points from it.

A row is drawn by the sums of the rows' weights, then a column of it by the sums within the row, each by inverting the
cumulated sums. Neighbouring numbers give neighbouring points, so well-distributed numbers stay well distributed
(M. Pharr, W. Jakob, G. Humphreys, "Physically Based Rendering", 4th ed. 2023, section A.5).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sightray._jit import kernel, primitive
from sightray.mathlib.eights import F64x8, I64x8, gather8d, select8i, splat8d, splat8i, vmin8d
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, aligned, f64_at

BELOW_ONE = 1.0 - 2.0**-53
NEVER = 2.0  # a sum that no number reaches


class CellDraw(NamedTuple):
    """A point that was drawn: its cell, and where in it."""

    row: i64
    column: i64
    probability: f64  # of the cell
    u: f64  # along the row, in [0, 1)
    v: f64  # across


class CellDraw8(NamedTuple):
    """`CellDraw` for eight paths."""

    row: I64x8
    column: I64x8
    probability: F64x8
    u: F64x8
    v: F64x8


def cumulated(weights: np.ndarray) -> np.ndarray:
    """The table that the kernels read, float64.

    First h + 1 sums over rows. Then, of the w + 1 sums within each row, every 64th, which few lines of a cache hold; then
    every eighth, of which a line has what is between two of the former; then all. Rows are filled up to whole 64s with
    what is never drawn.

    `weights` is (h, w) and not negative; cells without weight are never drawn. If there is no weight at all, all cells
    are alike.
    """
    h, w = weights.shape
    weights = np.asarray(weights, np.float64)
    rows = weights.sum(axis=1)
    if not rows.any():
        weights, rows = np.ones((h, w)), np.full(h, float(w))
    places, length = places_of(w, h), 64 * coarsest(w)
    table = aligned(places.every + h * length, np.float64)
    table[: h + 1] = np.concatenate([[0.0], rows.cumsum()])
    table[1 : h + 1] /= table[h]
    within = table[places.every :].reshape(h, length)
    within[:, 0], within[:, w + 1 :] = 0.0, NEVER
    np.cumsum(weights, axis=1, out=within[:, 1 : w + 1])
    within[:, 1 : w + 1] /= np.where(within[:, w : w + 1] > 0.0, within[:, w : w + 1], 1.0)
    for place, step in ((places.every_64th, 64), (places.every_8th, 8)):
        chosen = within[:, ::step].ravel()
        table[place : place + chosen.size] = chosen
    return table


class Places(NamedTuple):
    """At which words of the table the sums within rows begin."""

    every_64th: i64
    every_8th: i64
    every: i64


@kernel
def coarsest(w: i64) -> i64:
    """How many of the w + 1 sums within a row are each 64th."""
    return w // 64 + 1


@kernel
def places_of(w: i64, h: i64) -> Places:
    """Where sums begin, in whole lines of a cache."""
    rows, coarse = h // 8 * 8 + 8, (h * coarsest(w) + 7) // 8 * 8
    return Places(rows, rows + coarse, rows + coarse + 8 * h * coarsest(w))


@kernel
def draw_cell(table: Table, w: i64, h: i64, u: f64, v: f64) -> CellDraw:
    """Draw a point by two uniform numbers: u for the column, v for the row."""
    row, coarse, places = interval(table, 0, h, v), coarsest(w), places_of(w, h)
    column = 8 * interval(table, places.every_64th + row * coarse, coarse, u)
    column = 8 * (column + interval(table, places.every_8th + row * 8 * coarse + column, 8, u))
    start = places.every + row * 64 * coarse
    column += interval(table, start + column, 8, u)
    low, share = f64_at(table, row), f64_at(table, row + 1) - f64_at(table, row)
    left, part = f64_at(table, start + column), f64_at(table, start + column + 1) - f64_at(table, start + column)
    return CellDraw(row, column, share * part, min((u - left) / part, BELOW_ONE), min((v - low) / share, BELOW_ONE))


@kernel
def cell_probability(table: Table, w: i64, h: i64, row: i64, column: i64) -> f64:
    """Probability with which `draw_cell` draws a cell."""
    at = places_of(w, h).every + row * 64 * coarsest(w) + column
    return (f64_at(table, row + 1) - f64_at(table, row)) * (f64_at(table, at + 1) - f64_at(table, at))


@primitive
def step_if(half: i64, y: f64, x: f64) -> i64:
    """`half`, at most 2^32, where y <= x, else 0; for numbers that are not negative. It never becomes a branch."""
    return half if y <= x else 0


@kernel
def interval(table: Table, first: i64, count: i64, x: f64) -> i64:
    """The interval k of `count` with sums[k] <= x < sums[k + 1], of sums that start at word `first`, for 0 <= x < 1."""
    low, left = first, count
    while left > 1:  # nobody could foresee a branch that depends on x
        half = left >> 1
        low += step_if(half, f64_at(table, low + half), x)
        left -= half
    return low - first


@kernel
def draw_cell8(table: Table, w: i64, h: i64, u: F64x8, v: F64x8) -> CellDraw8:
    """`draw_cell` for eight paths."""
    row, coarse, places = interval8(table, splat8i(0), h, v), coarsest(w), places_of(w, h)
    column = interval8(table, row * coarse + places.every_64th, coarse, u) * 8
    column = (column + interval8(table, row * (8 * coarse) + column + places.every_8th, 8, u)) * 8
    start = row * (64 * coarse) + places.every
    column = column + interval8(table, start + column, 8, u)
    low = gather8d(table, row)
    left = gather8d(table, start + column)
    share, part = gather8d(table, row + 1) - low, gather8d(table, start + column + 1) - left
    most = splat8d(BELOW_ONE)
    return CellDraw8(row, column, share * part, vmin8d((u - left) / part, most), vmin8d((v - low) / share, most))


@kernel
def cell_probability8(table: Table, w: i64, h: i64, row: I64x8, column: I64x8) -> F64x8:
    """`cell_probability` for eight paths."""
    at = row * (64 * coarsest(w)) + column + places_of(w, h).every
    rows, columns = gather8d(table, row + 1) - gather8d(table, row), gather8d(table, at + 1) - gather8d(table, at)
    return rows * columns


@kernel
def interval8(table: Table, first: I64x8, count: i64, x: F64x8) -> I64x8:
    """`interval` for eight numbers side by side, each among its own sums."""
    low, left = first, count
    while left > 1:
        half = left >> 1
        middle = low + half
        low = select8i(gather8d(table, middle) <= x, middle, low)
        left -= half
    return low - first
