"""Cutting space by planes, level by level, with NumPy: what `KdTree` and `Bsp` share.

Planes have one of k given normals. A cell is known by its interval along each normal, and so is the part of a primitive
that a cell holds. Cells of a level are cut at once; what a plane cuts through stands in both halves. The best plane is
sought among `BORDERS` equidistant ones along each normal, from the beginning to the end of what the cell holds.

The cost of a cut is that of MacDonald and Booth (1990): a ray that meets the cell meets one part of it with the ratio of
their surfaces as probability. The surface of a cell is that of the smallest box around it, in the coordinate frames that
can be made of the normals: exact for boxes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

BORDERS = 33
SLIVER = 0.05  # empty space is worth a cut of its own if it is more than this part of the cell


class Heuristic(NamedTuple):
    """What a cut costs, in tests of primitives."""

    traversal: float
    empty_bonus: float  # by which part a cut gets cheaper that leaves one side empty
    leaf_size: int  # up to which cells are not cut


class Cut(NamedTuple):
    """The nodes of a tree of planes, in breadth-first order."""

    normal: np.ndarray  # (m,) number of the plane's normal; -1 for a leaf
    at: np.ndarray  # (m,) float64: where the plane is along it
    to: np.ndarray  # (m,) the first of two children, lower and upper; of a leaf, the first primitive in `order`
    size: np.ndarray  # (m,) primitives in a leaf
    order: np.ndarray


def cut_space(
    low: np.ndarray, high: np.ndarray, frames: Sequence[tuple[int, int, int]], heuristic: Heuristic, max_depth: int,
    tighten: Callable[[np.ndarray, np.ndarray], None] | None = None,
) -> Cut:  # fmt: skip
    """Cut space such that rays ask few primitives.

    Parameters
    ----------
    low, high : (n, k) float64, n > 0
        Extents of the primitives along the normals.
    frames : triples of normals that are orthogonal to one another.
    tighten : draws the conclusions, in place, from a cell's intervals along some normals for those along others.
    """
    which, cell = np.arange(len(low)), np.zeros(len(low), np.int64)
    cell_low, cell_high = low.min(axis=0)[None], high.max(axis=0)[None]
    levels, order, listed, numbered = [], [], 0, 0
    for depth in range(max_depth + 1):
        count = np.bincount(cell, minlength=len(cell_low))
        normal, at = np.full(len(count), -1), np.zeros(len(count))
        large = np.flatnonzero(count > heuristic.leaf_size) if depth < max_depth else np.empty(0, np.int64)
        if len(large):
            rank = np.full(len(count), -1)
            rank[large] = np.arange(len(large))
            of = rank[cell] >= 0
            normal[large], at[large] = _cheapest(
                rank[cell[of]], low[of], high[of], cell_low[large], cell_high[large], count[large], frames, heuristic
            )
        cut = normal >= 0

        # List the primitives of leaves.
        numbered += len(count)
        held = np.where(cut, 0, count)
        to = np.where(cut, numbered + 2 * (np.cumsum(cut) - 1), listed + np.cumsum(held) - held)
        levels.append((normal, at, to, held))
        order.append(which[~cut[cell]])
        listed += int(held.sum())
        if not cut.any():
            break

        # Send those of the others to the sides that they reach into.
        e = np.flatnonzero(cut[cell])
        along, plane = normal[cell[e]], at[cell[e]]
        lo, hi = low[e, along], high[e, along]
        below, above = (lo < plane) | (hi <= plane), hi > plane
        left, right = e[below], e[above]
        low_left, high_left, low_right, high_right = low[left], high[left], low[right], high[right]
        high_left[np.arange(len(left)), along[below]] = np.minimum(hi, plane)[below]
        low_right[np.arange(len(right)), along[above]] = np.maximum(lo, plane)[above]
        child = 2 * (np.cumsum(cut) - 1)
        which = np.concatenate([which[left], which[right]])
        cell = np.concatenate([child[cell[left]], child[cell[right]] + 1])
        sort = np.argsort(cell, kind="stable")
        which, cell = which[sort], cell[sort]
        low, high = np.concatenate([low_left, low_right])[sort], np.concatenate([high_left, high_right])[sort]
        cell_low, cell_high = np.repeat(cell_low[cut], 2, axis=0), np.repeat(cell_high[cut], 2, axis=0)
        rows = np.arange(0, len(cell_low), 2)
        cell_high[rows, normal[cut]] = cell_low[rows + 1, normal[cut]] = at[cut]
        if tighten is not None:
            tighten(cell_low, cell_high)
    normal, at, to, size = (np.concatenate(parts) for parts in zip(*levels, strict=True))
    return Cut(normal, at, to, size, np.concatenate(order))


def _cheapest(
    cell: np.ndarray, low: np.ndarray, high: np.ndarray, cell_low: np.ndarray, cell_high: np.ndarray,
    count: np.ndarray, frames: Sequence[tuple[int, int, int]], heuristic: Heuristic,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """For each cell the normal and place of the cheapest plane; the normal is -1 where a leaf is cheaper."""
    k, start, rows = len(count), np.cumsum(count) - count, np.arange(len(count))
    width = cell_high - cell_low
    boxes = [_half_area(*(width[:, j] for j in frame)) for frame in frames]
    area = np.min(boxes, axis=0)[:, None]
    area = np.where(area > 0, area, 1.0)  # products of tiny lengths may vanish; then no cut looks better than another
    best, normal, at = count.astype(float), np.full(k, -1), np.zeros(k)
    for j in range(low.shape[1]):
        begin, end = np.minimum.reduceat(low[:, j], start), np.maximum.reduceat(high[:, j], start)
        step = np.where(end > begin, (end - begin) / (BORDERS - 1), 1.0)
        plane = begin[:, None] + step[:, None] * np.arange(BORDERS)

        # Count what lies, at least in part, below and above each plane.
        first = ((low[:, j] - begin[cell]) / step[cell]).astype(np.int64).clip(0, BORDERS - 2)
        last = np.ceil((high[:, j] - begin[cell]) / step[cell]).astype(np.int64).clip(1, BORDERS - 1)
        opened = np.bincount(cell * BORDERS + first + 1, minlength=k * BORDERS).reshape(k, BORDERS)
        closed = np.bincount(cell * BORDERS + last, minlength=k * BORDERS).reshape(k, BORDERS)
        below, above = np.cumsum(opened, axis=1), count[:, None] - np.cumsum(closed, axis=1)

        # Weigh both sides by their surfaces: of the smallest box, of which the plane cuts those with an edge along j.
        w_low, w_high = plane - cell_low[:, j : j + 1], cell_high[:, j : j + 1] - plane
        area_low, area_high = np.full((2, k, BORDERS), np.inf)
        for frame, box in zip(frames, boxes, strict=True):
            if j in frame:
                b, c = (width[:, i : i + 1] for i in frame if i != j)
                area_low = np.minimum(area_low, _half_area(w_low, b, c))
                area_high = np.minimum(area_high, _half_area(w_high, b, c))
            else:
                area_low, area_high = np.minimum(area_low, box[:, None]), np.minimum(area_high, box[:, None])
        cost = heuristic.traversal + (area_low * below + area_high * above) / area
        empty = (below == 0) | (above == 0)
        cost = np.where(empty, (1.0 - heuristic.empty_bonus) * cost, cost)
        sliver = np.minimum(w_low, w_high) <= np.where(empty, SLIVER, 2.0**-40) * width[:, j : j + 1]
        cost[sliver] = np.inf

        lowest = cost.argmin(axis=1)
        better = cost[rows, lowest] < best
        best[better], normal[better] = cost[rows, lowest][better], j
        at[better] = plane[rows, lowest][better]
    return normal, at


def _half_area(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Half the surface of a box."""
    return x * y + y * z + z * x
