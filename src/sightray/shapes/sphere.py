"""Sphere."""

from __future__ import annotations

import math

import numpy as np

from sightray._jit import implements
from sightray.fields import Point, number, vector
from sightray.mathlib.hit import Hit, miss
from sightray.mathlib.rays import is_ray
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, vec3_at
from sightray.mathlib.vec import Vec3, dot
from sightray.shapes.base import Shape, Surface, facing, intersect, surface


class Sphere(Shape):
    """All points at distance ``radius`` from ``center``.

    The ray o + t d meets it where ``(d·d) t² + 2 (d·f) t + f·f - r² = 0`` with ``f = o - center``. The discriminant is
    taken from the distance between the centre and the ray's line, which does not cancel for far-away spheres, and the
    roots without subtracting like numbers (E. Haines et al., "Precision Improvements for Ray/Sphere Intersection",
    Ray Tracing Gems, 2019).

    Texture coordinates: u runs once around +y counter-clockwise seen from above, starting at +x; v from the south pole
    (0) to the north pole (1).
    """

    center: Point = vector("centre", default=(0.0, 0.0, 0.0), unit="m")
    radius: float = number("radius", default=1.0, above=0, unit="m")

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        return np.array(self.center) - self.radius, np.array(self.center) + self.radius


CENTER, RADIUS = Sphere.offsets()


@implements(intersect, Sphere)
def intersect_sphere(sphere: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> Hit:
    if not is_ray(o, d):
        return miss()
    f = o - vec3_at(sphere, CENTER)
    r = f64_at(sphere, RADIUS)
    a = dot(d, d)
    b = -dot(f, d)
    foot = f + d * (b / a)  # from the centre to the nearest point of the line
    square = r * r - dot(foot, foot)
    if not square >= 0.0:
        return miss()
    q = b + math.copysign(math.sqrt(a * square), b)
    t0 = (dot(f, f) - r * r) / q
    t1 = q / a
    near, far = min(t0, t1), max(t0, t1)
    if t_min < near < t_max:
        return Hit(near, 0, 0.0, 0.0)
    if t_min < far < t_max:
        return Hit(far, 0, 0.0, 0.0)
    return miss()


@implements(surface, Sphere)
def surface_of_sphere(sphere: Table, hit: Hit, p: Vec3) -> Surface:
    n = p - vec3_at(sphere, CENTER)
    u = math.atan2(-n.z, n.x) / (2.0 * math.pi)
    v = 0.5 + math.asin(min(1.0, max(-1.0, n.y / f64_at(sphere, RADIUS)))) / math.pi
    return Surface(n, n, u - math.floor(u), v, Vec3(n.z, 0.0, -n.x) * (2.0 * math.pi))


@implements(facing, Sphere)
def facing_of_sphere(sphere: Table, hit: Hit, p: Vec3) -> Vec3:
    return p - vec3_at(sphere, CENTER)
