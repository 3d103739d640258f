"""Rectangle."""

from __future__ import annotations

import numpy as np

from sightray._jit import implements
from sightray.errors import SceneError
from sightray.fields import Point, derived_vector, vector
from sightray.mathlib.axes import unit
from sightray.mathlib.hit import Hit, miss
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, vec3_at
from sightray.mathlib.vec import Vec3, dot
from sightray.shapes.base import Shape, Surface, intersect, surface


def _normal(e: Rectangle) -> np.ndarray:
    return unit(np.cross(unit(e.edge_u), unit(e.edge_v)))


def _dual(edge: Point, other: Point, normal: np.ndarray) -> np.ndarray:
    """The vector that measures along `edge`: its products with edge, other and normal are 1, 0, 0."""
    across = np.cross(other, normal)
    return across / np.dot(edge, across)


class Rectangle(Shape):
    """The points ``q + u e_u + v e_v`` with u and v in [0, 1]: a rectangle, or a parallelogram if the edges slant.

    The ray is met with the plane; u and v are then read off with the dual basis, the two vectors in the plane that are
    perpendicular to the other edge. An open surface: its outer side is the one that the normal e_u × e_v points to.

    Texture coordinates: u and v themselves.
    """

    flat = True
    corner: Point = vector("corner q where u = v = 0", default=(-0.5, -0.5, 0.0), unit="m")
    edge_u: Point = vector("from the corner along u", default=(1.0, 0.0, 0.0), unit="m", nonzero=True)
    edge_v: Point = vector("from the corner along v", default=(0.0, 1.0, 0.0), unit="m", nonzero=True)
    normal = derived_vector("unit normal", _normal)
    dual_u = derived_vector("measures u", lambda e: _dual(e.edge_u, e.edge_v, _normal(e)))
    dual_v = derived_vector("measures v", lambda e: _dual(e.edge_v, e.edge_u, _normal(e)))

    def check(self) -> None:
        if np.linalg.norm(np.cross(unit(self.edge_u), unit(self.edge_v))) < 1e-12:
            raise SceneError(f"Rectangle.edge_v: got {self.edge_v}; allowed: not parallel to edge_u {self.edge_u}")

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        q, u, v = (np.array(part) for part in (self.corner, self.edge_u, self.edge_v))
        corners = np.array([q, q + u, q + v, q + u + v])
        return corners.min(axis=0), corners.max(axis=0)


CORNER, EDGE_U, EDGE_V, NORMAL, DUAL_U, DUAL_V = Rectangle.offsets()


@implements(intersect, Rectangle)
def intersect_rectangle(rectangle: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> Hit:
    n = vec3_at(rectangle, NORMAL)
    q = o - vec3_at(rectangle, CORNER)
    slope = dot(n, d)
    if slope == 0.0:
        return miss()
    t = -dot(n, q) / slope
    p = q + d * t
    u, v = dot(p, vec3_at(rectangle, DUAL_U)), dot(p, vec3_at(rectangle, DUAL_V))
    if 0.0 <= u <= 1.0 and 0.0 <= v <= 1.0 and t_min < t < t_max:
        return Hit(t, 0, u, v)
    return miss()


@implements(surface, Rectangle)
def surface_of_rectangle(rectangle: Table, hit: Hit, p: Vec3) -> Surface:
    n = vec3_at(rectangle, NORMAL)
    return Surface(n, n, hit.u, hit.v, vec3_at(rectangle, EDGE_U))
