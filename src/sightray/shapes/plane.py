"""Plane."""

from __future__ import annotations

import math

import numpy as np

from sightray._jit import implements
from sightray.fields import Point, derived_vector, vector
from sightray.mathlib.axes import axes_across
from sightray.mathlib.hit import Hit, miss
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, vec3_at
from sightray.mathlib.vec import Vec3, dot
from sightray.shapes.base import Shape, Surface, intersect, surface


class Plane(Shape):
    """All points p with ``n · (p - q) = 0``: through q = ``point``, perpendicular to n = ``normal``, without end.

    The ray o + t d meets it at ``t = n·(q - o) / n·d``, unless it runs parallel. An open surface: its outer side is
    the one that the normal points to.

    Texture coordinates: metres from ``point`` along two axes in the plane; v points up, u to the right of someone who
    looks at the outer side. On a floor (normal +y), u runs along +x and v along -z.
    """

    flat = True
    point: Point = vector("a point of the plane", default=(0.0, 0.0, 0.0), unit="m")
    normal: Point = vector("direction of the outer side", default=(0.0, 1.0, 0.0), nonzero=True)
    axis_u = derived_vector("unit axis of u", lambda plane: axes_across(plane.normal)[0])
    axis_v = derived_vector("unit axis of v", lambda plane: axes_across(plane.normal)[1])
    axis_n = derived_vector("unit normal", lambda plane: axes_across(plane.normal)[2])

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        return np.full(3, -math.inf), np.full(3, math.inf)


POINT, NORMAL, AXIS_U, AXIS_V, AXIS_N = Plane.offsets()


@implements(intersect, Plane)
def intersect_plane(plane: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> Hit:
    n = vec3_at(plane, AXIS_N)
    slope = dot(n, d)
    if slope == 0.0:
        return miss()
    t = dot(n, vec3_at(plane, POINT) - o) / slope
    return Hit(t, 0, 0.0, 0.0) if t_min < t < t_max else miss()


@implements(surface, Plane)
def surface_of_plane(plane: Table, hit: Hit, p: Vec3) -> Surface:
    n, u = vec3_at(plane, AXIS_N), vec3_at(plane, AXIS_U)
    q = p - vec3_at(plane, POINT)
    return Surface(n, n, dot(q, u), dot(q, vec3_at(plane, AXIS_V)), u)
