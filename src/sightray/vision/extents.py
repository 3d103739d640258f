"""Tight boxes around shapes, however they are turned."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from sightray.shapes.base import Shape
from sightray.shapes.cone import Cone
from sightray.shapes.cylinder import Cylinder
from sightray.shapes.disk import Disk
from sightray.shapes.polygon import Polygon
from sightray.shapes.rectangle import Rectangle
from sightray.shapes.sphere import Sphere
from sightray.shapes.torus import Torus
from sightray.shapes.triangle import Triangle
from sightray.vision.poses import outline_points


def extent(shape: Shape, matrix: np.ndarray) -> np.ndarray:
    """The box around a shape after the affine map `matrix`, (4, 4): (2, 3) float64, its lower and its upper corner.

    The farthest point in a direction of the target space is the farthest in the direction that the transposed map makes
    of it: the support function of convex geometry. Exact for what `_SUPPORT` knows, meshes and clouds of points; of other
    shapes the corners of their bounds are enclosed. Infinite for what has no end.
    """
    support = _SUPPORT.get(type(shape))
    if support is not None:
        ways, origin = matrix[:3, :3], matrix[:3, 3]
        return np.array([origin - support(shape, -ways), origin + support(shape, ways)])
    points = outline_points(shape)
    if not (matrix == np.eye(4)).all():
        with np.errstate(invalid="ignore"):
            moved = points @ matrix[:3, :3].T + matrix[:3, 3]
        points = np.where(np.isnan(moved), points, moved)  # infinite coordinates stay where they are
    return np.array([points.min(axis=0), points.max(axis=0)])


def _across(ways: np.ndarray, axis: Any) -> np.ndarray:
    """Lengths of the parts of directions, (n, 3), at right angles to an axis."""
    axis = np.asarray(axis, np.float64) / np.linalg.norm(axis)
    return np.linalg.norm(ways - np.outer(ways @ axis, axis), axis=1)


def _of_points(*points: Any) -> Callable[[np.ndarray], np.ndarray]:
    return lambda ways: (ways @ np.array(points, np.float64).T).max(axis=1)


def _of_tapered(body: Cone | Cylinder, ways: np.ndarray) -> np.ndarray:
    aside = _across(ways, np.subtract(body.top, body.base))
    ends = zip((body.base, body.top), body.radii(), strict=True)
    return np.max([ways @ np.array(end) + radius * aside for end, radius in ends], axis=0)


def _of_torus(torus: Torus, ways: np.ndarray) -> np.ndarray:
    around = torus.major_radius * _across(ways, torus.axis)
    return ways @ np.array(torus.center) + around + torus.minor_radius * np.linalg.norm(ways, axis=1)


def _of_rectangle(r: Rectangle, ways: np.ndarray) -> np.ndarray:
    corner, u, v = (np.array(value) for value in (r.corner, r.edge_u, r.edge_v))
    return _of_points(corner, corner + u, corner + v, corner + u + v)(ways)


# For directions, (n, 3), how far a shape reaches in each: the greatest direction · point, (n,).
_SUPPORT: dict[type, Callable[[Any, np.ndarray], np.ndarray]] = {
    Sphere: lambda s, ways: ways @ np.array(s.center) + s.radius * np.linalg.norm(ways, axis=1),
    Disk: lambda s, ways: ways @ np.array(s.center) + s.radius * _across(ways, s.normal),
    Cone: _of_tapered,
    Cylinder: _of_tapered,
    Torus: _of_torus,
    Rectangle: _of_rectangle,
    Triangle: lambda s, ways: _of_points(s.a, s.b, s.c)(ways),
    Polygon: lambda s, ways: _of_points(*s.outline)(ways),
}
