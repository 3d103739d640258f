"""Torus."""

from __future__ import annotations

import math

import numpy as np

from sightray._jit import implements, kernel
from sightray.errors import SceneError
from sightray.fields import Point, derived_vector, number, vector
from sightray.mathlib.axes import axes_across, unit
from sightray.mathlib.hit import Hit, miss
from sightray.mathlib.polynomial import roots_within
from sightray.mathlib.rays import is_ray, nearest_parameter
from sightray.mathlib.scalars import f64
from sightray.mathlib.slabs import slab
from sightray.mathlib.table import Table, f64_at, f64_put, scratch, vec3_at
from sightray.mathlib.transform import transform_normal, transform_vector
from sightray.mathlib.turns import turn
from sightray.mathlib.vec import Vec3, dot, length
from sightray.shapes.base import Shape, Surface, intersect, surface


class Torus(Shape):
    """All points at distance r = ``minor_radius`` from a circle of radius R = ``major_radius``.

    With the circle around the z axis: ``(√(x² + y²) - R)² + z² = r²``, and without the root
    ``(|p|² + R² - r²)² = 4 R² (x² + y²)``, a quartic along the ray. It is solved from where the ray passes nearest to
    the centre, in a unit direction, so that its coefficients have the torus's size however far the eye is; its roots
    are bracketed by those of its derivatives (`mathlib.polynomial`) and polished by Newton's method on the first
    equation.

    Texture coordinates: u runs once around ``axis``, counter-clockwise seen from its tip, starting at the u axis of
    `Plane` for the axis as normal; v runs once around the tube, starting outside and rising along the axis.
    """

    center: Point = vector("centre", default=(0.0, 0.0, 0.0), unit="m")
    axis: Point = vector("direction through the hole", default=(0.0, 1.0, 0.0), nonzero=True)
    major_radius: float = number("radius of the circle", default=1.0, above=0, unit="m")
    minor_radius: float = number("radius of the tube", default=0.25, above=0, unit="m")
    axis_u = derived_vector("unit axis where u = 0", lambda torus: axes_across(torus.axis)[0])
    axis_v = derived_vector("unit axis where u = 1/4", lambda torus: axes_across(torus.axis)[1])
    axis_n = derived_vector("unit axis through the hole", lambda torus: axes_across(torus.axis)[2])

    def check(self) -> None:
        if self.minor_radius >= self.major_radius:
            raise SceneError(f"Torus.minor_radius: got {self.minor_radius:g}; allowed: less than major_radius "
                             f"({self.major_radius:g})")  # fmt: skip

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        reach = self.major_radius * np.sqrt(np.maximum(0.0, 1.0 - unit(self.axis) ** 2)) + self.minor_radius
        return np.array(self.center) - reach, np.array(self.center) + reach


CENTER, AXIS, MAJOR, MINOR, AXES, AXIS_V, AXIS_N = Torus.offsets()
_MARGIN = 1.0 + 1e-9  # keeps hits on the outermost circles inside the interval that is searched


@kernel
def torus_quartic(p: Vec3, q: Vec3, major: f64, minor: f64, c: Table) -> None:
    """Coefficients of the quartic along p + s q, with q of unit length."""
    n, e, h = dot(p, q), p.x * q.x + p.y * q.y, q.x * q.x + q.y * q.y
    rho = math.sqrt(p.x * p.x + p.y * p.y)
    inner = (rho - major) * (rho - major) + p.z * p.z - minor * minor
    outer = (rho + major) * (rho + major) + p.z * p.z - minor * minor
    k = 0.5 * (inner + outer)  # |p|² + R² - r²
    f64_put(c, 0, inner * outer)  # k² - 4 R² rho², without cancelling
    f64_put(c, 1, 4.0 * n * k - 8.0 * major * major * e)
    f64_put(c, 2, 4.0 * n * n + 2.0 * k - 4.0 * major * major * h)
    f64_put(c, 3, 4.0 * n)
    f64_put(c, 4, 1.0)


@kernel
def polish_on_torus(p: Vec3, q: Vec3, major: f64, minor: f64, s: f64) -> f64:
    """Two steps of Newton's method on (rho - R)² + z² - r²."""
    for _ in range(2):
        x = p + q * s
        rho = math.sqrt(x.x * x.x + x.y * x.y)
        if rho == 0.0:
            return s
        f = (rho - major) * (rho - major) + x.z * x.z - minor * minor
        slope = 2.0 * ((rho - major) * (x.x * q.x + x.y * q.y) / rho + x.z * q.z)
        if not abs(f) < 1e-4 * minor * abs(slope):  # a grazing ray, where a step could leave the root
            return s
        s -= f / slope
    return s


@implements(intersect, Torus)
def intersect_torus(torus: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> Hit:
    if not is_ray(o, d):
        return miss()
    major, minor, center = f64_at(torus, MAJOR), f64_at(torus, MINOR), vec3_at(torus, CENTER)
    t, size = nearest_parameter(o, d, center), length(d)
    p = transform_normal(torus, AXES, o + d * t - center)
    q = transform_normal(torus, AXES, d) / size

    # Search only where the ray is near: in the sphere around the torus, and between the planes it lies on.
    square = (major + minor) * (major + minor) * _MARGIN - dot(p, p)
    if not square >= 0.0:
        return miss()
    reach = math.sqrt(square)
    span = slab(-minor * _MARGIN, minor * _MARGIN, p.z, q.z)
    lower, upper = max(-reach, span.near), min(reach, span.far)
    if not lower <= upper:
        return miss()

    c, roots = scratch(5), scratch(4)
    torus_quartic(p, q, major, minor, c)
    for i in range(roots_within(c, 4, lower, upper, roots)):
        found = t + polish_on_torus(p, q, major, minor, f64_at(roots, i)) / size
        if t_min < found < t_max:
            return Hit(found, 0, 0.0, 0.0)
    return miss()


@implements(surface, Torus)
def surface_of_torus(torus: Table, hit: Hit, p: Vec3) -> Surface:
    q = transform_normal(torus, AXES, p - vec3_at(torus, CENTER))
    rho = math.sqrt(q.x * q.x + q.y * q.y)
    out = rho - f64_at(torus, MAJOR)
    n = transform_vector(torus, AXES, Vec3(q.x * out / rho, q.y * out / rho, q.z))
    around = transform_vector(torus, AXES, Vec3(-q.y, q.x, 0.0) * (2.0 * math.pi))
    return Surface(n, n, turn(q.x, q.y), turn(out, q.z), around)
