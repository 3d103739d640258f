"""What cylinders and cones share: round, straight-sided bodies between two planes."""

from __future__ import annotations

import math

import numpy as np

from sightray._jit import implements, kernel
from sightray.errors import SceneError
from sightray.fields import Point, derived_number, derived_vector, flag, vector
from sightray.mathlib.axes import axes_across
from sightray.mathlib.hit import Hit, miss
from sightray.mathlib.quadratic import quadratic
from sightray.mathlib.rays import is_ray, nearest_parameter
from sightray.mathlib.scalars import f64
from sightray.mathlib.slabs import Span, slab
from sightray.mathlib.table import Table, f64_at, i64_at, vec3_at
from sightray.mathlib.transform import transform_normal, transform_vector
from sightray.mathlib.turns import turn
from sightray.mathlib.vec import Vec3
from sightray.shapes.base import Shape, Surface, intersect, surface


class _Tapered(Shape):
    """The body ``x² + y² <= r(z)²`` with ``r(z) = r_m + k z`` and ``|z| <= h/2``, z along the axis from the middle.

    Its inside along a ray is an interval: the common part of a cone's and a slab's. Taking the ends of that interval,
    instead of testing each root against the other surface, leaves no gap at the rims.
    """

    base: Point = vector("centre of the base", default=(0.0, 0.0, 0.0), unit="m")
    top: Point = vector("centre of the top", default=(0.0, 1.0, 0.0), unit="m")
    capped: bool = flag("whether base and top are closed by disks", default=True)
    middle = derived_vector("midpoint of the axis", lambda body: 0.5 * (np.array(body.base) + body.top))
    axis_u = derived_vector("unit axis where u = 0", lambda body: body.axes()[0])
    axis_v = derived_vector("unit axis where u = 1/4", lambda body: body.axes()[1])
    axis_n = derived_vector("unit axis from base to top", lambda body: body.axes()[2])
    height = derived_number("from base to top", lambda body: body.length())
    mean_radius = derived_number("radius in the middle", lambda body: 0.5 * sum(body.radii()))
    growth = derived_number("change of radius per height", lambda body: -np.subtract(*body.radii()) / body.length())

    def radii(self) -> tuple[float, float]:
        """Radius of the base and of the top."""
        raise NotImplementedError

    def length(self) -> float:
        """Distance from base to top."""
        return float(np.linalg.norm(np.subtract(self.top, self.base)))

    def axes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Local x, y and z."""
        return axes_across(np.subtract(self.top, self.base))

    def check(self) -> None:
        if not self.length() > 0.0:
            raise SceneError(f"{type(self).__name__}.top: got {self.top}; allowed: a point other than base {self.base}")

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        reach = np.outer(self.radii(), np.sqrt(np.maximum(0.0, 1.0 - self.axes()[2] ** 2)))
        ends = np.array([self.base, self.top])
        return (ends - reach).min(axis=0), (ends + reach).max(axis=0)


BASE, TOP, CAPPED, MIDDLE, AXES, AXIS_V, AXIS_N, HEIGHT, MEAN_RADIUS, GROWTH = _Tapered.offsets()
SIDE, BASE_CAP, TOP_CAP = 0, 1, 2


@kernel
def inside_cone(a: f64, b: f64, c: f64, opening: f64) -> Span:
    """Where a t² + 2 b t + c <= 0 on the nappe that widens along the ray (opening > 0) or narrows."""
    roots = quadratic(a, b, c)
    if a > 0.0:
        return Span(roots.near, roots.far) if roots.near <= roots.far else Span(math.inf, -math.inf)

    # A ray steeper than the side crosses each nappe once; one parallel to it crosses a single time or runs along.
    if a < 0.0:
        apex = -b / a  # where rounding denies the roots, the ray goes through the apex
        if opening > 0.0:
            return Span(roots.far if roots.far >= apex else apex, math.inf)
        return Span(-math.inf, roots.near if roots.near <= apex else apex)
    if b == 0.0:
        return Span(-math.inf, math.inf) if c <= 0.0 else Span(math.inf, -math.inf)
    return Span(-math.inf, roots.near) if b > 0.0 else Span(roots.near, math.inf)


@implements(intersect, _Tapered)
def intersect_tapered(body: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> Hit:
    if not is_ray(o, d):
        return miss()
    middle = vec3_at(body, MIDDLE)
    t = nearest_parameter(o, d, middle)
    p = transform_normal(body, AXES, o + d * t - middle)
    q = transform_normal(body, AXES, d)

    # Intersect the cone's interval with the slab's.
    k = f64_at(body, GROWTH)
    r = f64_at(body, MEAN_RADIUS) + k * p.z
    rise = k * q.z
    half = 0.5 * f64_at(body, HEIGHT)
    side = inside_cone(q.x * q.x + q.y * q.y - rise * rise, p.x * q.x + p.y * q.y - rise * r,
                       p.x * p.x + p.y * p.y - r * r, rise)  # fmt: skip
    caps = slab(-half, half, p.z, q.z)
    near, far = max(side.near, caps.near), min(side.far, caps.far)
    if not near <= far:
        return miss()

    # Open ends let the ray pass where it would cross a cap.
    capped = i64_at(body, CAPPED) != 0
    if t_min < t + near < t_max and (capped or near == side.near):
        part = SIDE if near == side.near else (BASE_CAP if q.z > 0.0 else TOP_CAP)
        return Hit(t + near, part, 0.0, 0.0)
    if t_min < t + far < t_max and (capped or far == side.far):
        part = SIDE if far == side.far else (TOP_CAP if q.z > 0.0 else BASE_CAP)
        return Hit(t + far, part, 0.0, 0.0)
    return miss()


@implements(surface, _Tapered)
def surface_of_tapered(body: Table, hit: Hit, p: Vec3) -> Surface:
    q = transform_normal(body, AXES, p - vec3_at(body, MIDDLE))
    rho = math.sqrt(q.x * q.x + q.y * q.y)
    k, h, r = f64_at(body, GROWTH), f64_at(body, HEIGHT), f64_at(body, MEAN_RADIUS)
    around = Vec3(-q.y, q.x, 0.0) * (2.0 * math.pi) if rho > 0.0 else Vec3(0.0, 1.0, 0.0)
    if hit.prim == SIDE:
        v = q.z / h + 0.5
        n = Vec3(q.x, q.y, -k * rho) if rho > 0.0 else Vec3(0.0, 0.0, -k)  # an apex looks along the axis
    else:
        up = 1.0 if hit.prim == TOP_CAP else -1.0
        v = rho / (r + 0.5 * up * k * h)
        n = Vec3(0.0, 0.0, up)
    n = transform_vector(body, AXES, n)
    return Surface(n, n, turn(q.x, q.y), min(1.0, max(0.0, v)), transform_vector(body, AXES, around))
