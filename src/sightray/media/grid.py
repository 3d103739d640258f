"""A medium whose density is given on a grid: smoke, clouds, what a scanner measured."""

from __future__ import annotations

import math
import os
from typing import Any, NamedTuple

import numpy as np

from sightray._jit import implements, kernel
from sightray.errors import SceneError
from sightray.fields import Color, Point, color, derived_array, derived_integer, derived_number, number, other, vector
from sightray.mathlib.bands import as_reflectance, ones
from sightray.mathlib.rng import stream, uniform
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f32_at, f64_at, i64_at, table_at, vec3_at
from sightray.mathlib.transform import Transform, as_transform, transform_point, transform_vector
from sightray.mathlib.vec import Vec3, grey, max4, mean4
from sightray.media.base import (
    Medium,
    MediumSample,
    PhaseSample,
    phase,
    sample_distance,
    sample_phase,
    transmittance,
)
from sightray.media.grid_files import read_densities
from sightray.media.henyey_greenstein import henyey_greenstein, sample_henyey_greenstein
from sightray.samplers.base import Draws

MOST_STEPS = 100_000  # through one medium; a way that takes more is as good as opaque


def _density(value: Any) -> np.ndarray:
    """A read-only (nz, ny, nx) float32 array of densities, from an array or a file."""
    if isinstance(value, str | os.PathLike):
        value = read_densities(value)
    try:
        found = np.array(value, np.float32)
    except (TypeError, ValueError):
        raise SceneError("got no array; allowed: densities of shape (nz, ny, nx), or a file of them") from None
    if found.ndim != 3 or not found.size or not np.isfinite(found).all() or (found < 0).any():
        raise SceneError(
            f"got an array of shape {found.shape}; allowed: shape (nz, ny, nx), finite densities of at least 0"
        )
    found.flags.writeable = False
    return found


class GridMedium(Medium):
    """Density between the centres of a grid's cells is blended linearly; outside of the box there is nothing.

    The coefficients are those of density 1. Where light scatters is found by tracking through a fictitious medium that
    is as dense everywhere as the densest cell (E. Woodcock and others, 1965), with weights for the lanes of colour
    (P. Kutz, R. Habel, Y. Li, J. Novák, "Spectral and decomposition tracking", SIGGRAPH 2017); transmittance by ratio
    tracking (J. Novák, A. Selle, W. Jarosz, SIGGRAPH Asia 2014). Both are unbiased. A thin medium with one dense spot
    takes many steps.

    Densities are an array, or a file: ``.npy``, or ``.vol`` as Mitsuba stores grids. The box is `lower` to `upper` in
    either case.
    """

    density: Any = other("densities, (nz, ny, nx) floats, x being the last axis; or a .npy or .vol file", _density,
                         plain=lambda d: d.tolist())  # fmt: skip
    lower: Point = vector("corner of the grid's box", default=(0.0, 0.0, 0.0), unit="m")
    upper: Point = vector("opposite corner", default=(1.0, 1.0, 1.0), unit="m")
    transform: Transform = other(
        "box to world", as_transform, default=None, plain=lambda t: None if t.is_identity else t.matrix.tolist()
    )
    absorption: Color = color("absorption coefficient at density 1", default=0.0, unit="1/m")
    scattering: Color = color("scattering coefficient at density 1", default=1.0, unit="1/m")
    g: float = number("mean cosine of scattering: 0 even, towards 1 forward", default=0.0, above=-1, below=1)
    _cells: Any = derived_array("densities, x running fastest", lambda m: m.density.ravel())
    _nx: Any = derived_integer("cells along x", lambda m: m.density.shape[2])
    _ny: Any = derived_integer("cells along y", lambda m: m.density.shape[1])
    _nz: Any = derived_integer("cells along z", lambda m: m.density.shape[0])
    _densest: Any = derived_number("largest density", lambda m: m.density.max())
    _to_grid: Any = derived_array("world to cells, four columns", lambda m: m.to_grid().T.ravel())

    def check(self) -> None:
        if not (np.asarray(self.upper) > self.lower).all():
            raise SceneError(f"GridMedium.upper: got {self.upper}; allowed: above lower {self.lower} in x, y and z")

    def to_grid(self) -> np.ndarray:
        """World points in cells: (4, 4) float64; the box is [0, nx] x [0, ny] x [0, nz]."""
        nz, ny, nx = self.density.shape
        scale = np.diag([*(np.array([nx, ny, nz]) / np.subtract(self.upper, self.lower)), 1.0])
        scale[:3, 3] = -scale[:3, :3] @ self.lower
        return scale @ self.transform.inverse


LOWER, UPPER, ABSORPTION, SCATTERING, G, CELLS, NX, NY, NZ, DENSEST, TO_GRID = GridMedium.offsets()


class Span(NamedTuple):
    """The part of a ray within the box."""

    near: f64
    far: f64


