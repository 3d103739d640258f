"""Quadric."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import implements
from sightray.errors import SceneError
from sightray.fields import Point, derived_number, derived_vector, number, vector
from sightray.mathlib.hit import Hit, miss
from sightray.mathlib.quadratic import quadratic
from sightray.mathlib.rays import first_within, is_ray, nearest_parameter
from sightray.mathlib.scalars import f64
from sightray.mathlib.slabs import box_span
from sightray.mathlib.table import Table, f64_at, vec3_at
from sightray.mathlib.transform import Transform, transform_vector
from sightray.mathlib.turns import tangent_around_y, turn
from sightray.mathlib.vec import Vec3, dot
from sightray.shapes.base import Shape, Surface, intersect, surface


def _sizes(*values: float) -> list[float]:
    """Radii and heights, checked."""
    for value in values:
        if not (math.isfinite(value) and value > 0.0):
            raise SceneError(f"Quadric.radii: got {value!r}; allowed: finite numbers > 0")
    return [float(value) for value in values]


class Quadric(Shape):
    """Where ``F = A x² + B y² + C z² + D xy + E xz + F yz + G x + H y + I z + J`` is zero, inside a clipping box.

    With ``F = p·Qp + L·p + J``, Q symmetric, the ray p + t d gives the quadratic
    ``(d·Qd) t² + (2 p·Qd + L·d) t + F(p) = 0``, solved from where the ray passes nearest to the middle of the box; it
    may turn out linear. An open surface where the box cuts it: its outer side is the one where F is positive, which
    the gradient 2Qp + L points to. `ellipsoid`, `paraboloid`, `elliptic_cone`, `hyperboloid` (one sheet) and
    `hyperboloid_of_two_sheets` make the named ones, upright along y.

    Texture coordinates: u runs once around the vertical through the middle of the box, counter-clockwise seen from
    above, starting at +x; v from the bottom of the box (0) to its top (1).
    """

    a: float = number("coefficient A of x²", default=0.0)
    b: float = number("coefficient B of y²", default=0.0)
    c: float = number("coefficient C of z²", default=0.0)
    d: float = number("coefficient D of xy", default=0.0)
    e: float = number("coefficient E of xz", default=0.0)
    f: float = number("coefficient F of yz", default=0.0)
    g: float = number("coefficient G of x", default=0.0)
    h: float = number("coefficient H of y", default=0.0)
    i: float = number("coefficient I of z", default=0.0)
    j: float = number("constant J", default=0.0)
    lower: Point = vector("lower corner of the clipping box", default=(-1.0, -1.0, -1.0), unit="m")
    upper: Point = vector("upper corner of the clipping box", default=(1.0, 1.0, 1.0), unit="m")
    middle = derived_vector("middle m of the box", lambda s: s.about_middle()[0])
    q0 = derived_vector("first column of Q", lambda s: s.matrix()[0])
    q1 = derived_vector("second column of Q", lambda s: s.matrix()[1])
    q2 = derived_vector("third column of Q", lambda s: s.matrix()[2])
    linear = derived_vector("gradient at m", lambda s: s.about_middle()[1])
    constant = derived_number("value at m", lambda s: s.about_middle()[2])

    def matrix(self) -> np.ndarray:
        """Q, symmetric (3, 3)."""
        d, e, f = 0.5 * self.d, 0.5 * self.e, 0.5 * self.f
        return np.array([[self.a, d, e], [d, self.b, f], [e, f, self.c]])

    def about_middle(self) -> tuple[np.ndarray, np.ndarray, float]:
        """m, gradient and value at m: F as a polynomial in p - m."""
        m, q, g = 0.5 * (np.array(self.lower) + self.upper), self.matrix(), np.array([self.g, self.h, self.i])
        return m, 2.0 * q @ m + g, float(m @ q @ m + g @ m + self.j)

    def check(self) -> None:
        if not all(p < q for p, q in zip(self.lower, self.upper, strict=True)):
            raise SceneError(f"Quadric.upper: got {self.upper}; allowed: larger than lower {self.lower} on each axis")
        if not (self.matrix().any() or self.g or self.h or self.i):
            raise SceneError("Quadric.a: all coefficients of x, y and z are 0; allowed: at least one that is not")

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        return np.array(self.lower), np.array(self.upper)

    @classmethod
    def _upright(cls, radii: Any, sign: float, j: float, half: Any, bottom: float, options: dict[str, Any]) -> Quadric:
        """x²/a² + sign y²/b² + z²/c² + j in a box of half widths and top `half`, from y = bottom; `center` moves it."""
        (a, b, c), (hx, top, hz) = radii, half
        place = Transform(options.pop("transform", None)) @ Transform.translate(*options.pop("center", (0.0, 0.0, 0.0)))
        slack = 1e-9 * max(hx, hz, top - bottom)  # rounding must not cut off poles and rims in the box's faces
        lower, upper = (-hx - slack, bottom - slack, -hz - slack), (hx + slack, top + slack, hz + slack)
        return cls(a=a**-2, b=sign * b**-2, c=c**-2, h=0.0 if sign else -1.0 / top, j=j, transform=place,
                   lower=lower, upper=upper, **options)  # fmt: skip

    @classmethod
    def ellipsoid(cls, radii: Any = (1.0, 1.0, 1.0), **options: Any) -> Quadric:
        """``x²/r_x² + y²/r_y² + z²/r_z² = 1``. Options: ``center``, and those of every shape."""
        a, b, c = _sizes(*radii)
        return cls._upright((a, b, c), 1.0, -1.0, (a, b, c), -b, options)

    @classmethod
    def paraboloid(cls, radii: Any = (1.0, 1.0), height: float = 1.0, **options: Any) -> Quadric:
        """``x²/r_x² + z²/r_z² = y/height``: a bowl that stands on ``center`` and has ``radii`` at its rim."""
        a, c, top = _sizes(*radii, height)
        return cls._upright((a, 1.0, c), 0.0, 0.0, (a, top, c), 0.0, options)

    @classmethod
    def elliptic_cone(cls, radii: Any = (1.0, 1.0), height: float = 1.0, double: bool = False,
                      **options: Any) -> Quadric:  # fmt: skip
        """``x²/r_x² + z²/r_z² = y²/height²``: stands on its apex at ``center``; `double` adds the nappe below."""
        a, c, top = _sizes(*radii, height)
        return cls._upright((a, top, c), -1.0, 0.0, (a, top, c), -top if double else 0.0, options)

    @classmethod
    def hyperboloid(cls, radii: Any = (1.0, 1.0, 1.0), height: float = 2.0, **options: Any) -> Quadric:
        """``x²/r_x² - y²/r_y² + z²/r_z² = 1``, one sheet: a waist of radii r_x and r_z, `height` in all."""
        a, b, c, tall = _sizes(*radii, height)
        wide = math.hypot(1.0, 0.5 * tall / b)
        return cls._upright((a, b, c), -1.0, -1.0, (a * wide, 0.5 * tall, c * wide), -0.5 * tall, options)

    @classmethod
    def hyperboloid_of_two_sheets(cls, radii: Any = (1.0, 1.0, 1.0), height: float = 4.0, **options: Any) -> Quadric:
        """``x²/r_x² - y²/r_y² + z²/r_z² = -1``: two cups that are 2 r_y apart, `height` in all, more than 2 r_y."""
        a, b, c, tall = _sizes(*radii, height)
        if not tall > 2.0 * b:
            raise SceneError(f"Quadric.height: got {tall:g}; allowed: more than twice the middle radius ({b:g})")
        wide = math.sqrt((0.5 * tall / b) ** 2 - 1.0)
        return cls._upright((a, b, c), -1.0, 1.0, (a * wide, 0.5 * tall, c * wide), -0.5 * tall, options)


*_, LOWER, UPPER, MIDDLE, Q, _Q1, _Q2, LINEAR, CONSTANT = Quadric.offsets()


@implements(intersect, Quadric)
def intersect_quadric(quadric: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> Hit:
    span = box_span(vec3_at(quadric, LOWER), vec3_at(quadric, UPPER), o, d)
    if not (span.near <= span.far and is_ray(o, d)):
        return miss()
    middle, linear = vec3_at(quadric, MIDDLE), vec3_at(quadric, LINEAR)
    t = nearest_parameter(o, d, middle)
    p = o + d * t - middle
    qp, qd = transform_vector(quadric, Q, p), transform_vector(quadric, Q, d)
    value = dot(p, qp) + dot(p, linear) + f64_at(quadric, CONSTANT)
    roots = quadratic(dot(d, qd), dot(d, qp) + 0.5 * dot(d, linear), value)
    near = roots.near + t if span.near <= roots.near + t <= span.far else math.nan
    far = roots.far + t if span.near <= roots.far + t <= span.far else math.nan
    found = first_within(near, far, t_min, t_max)
    return Hit(found, 0, 0.0, 0.0) if found < math.inf else miss()


@implements(surface, Quadric)
def surface_of_quadric(quadric: Table, hit: Hit, p: Vec3) -> Surface:
    q = p - vec3_at(quadric, MIDDLE)
    n = transform_vector(quadric, Q, q) * 2.0 + vec3_at(quadric, LINEAR)
    if dot(n, n) == 0.0:  # the apex of a cone
        n = Vec3(0.0, 1.0, 0.0)
    bottom = vec3_at(quadric, LOWER).y
    v = (p.y - bottom) / (vec3_at(quadric, UPPER).y - bottom)
    return Surface(n, n, turn(q.x, -q.z), min(1.0, max(0.0, v)), tangent_around_y(n, q))
