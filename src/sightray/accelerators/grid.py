"""The uniform grid."""

from __future__ import annotations

import math

import numpy as np

from sightray._jit import implements, kernel
from sightray.accelerators.base import blocked, closest
from sightray.accelerators.item import ItemHit
from sightray.accelerators.primitives import (
    ORDER,
    OWN,
    Primitives,
    _OverPrimitives,
    nearest_listed,
    nearest_unbounded,
    no_item,
    number_at,
)
from sightray.accelerators.world_ray import meet_box, world_ray
from sightray.fields import choice, integer, number
from sightray.mathlib.rays import is_ray
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Space, Table, i64_at, is_null, link, table_at, vec3_at
from sightray.mathlib.tally import NODES, tally
from sightray.mathlib.vec import Vec3

STARTS, CELLS, LOWER, UPPER, SIZE = OWN, OWN + 1, OWN + 4, OWN + 8, OWN + 12
MAX_CELLS = 1 << 24
ENTRIES_EACH, ENTRIES_FREE = 32, 1 << 20  # how many entries of cells are too many: per primitive, and beside


class Grid(_OverPrimitives):
    """Uniform grid: cut space into equal cells, and step along the ray from cell to cell.

    Each cell lists the primitives that reach into it. A line through a grid meets the next cell where it meets the
    nearest of three planes, so a step takes one comparison of three numbers and one addition: the three-dimensional
    digital differential analyser. The walk ends in the first cell that the ray leaves behind its nearest hit.

    How fine? Cells must hold few primitives, yet empty ones cost a step each. Two rules:

    - ``woo``: three times the cube root of the number of primitives along the longest side;
    - ``cleary``: a number of cells in proportion to the number of primitives, ``density`` each, nearly cubes.

    One size fits all cells, but not all scenes: a teapot in a stadium falls into one cell (E. Haines, "Spline surface
    rendering, and what's wrong with octrees", Ray Tracing News 1988), and every ray that looks at it asks all of it.

    References
    ----------
    A. Fujimoto, T. Tanaka, K. Iwata, "ARTS" (IEEE CG&A 1986); J. Amanatides, A. Woo, "A fast voxel traversal algorithm
    for ray tracing" (Eurographics 1987); J. Cleary, G. Wyvill, "Analysis of an algorithm for fast ray tracing using
    uniform space subdivision" (Visual Computer 1988); A. Woo, "Ray tracing polygons using spatial subdivision" (1992).
    """

    rule: str = choice("how to choose the number of cells", ["woo", "cleary"], default="cleary")
    density: float = number("cells for each primitive, for `cleary`", default=4.0, above=0, at_most=1000)
    resolution: int = integer("cells along the longest side; 0 to go by the rule", default=0, at_least=0, at_most=4096)

    def cells(self, n: int, extent: np.ndarray) -> np.ndarray:
        """Cells along each axis, (3,) int64, for n primitives in a box of this extent."""
        # A flat scene is one cell thick, not of no volume.
        extent = np.maximum(extent, 1e-3 * extent.max())
        if self.resolution:
            per_length = self.resolution / extent.max()
        elif self.rule == "woo":
            per_length = 3.0 * n ** (1 / 3) / extent.max()
        else:
            per_length = (self.density * n / extent.prod()) ** (1 / 3)
        cells = np.maximum(1, np.rint(extent * per_length))
        return np.maximum(1, cells * min(1.0, (MAX_CELLS / cells.prod()) ** (1 / 3))).astype(np.int64)

    def grow(self, space: Space, row: Table, primitives: Primitives) -> np.ndarray:
        n = len(primitives.number)
        if n == 0:
            return primitives.number
        lower, upper = primitives.lower.min(axis=0), primitives.upper.max(axis=0)
        extent = np.maximum(upper - lower, np.finfo(float).tiny)
        cells = self.cells(n, extent)

        # Take a coarser grid if large primitives would stand in too many cells.
        while True:
            size = extent / cells
            first = ((primitives.lower - lower) / size).astype(np.int64).clip(0, cells - 1)
            last = ((primitives.upper - lower) / size).astype(np.int64).clip(0, cells - 1)
            across = last - first + 1
            entries = across.prod(axis=1)
            if entries.sum() <= ENTRIES_EACH * n + ENTRIES_FREE or cells.max() == 1:
                break
            cells = np.maximum(1, cells // 2)

        # List each primitive in every cell of its box that its plane, if it is a triangle, crosses.
        which = np.repeat(np.arange(n), entries)
        within = np.arange(entries.sum()) - np.repeat(np.cumsum(entries) - entries, entries)
        nx, ny = across[which, 0], across[which, 1]
        at = first[which] + np.stack([within % nx, within // nx % ny, within // (nx * ny)], axis=1)
        touch = primitives.cross(which, lower + (at + 0.5) * size, 0.5 * size + 2.0**-24 * size)
        which, at = which[touch], at[touch]
        cell = (at[:, 2] * cells[1] + at[:, 1]) * cells[0] + at[:, 0]
        counts = np.bincount(cell, minlength=int(cells.prod()))
        link(row, STARTS, space.array(np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)))
        numbers = row.view(np.float64)
        row.view(np.int64)[CELLS : CELLS + 3] = cells
        numbers[LOWER : LOWER + 3], numbers[UPPER : UPPER + 3], numbers[SIZE : SIZE + 3] = lower, upper, size
        return primitives.number[which[np.argsort(cell, kind="stable")]]


@kernel
def cell_of(p: f64, lower: f64, size: f64, count: i64) -> i64:
    """Which of `count` cells along an axis a coordinate is in; the outermost where it lies outside."""
    return int(min(max((p - lower) / size, 0.0), count - 1.0))


@kernel
def leaves_at(cell: i64, lower: f64, size: f64, o: f64, d: f64, r: f64) -> f64:
    """t at which the ray leaves a cell along one axis: computed anew for each, so that errors do not add up."""
    if d == 0.0:
        return math.inf
    return (lower + (cell + (1.0 if d > 0.0 else 0.0)) * size - o) * r


@kernel
def walk_grid(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64, any: bool) -> ItemHit:
    """Nearest hit, or with `any` whichever is found first."""
    starts = table_at(tree, STARTS)
    if not is_ray(o, d):
        return no_item()
    ray = world_ray(o, d)
    best = nearest_unbounded(tree, ray, t_min, t_max)
    if is_null(starts) or (any and best.item >= 0):
        return best
    lower, size = vec3_at(tree, LOWER), vec3_at(tree, SIZE)
    span = meet_box(lower, vec3_at(tree, UPPER), ray, t_min, min(t_max, best.t))
    if span.near > span.far:
        return best

    # Start in the cell where the ray enters the grid.
    nx, ny, nz = i64_at(tree, CELLS), i64_at(tree, CELLS + 1), i64_at(tree, CELLS + 2)
    p = o + d * span.near
    x, y, z = cell_of(p.x, lower.x, size.x, nx), cell_of(p.y, lower.y, size.y, ny), cell_of(p.z, lower.z, size.z, nz)
    while 0 <= x < nx and 0 <= y < ny and 0 <= z < nz:
        tally(NODES)
        cell = (z * ny + y) * nx + x
        first = number_at(starts, cell)
        count = number_at(starts, cell + 1) - first
        best = nearest_listed(tree, table_at(tree, ORDER), first, count, ray, t_min, t_max, best)

        # Step through the nearest of the three planes ahead, unless the ray ends before.
        tx = leaves_at(x, lower.x, size.x, o.x, d.x, ray.r.x)
        ty = leaves_at(y, lower.y, size.y, o.y, d.y, ray.r.y)
        tz = leaves_at(z, lower.z, size.z, o.z, d.z, ray.r.z)
        if (any and best.item >= 0) or min(best.t, span.far) < min(tx, ty, tz):
            return best
        if tx <= ty and tx <= tz:
            x += 1 if d.x > 0.0 else -1
        elif ty <= tz:
            y += 1 if d.y > 0.0 else -1
        else:
            z += 1 if d.z > 0.0 else -1
    return best


@implements(closest, Grid)
def closest_in_grid(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> ItemHit:
    return walk_grid(tree, o, d, t_min, t_max, False)


@implements(blocked, Grid)
def blocked_in_grid(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> bool:
    return walk_grid(tree, o, d, t_min, t_max, True).item >= 0
