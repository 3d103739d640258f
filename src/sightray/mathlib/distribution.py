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
EIGHT = 8  # sums in one line of a cache
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

    First h + 1 sums over rows; then every eighth of the w + 1 sums within each row, which are searched first, as they
    are few enough to stay in a cache; then all of these, where one line of a cache has eight. Rows are filled up to
    whole eights with what is never drawn.

    `weights` is (h, w) and not negative; cells without weight are never drawn. If there is no weight at all, all cells
    are alike.
    """
    h, w = weights.shape
    weights = np.asarray(weights, np.float64)
    rows = weights.sum(axis=1)
    if not rows.any():
        weights, rows = np.ones((h, w)), np.full(h, float(w))
    first = within_from(w, h)
    table = aligned(first + h * EIGHT * eights(w), np.float64)
    table[:] = NEVER
    table[: h + 1] = np.concatenate([[0.0], rows.cumsum()])
    table[1 : h + 1] /= table[h]
    within = table[first:].reshape(h, EIGHT * eights(w))
    within[:, 0] = 0.0
    np.cumsum(weights, axis=1, out=within[:, 1 : w + 1])
    within[:, 1 : w + 1] /= np.where(within[:, w : w + 1] > 0.0, within[:, w : w + 1], 1.0)
    table[h + 1 : h + 1 + h * eights(w)] = within[:, ::EIGHT].ravel()
    return table


@kernel
def eights(w: i64) -> i64:
    """How many eights hold w + 1 sums."""
    return w // EIGHT + 1


@kernel
def within_from(w: i64, h: i64) -> i64:
    """The word at which the sums within rows begin: a whole number of eights."""
    return (h + h * eights(w)) // EIGHT * EIGHT + EIGHT


@kernel
def draw_cell(table: Table, w: i64, h: i64, u: f64, v: f64) -> CellDraw:
    """Draw a point by two uniform numbers: u for the column, v for the row."""
    row, blocks = interval(table, 0, h, v), eights(w)
    start, block = within_from(w, h) + row * EIGHT * blocks, interval(table, h + 1 + row * blocks, blocks, u)
    column = EIGHT * block + interval(table, start + EIGHT * block, EIGHT, u)
    low, share = f64_at(table, row), f64_at(table, row + 1) - f64_at(table, row)
    left, part = f64_at(table, start + column), f64_at(table, start + column + 1) - f64_at(table, start + column)
    return CellDraw(row, column, share * part, min((u - left) / part, BELOW_ONE), min((v - low) / share, BELOW_ONE))


@kernel
def cell_probability(table: Table, w: i64, h: i64, row: i64, column: i64) -> f64:
    """Probability with which `draw_cell` draws a cell."""
    at = within_from(w, h) + row * EIGHT * eights(w) + column
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
    row, blocks = interval8(table, splat8i(0), h, v), eights(w)
    start = row * (EIGHT * blocks) + within_from(w, h)
    block = interval8(table, row * blocks + (h + 1), blocks, u) * EIGHT
    column = block + interval8(table, start + block, EIGHT, u)
    low = gather8d(table, row)
    left = gather8d(table, start + column)
    share, part = gather8d(table, row + 1) - low, gather8d(table, start + column + 1) - left
    most = splat8d(BELOW_ONE)
    return CellDraw8(row, column, share * part, vmin8d((u - left) / part, most), vmin8d((v - low) / share, most))


@kernel
def cell_probability8(table: Table, w: i64, h: i64, row: I64x8, column: I64x8) -> F64x8:
    """`cell_probability` for eight paths."""
    at = row * (EIGHT * eights(w)) + column + within_from(w, h)
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
