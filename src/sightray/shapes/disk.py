"""Disk."""

from __future__ import annotations

import math

import numpy as np

from sightray._jit import implements
from sightray.errors import SceneError
from sightray.fields import Point, derived_vector, number, vector
from sightray.mathlib.axes import axes_across, unit
from sightray.mathlib.hit import Hit, miss
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, vec3_at
from sightray.mathlib.transform import transform_normal, transform_vector
from sightray.mathlib.turns import turn
from sightray.mathlib.vec import Vec3, dot
from sightray.shapes.base import Shape, Surface, intersect, surface


class Disk(Shape):
    """The points of a plane at a distance between ``inner_radius`` and ``radius`` from ``center``: a coin or a ring.

    The ray is met with the plane, then ``r_inner² <= |p - c|² <= r²`` decides. An open surface: its outer side is the
    one that ``normal`` points to.

    Texture coordinates: u runs once around the normal, counter-clockwise seen from the outer side, starting at the u
    axis of `Plane`; v from the inner edge (0) to the outer edge (1).
    """

    flat = True
    center: Point = vector("centre", default=(0.0, 0.0, 0.0), unit="m")
    normal: Point = vector("direction of the outer side", default=(0.0, 1.0, 0.0), nonzero=True)
    radius: float = number("outer radius", default=1.0, above=0, unit="m")
    inner_radius: float = number("radius of the hole", default=0.0, at_least=0, unit="m")
    axis_u = derived_vector("unit axis where u = 0", lambda disk: axes_across(disk.normal)[0])
    axis_v = derived_vector("unit axis where u = 1/4", lambda disk: axes_across(disk.normal)[1])
    axis_n = derived_vector("unit normal", lambda disk: axes_across(disk.normal)[2])

    def check(self) -> None:
        if self.inner_radius >= self.radius:
            raise SceneError(f"Disk.inner_radius: got {self.inner_radius:g}; allowed: below radius ({self.radius:g})")

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        reach = self.radius * np.sqrt(np.maximum(0.0, 1.0 - unit(self.normal) ** 2))
        return np.array(self.center) - reach, np.array(self.center) + reach


CENTER, NORMAL, RADIUS, INNER, AXES, AXIS_V, AXIS_N = Disk.offsets()  # AXES: the three rows of object to local


@implements(intersect, Disk)
def intersect_disk(disk: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> Hit:
    n = vec3_at(disk, AXIS_N)
    q = o - vec3_at(disk, CENTER)
    slope = dot(n, d)
    if slope == 0.0:
        return miss()
    t = -dot(n, q) / slope
    p = q + d * t
    r, inner = f64_at(disk, RADIUS), f64_at(disk, INNER)
    if inner * inner <= dot(p, p) <= r * r and t_min < t < t_max:
        return Hit(t, 0, 0.0, 0.0)
    return miss()


@implements(surface, Disk)
def surface_of_disk(disk: Table, hit: Hit, p: Vec3) -> Surface:
    n = vec3_at(disk, AXIS_N)
    q = transform_normal(disk, AXES, p - vec3_at(disk, CENTER))
    r, inner = f64_at(disk, RADIUS), f64_at(disk, INNER)
    rho = math.sqrt(q.x * q.x + q.y * q.y)
    v = min(1.0, max(0.0, (rho - inner) / (r - inner)))
    around = Vec3(-q.y, q.x, 0.0) * (2.0 * math.pi) if rho > 0.0 else Vec3(0.0, 1.0, 0.0)
    return Surface(n, n, turn(q.x, q.y), v, transform_vector(disk, AXES, around))
