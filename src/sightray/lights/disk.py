"""A round lamp: a disk that shines."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import implements
from sightray.fields import Point, derived_vector, flag, number, vector
from sightray.lights.area import GRID, _AreaLight, cut, flat_density, from_piece, from_pieces8, place_in_cells
from sightray.lights.base import (
    LightBounds,
    LightSample,
    LightSample8,
    direction_density,
    flat,
    illuminate,
    illuminate_eight,
)
from sightray.mathlib.axes import axes_across
from sightray.mathlib.eight_paths import concentric8
from sightray.mathlib.eights import F64x8, Vec3x8, splat8v
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, i64_at, vec3_at
from sightray.mathlib.vec import Vec3
from sightray.mathlib.warp import concentric


class DiskLight(_AreaLight):
    """A flat round light that shines to the side of its `normal`, or to both if `two_sided`.

    The grid divides a square, which the concentric map folds onto the disk: all cells keep the same area
    pi radius²/grid² and stay compact. On the axis, at height h, the irradiance of a surface that faces the light tends
    to ``pi L radius² / (radius² + h²)``.

    Reference: P. Shirley, K. Chiu, "A low distortion map between disk and square", JGT 2(3), 1997.
    """

    center: Point = vector("centre", unit="m")
    normal: Point = vector("direction to which it shines", default=(0.0, -1.0, 0.0), nonzero=True)
    radius: float = number("radius", default=1.0, above=0, unit="m")
    two_sided: bool = flag("whether it shines to both sides", default=False)
    _normal: Any = derived_vector("unit normal", lambda d: d.frame()[2])
    _across: Any = derived_vector("a radius of the disk", lambda d: d.radius * d.frame()[0])
    _along: Any = derived_vector("the radius at right angles to it", lambda d: d.radius * d.frame()[1])

    def frame(self) -> np.ndarray:
        """Two unit vectors in the disk and its unit normal, (3, 3) float64, a row each."""
        return np.stack(axes_across(self.normal))

    @property
    def area(self) -> float:
        """Area of one side, m²."""
        return math.pi * self.radius**2

    def bounds(self) -> LightBounds:
        normal = self.frame()[2]
        reach = self.radius * np.sqrt(np.maximum(0.0, 1.0 - normal**2))
        box = np.array([self.center - reach, self.center + reach])
        return flat(box, normal, self.two_sided, np.multiply(self.radiance, self.area))

    def shape(self) -> Any | None:
        """The shining `Disk`, if `visible`."""
        from sightray.materials.emitter import Emitter
        from sightray.shapes.disk import Disk

        if not self.visible:
            return None
        material = Emitter(radiance=self.radiance, spectrum=self.spectrum, two_sided=self.two_sided)
        return Disk(center=self.center, normal=self.normal, radius=self.radius, material=material)


CENTER, _, RADIUS, TWO_SIDED, NORMAL, ACROSS, ALONG = DiskLight.offsets()[5:]


@implements(illuminate, DiskLight)
def illuminate_from_disk(light: Table, p: Vec3, cell: i64, u: f64, v: f64) -> LightSample:
    n, radius = cut(i64_at(light, GRID), cell), f64_at(light, RADIUS)
    s = place_in_cells(n, cell, u, v)
    s = concentric(s.x, s.y)
    q = vec3_at(light, CENTER) + vec3_at(light, ACROSS) * s.x + vec3_at(light, ALONG) * s.y
    area, both = math.pi * radius * radius, i64_at(light, TWO_SIDED) != 0
    return from_piece(light, p, q, vec3_at(light, NORMAL), area, n * n, both)


@implements(illuminate_eight, DiskLight)
def illuminate_eight_from_disk(light: Table, p: Vec3x8, u: F64x8, v: F64x8) -> LightSample8:
    x, y = concentric8(u, v)
    across, along = splat8v(vec3_at(light, ACROSS)), splat8v(vec3_at(light, ALONG))
    to_light = splat8v(vec3_at(light, CENTER)) - p + across * x + along * y
    area = math.pi * f64_at(light, RADIUS) * f64_at(light, RADIUS)
    return from_pieces8(light, to_light, vec3_at(light, NORMAL), area, i64_at(light, TWO_SIDED) != 0)


@implements(direction_density, DiskLight)
def density_of_disk(light: Table, p: Vec3, l: Vec3, distance: f64) -> f64:  # noqa: E741
    return flat_density(light, vec3_at(light, NORMAL), math.pi * f64_at(light, RADIUS) ** 2.0, l, distance)
