"""Filter importance sampling: samples fall where the filter is, instead of being weighed by it.

A sample's offset from the pixel's centre is drawn with a density proportional to |f|, and counts with the weight
sign(f) * integral |f| / integral f, which is 1 for filters without negative lobes and 1 on average for all. Samples
then belong to one pixel each, and the noise of unequal weights is gone.

The cumulative distribution of |f| is tabulated at the ends of `CELLS` equal cells and inverted linearly within a cell; a
guide says in which cell to begin to look (H. Chen, Y. Asau, "On generating random variates from an empirical
distribution", AIIE Transactions 6, 1974). That keeps the thin tails of a filter, over which equal steps of probability
(a table of the inverse) would jump.

Reference: M. Ernst, M. Stamminger, G. Greiner, "Filter importance sampling", IEEE Symposium on Interactive Ray
Tracing, 2006.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sightray._jit import kernel
from sightray.filters.base import Filter
from sightray.mathlib.eights import F64x8, floor8i, gather8d, select8i, splat8i, whole8d
from sightray.mathlib.lanes import movemask8
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Space, Table, f64_at

CELLS = 256
NEGLIGIBLE = 1e-7  # of the value at the centre
RADIUS, CUMULATIVE, WEIGHTS = 0, 1, 1 + CELLS + 1
GUIDE = WEIGHTS + CELLS
TABLE_WORDS = GUIDE + CELLS
_POINTS = 32  # midpoints per cell; the integrals of smooth filters come out to 1e-8


class FilterSample(NamedTuple):
    """Where a sample falls along one axis, and how much it counts; the product of both axes' weights counts."""

    offset: f64  # pixels from the pixel's centre
    weight: f64


class FilterSample8(NamedTuple):
    """`FilterSample` for eight samples."""

    offset: F64x8
    weight: F64x8


def filter_table(filter: Filter, space: Space) -> Table:
    """Tabulate a filter for `sample_filter`: its radius, the distribution's `CELLS` + 1 values, a weight per cell."""
    # Spend the cells on where the filter is: a narrow bell may have a large radius.
    middles = (np.arange(CELLS * _POINTS) + 0.5) / (CELLS * _POINTS) * 2 - 1
    counts = np.abs(filter.weight(filter.radius * middles)) > NEGLIGIBLE
    r = filter.radius * min(1.0, np.abs(middles[counts]).max(initial=0.0) + 2 / (CELLS * _POINTS))

    values = filter.weight(r * middles).reshape(CELLS, _POINTS)
    signed, absolute = values.sum(axis=1), np.abs(values).sum(axis=1)
    table = space.row(TABLE_WORDS)
    words = table.view(np.float64)
    words[RADIUS] = r
    words[CUMULATIVE + 1 : CUMULATIVE + 1 + CELLS] = np.cumsum(absolute) / absolute.sum()
    words[CUMULATIVE + CELLS] = 1.0
    starts = words[CUMULATIVE : CUMULATIVE + CELLS]
    words[GUIDE : GUIDE + CELLS] = np.searchsorted(starts, np.arange(CELLS) / CELLS, side="right") - 1

    # Weigh by cells: the one in which the filter changes its sign has a weight between -1 and 1 times the others'.
    share = np.divide(signed, absolute, out=np.zeros(CELLS), where=absolute > 0)
    words[WEIGHTS : WEIGHTS + CELLS] = share * absolute.sum() / signed.sum()
    return table


@kernel
def sample_filter(filter_table: Table, u: f64) -> FilterSample:
    """Offset and weight along one axis for a random number u in [0, 1)."""
    low = int(f64_at(filter_table, GUIDE + int(u * CELLS)))
    while f64_at(filter_table, CUMULATIVE + low + 1) <= u:  # to the last cell that does not start beyond u
        low += 1
    start, end = f64_at(filter_table, CUMULATIVE + low), f64_at(filter_table, CUMULATIVE + low + 1)
    offset = f64_at(filter_table, RADIUS) * (2.0 * (low + (u - start) / (end - start)) / CELLS - 1.0)
    return FilterSample(offset, f64_at(filter_table, WEIGHTS + low))


@kernel
def sample_filter8(filter_table: Table, u: F64x8) -> FilterSample8:
    """`sample_filter` for eight random numbers."""
    low = floor8i(gather8d(filter_table, floor8i(u * CELLS) + GUIDE))
    end = gather8d(filter_table, low + (CUMULATIVE + 1))
    while movemask8(u >= end) != 0:
        low = low + select8i(u >= end, splat8i(1), splat8i(0))
        end = gather8d(filter_table, low + (CUMULATIVE + 1))
    start = gather8d(filter_table, low + CUMULATIVE)
    offset = f64_at(filter_table, RADIUS) * (2.0 * (whole8d(low) + (u - start) / (end - start)) / CELLS - 1.0)
    return FilterSample8(offset, gather8d(filter_table, low + WEIGHTS))
