"""A camera and lights for geometry that comes without."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from sightray.cameras.perspective import PerspectiveCamera
from sightray.errors import SceneError
from sightray.lights.directional import DirectionalLight
from sightray.mathlib.transform import Transform
from sightray.scene.instance import Group, Instance
from sightray.scene.scene import Scene

VFOV = 35.0
FROM_CENTER = np.array([0.6, 0.45, 1.0])  # to the eye: from the front, a little from the right and above
KEY = (-0.35, -1.0, -0.75)  # which way the light travels: from above the viewer's left shoulder
FILL = (-1.0, -0.15, 0.1)  # from the right, to lift the key's shadows


def frame_mesh(objects: Sequence[Any], *, name: str = "", width: int = 640, height: int = 480) -> Scene:
    """A scene around geometry: a camera that sees its bounding sphere from a three-quarter view, +y up, and lights.

    A key light as bright as makes a white matte surface that faces it white, a fill light of a fifth of that, and
    ambient light in front of a neutral grey. There is no floor.

    Parameters
    ----------
    objects : shapes, groups and instances with bounds; at least one.
    name : title of the scene.
    width, height : of the picture, pixels.

    Raises
    ------
    SceneError
        There is nothing to frame, or it has no end (a plane).

    Examples
    --------
    >>> from sightray.shapes.sphere import Sphere
    >>> frame_mesh([Sphere(radius=2)]).camera.target
    (0.0, 0.0, 0.0)
    """
    corners = [_corners(part, Transform()) for part in objects]
    points = np.concatenate(corners) if corners else np.zeros((0, 3))
    if not len(points):
        raise SceneError("frame_mesh: no geometry; allowed: at least one shape with bounds")
    if not np.isfinite(points).all():
        raise SceneError("frame_mesh: geometry without end; allowed: shapes with finite bounds")

    # Take the sphere around the box's centre, and stand where it just fits into the narrower angle of view.
    center = 0.5 * points.min(axis=0) + 0.5 * points.max(axis=0)
    radius = float(np.linalg.norm(points - center, axis=1).max())
    if not 0 < radius < math.inf:
        radius = 1.0
    half = math.atan(math.tan(math.radians(VFOV) / 2) * min(1.0, width / height))
    eye = center + FROM_CENTER / np.linalg.norm(FROM_CENTER) * (1.05 * radius / math.sin(half))
    return Scene(
        *objects,
        DirectionalLight(direction=KEY, irradiance=(math.pi,) * 3),
        DirectionalLight(direction=FILL, irradiance=(0.2 * math.pi,) * 3),
        camera=PerspectiveCamera(eye=eye, target=center, vfov=VFOV, width=width, height=height),
        background=0.3, ambient=0.15, samples=9, name=name,
    )  # fmt: skip


def _corners(part: Any, world_from_parent: Transform) -> np.ndarray:
    """Points, (n, 3) in the world, whose bounding box contains an object: vertices, or the corners of its bounds."""
    here = world_from_parent @ part.transform
    if isinstance(part, Instance):
        return _corners(part.of, here)
    if isinstance(part, Group):
        inner = [_corners(child, here) for child in part.objects]
        return np.concatenate(inner) if inner else np.zeros((0, 3))
    points = getattr(part, "vertices", None)
    if points is None:
        low, high = part.bounds()
        points = np.array([[(low, high)[i >> axis & 1][axis] for axis in range(3)] for i in range(8)])
    elif getattr(part, "faces", None) is not None:
        points = points[np.unique(part.faces)]  # files carry vertices that no triangle uses
    return here.point(points) if np.isfinite(points).all() else points
