"""Triangle."""

from __future__ import annotations

import numpy as np

from sightray._jit import implements
from sightray.errors import SceneError
from sightray.fields import Point, vector
from sightray.mathlib.axes import unit
from sightray.mathlib.hit import Hit, miss
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, vec3_at
from sightray.mathlib.triangle_tests import moeller_trumbore
from sightray.mathlib.vec import Vec3, cross
from sightray.shapes.base import Shape, Surface, intersect, surface


class Triangle(Shape):
    """The points ``(1 - u - v) a + u b + v c`` with u, v and 1 - u - v in [0, 1].

    Solved for t, u and v by Cramer's rule in the order of T. Möller and B. Trumbore, "Fast, minimum storage
    ray-triangle intersection", Journal of Graphics Tools, 1997; `mathlib.triangle_tests` has it beside the forms that
    lectures derive. An open surface: seen from its outer side the corners run counter-clockwise. For many triangles,
    and for smooth shading, use `Mesh`.

    Texture coordinates: the barycentric weights u of b and v of c.
    """

    flat = True
    a: Point = vector("first corner", unit="m")
    b: Point = vector("second corner", unit="m")
    c: Point = vector("third corner", unit="m")

    def check(self) -> None:
        a, b, c = np.array(self.a), np.array(self.b), np.array(self.c)
        if self.a == self.b or self.a == self.c or np.linalg.norm(np.cross(unit(b - a), unit(c - a))) < 1e-14:
            raise SceneError(f"Triangle.c: got {self.c}; allowed: corners that do not lie on one line")

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        corners = np.array([self.a, self.b, self.c])
        return corners.min(axis=0), corners.max(axis=0)


A, B, C = Triangle.offsets()


@implements(intersect, Triangle)
def intersect_triangle(triangle: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> Hit:
    h = moeller_trumbore(vec3_at(triangle, A), vec3_at(triangle, B), vec3_at(triangle, C), o, d)
    return Hit(h.t, 0, h.u, h.v) if t_min < h.t < t_max else miss()


@implements(surface, Triangle)
def surface_of_triangle(triangle: Table, hit: Hit, p: Vec3) -> Surface:
    a = vec3_at(triangle, A)
    tangent = vec3_at(triangle, B) - a
    n = cross(tangent, vec3_at(triangle, C) - a)
    return Surface(n, n, hit.u, hit.v, tangent)
