"""Polygon."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from sightray._jit import implements, kernel
from sightray.errors import SceneError
from sightray.fields import derived_array, derived_integer, derived_vector, other
from sightray.mathlib.axes import axes_across
from sightray.mathlib.hit import Hit, miss
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, i64_at, table_at, vec3_at
from sightray.mathlib.vec import Vec3, dot
from sightray.shapes.base import Shape, Surface, intersect, surface

_FLATNESS = 1e-6  # of the outline's size


def _outline(value: Any) -> np.ndarray:
    """Check one closed line of at least three points."""
    try:
        raw = np.asarray(value)
    except ValueError:
        raw = np.zeros(0)
    if raw.ndim != 2 or raw.shape[1] != 3 or len(raw) < 3 or raw.dtype.kind not in "iuf" or not np.isfinite(raw).all():
        raise SceneError(f"got {value!r:.60}; allowed: three points or more, an (n, 3) array of finite numbers")
    points = np.array(raw, np.float64, order="C")
    points.flags.writeable = False
    return points


def _holes(value: Any) -> tuple[np.ndarray, ...]:
    try:
        return tuple(_outline(hole) for hole in value)
    except TypeError:
        raise SceneError(f"got {value!r:.60}; allowed: a list of outlines") from None


class Polygon(Shape):
    """The flat region inside a closed line, which may be concave, less its ``holes``.

    The even-odd rule decides: a point is inside if a half-line from it crosses the border an odd number of times
    (M. Shimrat, "Algorithm 112: Position of point relative to polygon", 1962). The border is looked at along the ray,
    which makes the ray itself the origin of a plane (as in S. Woop, C. Benthin, I. Wald, "Watertight ray/triangle
    intersection", 2013): two polygons that share an edge, flat or folded, judge it by the same numbers and leave no
    gap. Points on an edge belong to the polygon. The time is proportional to the number of edges; for thousands of
    them use a `Mesh`. An open surface: seen from its outer side the outline runs counter-clockwise.

    Texture coordinates: metres from the first point along the axes of `Plane`.
    """

    flat = True
    outline: np.ndarray = other("(n, 3) points of the border", _outline, unit="m", plain=lambda a: a.tolist())
    holes: tuple[np.ndarray, ...] = other("borders of the holes", _holes, default=(), unit="m",
                                          plain=lambda holes: [hole.tolist() for hole in holes])  # fmt: skip
    point = derived_vector("a point of the plane", lambda s: s.outline[0])
    axis_u = derived_vector("unit axis of u", lambda s: axes_across(s.area())[0])
    axis_v = derived_vector("unit axis of v", lambda s: axes_across(s.area())[1])
    axis_n = derived_vector("unit normal", lambda s: axes_across(s.area())[2])
    count = derived_integer("number of edges", lambda s: len(s.edges()))
    border = derived_array("both ends of each edge", lambda s: s.edges())

    def area(self) -> np.ndarray:
        """Area inside the outline, holes included, as a vector along the normal (M. Newell's method)."""
        q = self.outline - self.outline[0]
        return 0.5 * np.cross(q, np.roll(q, -1, axis=0)).sum(axis=0)

    def edges(self) -> np.ndarray:
        """All edges, (m, 6): from x y z to x y z."""
        return np.concatenate([np.hstack([line, np.roll(line, -1, axis=0)]) for line in (self.outline, *self.holes)])

    def check(self) -> None:
        area, size = self.area(), np.ptp(self.outline, axis=0).max()
        if not np.linalg.norm(area) > 1e-12 * size * size:
            raise SceneError("Polygon.outline: encloses no area; allowed: points that do not lie on one line")
        normal = axes_across(area)[2]
        for name, line in (("outline", self.outline), *(("holes", hole) for hole in self.holes)):
            off = np.abs((line - self.outline[0]) @ normal).max()
            if off > _FLATNESS * size:
                raise SceneError(
                    f"Polygon.{name}: got a point {off:g} m off the plane; allowed: {_FLATNESS * size:g} m"
                )

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        normal = axes_across(self.area())[2]
        flat = self.outline - np.outer((self.outline - self.outline[0]) @ normal, normal)
        both = np.concatenate([self.outline, flat])
        return both.min(axis=0), both.max(axis=0)


POINT, AXIS_U, AXIS_V, AXIS_N, COUNT, BORDER = Polygon.offsets()


class View(NamedTuple):
    """Two vectors across a ray: what they measure from its origin does not change along it."""

    right: Vec3
    up: Vec3


@kernel
def view_along(d: Vec3) -> View:
    """Axes of space, sheared along the largest component of the direction."""
    x, y, z = abs(d.x), abs(d.y), abs(d.z)
    if z >= x and z >= y:
        return View(Vec3(1.0, 0.0, -d.x / d.z), Vec3(0.0, 1.0, -d.y / d.z))
    if y >= x:
        return View(Vec3(1.0, -d.x / d.y, 0.0), Vec3(0.0, -d.z / d.y, 1.0))
    return View(Vec3(-d.y / d.x, 1.0, 0.0), Vec3(-d.z / d.x, 0.0, 1.0))


@kernel(exact=True)
def measure(border: Table, at: i64, o: Vec3, along: Vec3) -> f64:
    """Coordinate of a corner in the view; the same number for all polygons that have this corner."""
    x, y, z = f64_at(border, at) - o.x, f64_at(border, at + 1) - o.y, f64_at(border, at + 2) - o.z
    return x * along.x + y * along.y + z * along.z


@kernel(exact=True)
def inside_border(border: Table, count: i64, o: Vec3, view: View) -> bool:
    """Even-odd rule for the origin of the view and a half-line to the right; the border is inside."""
    inside = False
    for i in range(count):
        ax, ay = measure(border, 6 * i, o, view.right), measure(border, 6 * i, o, view.up)
        bx, by = measure(border, 6 * i + 3, o, view.right), measure(border, 6 * i + 3, o, view.up)
        if ay == 0.0 and (ax == 0.0 or (by == 0.0 and (ax < 0.0) != (bx < 0.0))):
            return True
        if (ay > 0.0) != (by > 0.0):  # a corner counts with the edge above it only
            side = ax * by - bx * ay  # exactly the negative for the edge's other direction
            if side == 0.0:
                return True
            if (side > 0.0) == (by > 0.0):
                inside = not inside
    return inside


@implements(intersect, Polygon)
def intersect_polygon(polygon: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> Hit:
    n = vec3_at(polygon, AXIS_N)
    slope = dot(n, d)
    if slope == 0.0:
        return miss()
    t = dot(n, vec3_at(polygon, POINT) - o) / slope
    if t_min < t < t_max and inside_border(table_at(polygon, BORDER), i64_at(polygon, COUNT), o, view_along(d)):
        return Hit(t, 0, 0.0, 0.0)
    return miss()


@implements(surface, Polygon)
def surface_of_polygon(polygon: Table, hit: Hit, p: Vec3) -> Surface:
    n, u = vec3_at(polygon, AXIS_N), vec3_at(polygon, AXIS_U)
    q = p - vec3_at(polygon, POINT)
    return Surface(n, n, dot(q, u), dot(q, vec3_at(polygon, AXIS_V)), u)
