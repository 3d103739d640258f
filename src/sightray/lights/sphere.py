"""A bulb: a sphere that shines."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from sightray._jit import implements, kernel
from sightray.fields import Point, number, vector
from sightray.lights.area import GRID, RADIANCE, VISIBLE, _AreaLight, cut, place_in_cells
from sightray.lights.base import (
    LightBounds,
    LightSample,
    LightSample8,
    around,
    direction_density,
    illuminate,
    illuminate_eight,
)
from sightray.mathlib.eight_functions import circle8
from sightray.mathlib.eight_paths import frame_about8, out_of8
from sightray.mathlib.eights import (
    F64x8,
    Vec3x8,
    dot8,
    select8d,
    select8v,
    splat8d,
    splat8v,
    sqrt8d,
    vmax8d,
)
from sightray.mathlib.frame import perpendicular
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, i64_at, vec3_at
from sightray.mathlib.vec import Vec3, cross, length
from sightray.mathlib.warp import circle


class SphereLight(_AreaLight):
    """Shines outwards from the whole surface of a sphere.

    From distance d it fills a cone of half-angle asin(R/d), of solid angle Omega = 2 pi (1 - cos), within which light
    comes in evenly. So the grid divides the cone instead of the surface: each cell brings the irradiance
    ``L Omega/grid²`` from its direction, no ray is lost on the far side, and the sum for a surface that faces the
    centre tends to ``pi L (R/d)²``. Nothing is lit inside.

    Reference: P. Shirley, C. Wang, K. Zimmerman, "Monte Carlo techniques for direct lighting calculations", ACM
    TOG 15(1), 1996.
    """

    center: Point = vector("centre", unit="m")
    radius: float = number("radius", default=0.5, above=0, unit="m")

    @property
    def area(self) -> float:
        """Area of the surface, m²."""
        return 4 * math.pi * self.radius**2

    def bounds(self) -> LightBounds:
        return around(self.center, self.radius, np.multiply(self.radiance, math.pi * self.radius**2))

    def shape(self) -> Any | None:
        """The shining `Sphere`, if `visible`."""
        from sightray.materials.emitter import Emitter
        from sightray.shapes.sphere import Sphere

        if not self.visible:
            return None
        material = Emitter(radiance=self.radiance, spectrum=self.spectrum)
        return Sphere(center=self.center, radius=self.radius, material=material)


CENTER, RADIUS = SphereLight.offsets()[5:]


@kernel
def cap_of(radius: f64, d: f64) -> f64:
    """1 - cos of the half-angle of the cone that a sphere fills from distance d."""
    sin2 = (radius / d) * (radius / d)
    return sin2 / (1.0 + math.sqrt(max(0.0, 1.0 - sin2)))


@kernel
def is_outside(d: f64, radius: f64) -> bool:
    """Whether a point at distance d from the centre is outside; points of the surface are not, however rounded."""
    return d > radius * (1.0 + 1e-7)


class Way(NamedTuple):
    """From a point to a sphere."""

    direction: Vec3  # unit
    distance: f64  # to its near side
    solid_angle: f64  # of the whole sphere; 0 inside of it


@kernel
def in_cone(axis: Vec3, cap: f64, u: f64, v: f64) -> Vec3:
    """A direction about a unit axis, even over the cone of a half-angle whose 1 - cos is `cap`.

    1 - cos of the direction is drawn, not its cosine, which would cancel for narrow cones.
    """
    height = u * cap
    sine = math.sqrt(max(0.0, height * (2.0 - height)))
    across = perpendicular(axis)
    around = circle(v)
    return axis * (1.0 - height) + (across * around.x + cross(axis, across) * around.y) * sine


@kernel
def toward_sphere(p: Vec3, center: Vec3, radius: f64, u: f64, v: f64) -> Way:
    """A direction in the cone that a sphere fills, chosen evenly by two numbers in [0, 1)."""
    axis = center - p
    d = length(axis)
    if not is_outside(d, radius):
        return Way(Vec3(0.0, 1.0, 0.0, 0.0), radius, 0.0)
    axis = axis / d

    cap = cap_of(radius, d)
    direction = in_cone(axis, cap, u, v)

    # Go to the near side of the sphere.
    height = u * cap  # 1 - cos of the direction
    foot2 = radius * radius - d * d * height * (2.0 - height)
    distance = d * (1.0 - height) - math.sqrt(max(0.0, foot2))
    return Way(direction, distance, 2.0 * math.pi * cap)


@implements(illuminate, SphereLight)
def illuminate_from_sphere(light: Table, p: Vec3, cell: i64, u: f64, v: f64) -> LightSample:
    n = cut(i64_at(light, GRID), cell)
    s = place_in_cells(n, cell, u, v)
    way = toward_sphere(p, vec3_at(light, CENTER), f64_at(light, RADIUS), s.x, s.y)
    density = 1.0 / way.solid_angle if way.solid_angle > 0.0 and i64_at(light, VISIBLE) != 0 else 0.0
    irradiance = vec3_at(light, RADIANCE) * (way.solid_angle / (n * n))
    return LightSample(way.direction, way.distance, irradiance, density)


@kernel
def in_cone8(axis: Vec3x8, cap: F64x8, u: F64x8, v: F64x8) -> Vec3x8:
    """`in_cone` for eight directions."""
    height = u * cap
    sine = sqrt8d(vmax8d(splat8d(0.0), height * (2.0 - height)))
    x, y = circle8(v)
    return out_of8(frame_about8(axis), Vec3x8(sine * x, sine * y, 1.0 - height))


@implements(illuminate_eight, SphereLight)
def illuminate_eight_from_sphere(light: Table, p: Vec3x8, u: F64x8, v: F64x8) -> LightSample8:
    to_center, radius, zero = splat8v(vec3_at(light, CENTER)) - p, f64_at(light, RADIUS), splat8d(0.0)
    d = sqrt8d(dot8(to_center, to_center))
    outside = d > radius * (1.0 + 1e-7)  # as in `is_outside`
    sin2 = (radius / d) * (radius / d)
    cap = sin2 / (1.0 + sqrt8d(vmax8d(zero, 1.0 - sin2)))
    direction, height = in_cone8(to_center * (1.0 / d), cap, u, v), u * cap
    foot2 = radius * radius - d * d * height * (2.0 - height)
    distance = d * (1.0 - height) - sqrt8d(vmax8d(zero, foot2))
    solid_angle = select8d(outside, cap * (2.0 * math.pi), zero)
    shown = 1.0 if i64_at(light, VISIBLE) != 0 else 0.0
    return LightSample8(
        select8v(outside, direction, Vec3x8(zero, splat8d(1.0), zero)),
        select8d(outside, distance, splat8d(radius)),
        splat8v(vec3_at(light, RADIANCE)) * solid_angle,
        select8d(outside, shown / solid_angle, zero),
    )


@implements(direction_density, SphereLight)
def density_of_sphere(light: Table, p: Vec3, l: Vec3, distance: f64) -> f64:  # noqa: E741
    d, radius = length(vec3_at(light, CENTER) - p), f64_at(light, RADIUS)
    if i64_at(light, VISIBLE) == 0 or not is_outside(d, radius):
        return 0.0
    return 1.0 / (2.0 * math.pi * cap_of(radius, d))
