"""Where things are: the poses of objects and items, and how the points of one scene moved to their places in another.

All that labels know of poses they ask here.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from sightray.errors import SceneError
from sightray.mathlib.axes import axes_across
from sightray.scene.compile import Compiled, Item
from sightray.scene.instance import Instance
from sightray.shapes.base import Shape
from sightray.shapes.disk import Disk
from sightray.shapes.mesh import Mesh
from sightray.shapes.plane import Plane
from sightray.shapes.point_cloud import PointCloud
from sightray.shapes.rectangle import Rectangle
from sightray.shapes.sphere import Sphere
from sightray.shapes.torus import Torus
from sightray.shapes.triangle import Triangle

_UNMOVING = ("material", "transform", "name")  # fields that do not say where the points of a shape are


def object_pose(thing: Any) -> np.ndarray:
    """``world_from_object`` of one of a scene's objects, (4, 4) float64.

    A group's is its own transform, an instance's its transform times that of what it shows, a light's the identity.
    """
    if not hasattr(thing, "transform"):
        return np.eye(4)
    own = thing.transform.matrix
    return own @ object_pose(thing.of) if isinstance(thing, Instance) else own


def item_poses(compiled: Compiled) -> np.ndarray:
    """``world_from_object`` of every item, (n, 4, 4) float64."""
    return np.array([item.transform.matrix for item in compiled.items]).reshape(-1, 4, 4)


def outline_points(shape: Shape) -> np.ndarray:
    """Points whose convex hull contains the shape, (n, 3) in its own space: vertices, or the corners of its bounds."""
    if isinstance(shape, Mesh):
        return shape.vertices[np.unique(shape.faces)]
    if isinstance(shape, PointCloud):
        return shape.points
    lower, upper = shape.bounds()
    return np.array(np.meshgrid(*zip(lower, upper, strict=True))).reshape(3, -1).T


# --------------------------------------------------------------------------------------------------- between two scenes


def item_motion(before: Item, after: Item) -> tuple[np.ndarray, np.ndarray | None]:
    """How the points of an item moved: ``after_from_before`` in the world, and the new vertices of a mesh, or None.

    Where there are vertices, the matrix is ``world_from_object`` of the item afterwards: a point goes where the
    barycentric weights of its triangle put it.

    Raises
    ------
    SceneError
        If the two are not the same material body: another kind of shape, or one of another form.
    """
    if deformed(before, after):
        return after.transform.matrix, after.shape.vertices  # type: ignore[attr-defined]
    return after.transform.matrix @ shape_motion(before, after) @ before.transform.inverse, None


def deformed(before: Item, after: Item) -> bool:
    """Whether an item is a mesh whose vertices have moved within its own space; `SceneError` if its faces changed."""
    a, b = before.shape, after.shape
    if not (isinstance(a, Mesh) and isinstance(b, Mesh)) or a is b or np.array_equal(a.vertices, b.vertices):
        return False
    if not np.array_equal(a.faces, b.faces):
        raise _another(before, "faces")
    return True


def on_deformed(before: Mesh, after: Mesh, primitive: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Where points on triangles of a mesh, (n, 3), are after it was deformed, by their barycentric weights: (n, 3)."""
    a, b, c = np.moveaxis(before.vertices[before.faces[primitive]], 1, 0)
    to, n = points - a, np.cross(b - a, c - a)
    size = (n * n).sum(axis=1, keepdims=True)
    v = (np.cross(to, c - a) * n).sum(axis=1, keepdims=True) / size
    w = (np.cross(b - a, to) * n).sum(axis=1, keepdims=True) / size
    a, b, c = np.moveaxis(after.vertices[after.faces[primitive]], 1, 0)
    return a + (b - a) * v + (c - a) * w


def shape_motion(before: Item, after: Item) -> np.ndarray:
    """The affine map of object space, (4, 4), that carries one shape's points to the same points of the other."""
    a, b = before.shape, after.shape
    if type(a) is not type(b):
        raise _another(before, f"kind: it is a {type(b).__name__}")
    names = [name for name in a.fields if hasattr(a, name) and name in a.given and name not in _UNMOVING]
    changed = [name for name in names if not _same(getattr(a, name), getattr(b, name))]
    if not changed:
        return np.eye(4)
    moving, frame_of = _FRAMES.get(type(a), (("center",), None))
    fixed = [name for name in changed if name not in moving]
    if fixed:
        raise _another(before, ", ".join(fixed))
    if frame_of is None:
        shift = np.eye(4)
        shift[:3, 3] = np.subtract(b.center, a.center)  # type: ignore[attr-defined]
        return shift
    return frame_of(b) @ np.linalg.inv(frame_of(a))


def _same(a: Any, b: Any) -> bool:
    if a is b:
        return True
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return np.array_equal(a, b)
    return bool(a == b)


def _another(item: Item, what: str) -> SceneError:
    name = f"'{item.name}'" if item.name else f"number {item.object}"
    return SceneError(
        f"label: object {name}: the {type(item.shape).__name__} of the other scene differs in {what}; "
        "allowed: the same body, moved by its transform, its place, or the vertices of a mesh"
    )


def _columns(*columns: Any) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3] = np.array(columns).T
    return matrix


def _of_flat(u: Any, v: Any, corner: Any) -> np.ndarray:
    n = np.cross(u, v)
    return _columns(u, v, n / np.linalg.norm(n), corner)


_Frames = dict[type, tuple[tuple[str, ...], Callable[[Any], np.ndarray]]]
_FRAMES: _Frames = {  # the fields that may change, and the frame that they state
    Sphere: (("center", "radius"), lambda s: _columns(*(np.eye(3) * s.radius), s.center)),
    Rectangle: (("corner", "edge_u", "edge_v"), lambda r: _of_flat(r.edge_u, r.edge_v, r.corner)),
    Triangle: (("a", "b", "c"), lambda t: _of_flat(np.subtract(t.b, t.a), np.subtract(t.c, t.a), t.a)),
    Disk: (("center", "normal"), lambda d: _columns(*axes_across(d.normal), d.center)),
    Plane: (("point", "normal"), lambda p: _columns(*axes_across(p.normal), p.point)),
    Torus: (("center", "axis"), lambda t: _columns(*axes_across(t.axis), t.center)),
}