@kernel
def span_within(medium: Table, o: Vec3, d: Vec3, t_max: f64) -> Span:
    """Where a ray, in cells, is within the grid's box, before t_max; empty if far <= near."""
    near, far = 0.0, t_max
    for axis in range(3):
        size = float(i64_at(medium, NX + axis))
        p = o.x if axis == 0 else (o.y if axis == 1 else o.z)
        w = d.x if axis == 0 else (d.y if axis == 1 else d.z)
        if w == 0.0:
            if p < 0.0 or p > size:
                return Span(0.0, 0.0)
        else:
            a, b = -p / w, (size - p) / w
            near, far = max(near, min(a, b)), min(far, max(a, b))
    return Span(near, far)


@kernel
def cell_at(medium: Table, x: i64, y: i64, z: i64) -> f64:
    """Density of a cell; those beyond the border are like the border's."""
    nx, ny, nz = i64_at(medium, NX), i64_at(medium, NY), i64_at(medium, NZ)
    x, y, z = min(nx - 1, max(0, x)), min(ny - 1, max(0, y)), min(nz - 1, max(0, z))
    return float(f32_at(table_at(medium, CELLS), (z * ny + y) * nx + x))


@kernel
def density_at(medium: Table, p: Vec3) -> f64:
    """Density at a place in cells, blended between the eight nearest centres."""
    x, y, z = math.floor(p.x - 0.5), math.floor(p.y - 0.5), math.floor(p.z - 0.5)
    s, t, r = p.x - 0.5 - x, p.y - 0.5 - y, p.z - 0.5 - z
    i, j, k = int(x), int(y), int(z)
    total = 0.0
    for corner in range(8):
        a, b, c = corner & 1, corner >> 1 & 1, corner >> 2
        weight = (s if a else 1.0 - s) * (t if b else 1.0 - t) * (r if c else 1.0 - r)
        total += weight * cell_at(medium, i + a, j + b, k + c)
    return total


@implements(transmittance, GridMedium)
def transmitted(medium: Table, o: Vec3, d: Vec3, t_max: f64, bands: Table, draws: Draws) -> Vec3:
    """Ratio tracking: at each meeting with the fictitious medium, the share of it that is not real."""
    start, way = transform_point(table_at(medium, TO_GRID), 0, o), transform_vector(table_at(medium, TO_GRID), 0, d)
    span = span_within(medium, start, way, t_max)
    unit = as_reflectance(bands, vec3_at(medium, ABSORPTION) + vec3_at(medium, SCATTERING))
    most = max4(unit) * f64_at(medium, DENSEST)
    share = grey(1.0)
    key = stream(draws.key, draws.sample)
    t = span.near
    for step in range(MOST_STEPS):
        t -= math.log(1.0 - uniform(key, step)) / most if most > 0.0 else -math.inf
        if not t < span.far:
            break
        share = share * (1.0 - unit * (density_at(medium, start + way * t) / most))
        if max4(share) <= 0.0:
            break
    return share


@implements(sample_distance, GridMedium)
def tracked(
    medium: Table, o: Vec3, d: Vec3, t_max: f64, beta: Vec3, bands: Table, draws: Draws
) -> MediumSample:
    """Weighted delta tracking: absorption weighs, scattering and going on are chosen by their mean weights."""
    start, way = transform_point(table_at(medium, TO_GRID), 0, o), transform_vector(table_at(medium, TO_GRID), 0, d)
    span = span_within(medium, start, way, t_max)
    scattering = as_reflectance(bands, vec3_at(medium, SCATTERING))
    unit = scattering + as_reflectance(bands, vec3_at(medium, ABSORPTION))
    most = max4(unit) * f64_at(medium, DENSEST)
    weight = ones(bands)
    key = stream(draws.key, draws.sample)
    t = span.near
    for step in range(MOST_STEPS):
        t -= math.log(1.0 - uniform(key, 2 * step)) / most if most > 0.0 else -math.inf
        if not t < span.far:
            break
        density = density_at(medium, start + way * t) / most
        scattered, passed = weight * scattering * density, weight * (1.0 - unit * density)
        odds = mean4(beta * scattered) / (mean4(beta * scattered) + mean4(beta * passed))
        if uniform(key, 2 * step + 1) < odds:
            return MediumSample(t, scattered / odds, True)
        weight = passed / (1.0 - odds)
    return MediumSample(t_max, weight, False)


@implements(phase, GridMedium)
def phase_of_grid(medium: Table, cosine: f64) -> f64:
    return henyey_greenstein(f64_at(medium, G), cosine)


@implements(sample_phase, GridMedium)
def sample_phase_of_grid(medium: Table, d: Vec3, u: f64, v: f64) -> PhaseSample:
    return sample_henyey_greenstein(f64_at(medium, G), d, u, v)
