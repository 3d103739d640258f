"""`back_project`: the lecture's sub-pixel reconstruction, by sight rays of any pixel coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from sightray.cameras.base import coordinates
from sightray.scene.instance import moves
from sightray.vision.measured import measured, require_camera
from sightray.vision.view import exposure_middle


@dataclass(frozen=True)
class BackProjection:
    """What pixels see of a surface. (...) is the shape of the pixels given, without its last axis.

    Attributes
    ----------
    points : (..., 3) float64, metres, world
        Where the sight ray first meets the surface. NaN where it meets nothing.
    distance : (...) float64, metres
        Along the ray from where it starts: the eye, for cameras that have one. Infinite where it meets nothing.
    normal : (..., 3) float64, world
        Geometric normal there, unit length, pointing outward. NaN where it meets nothing.
    shape : (...) int32
        Index among the shapes that were given, lights not counted; -1 for nothing.
    primitive : (...) int32
        Triangle of a mesh (row of ``faces``), point of a cloud (row of ``points``), or part of another shape; -1 for
        nothing.
    met : (...) bool
        Whether the ray meets anything.
    """

    points: np.ndarray
    distance: np.ndarray
    normal: np.ndarray
    shape: np.ndarray
    primitive: np.ndarray

    @property
    def met(self) -> np.ndarray:
        return self.shape >= 0


def back_project(pixels: Any, camera: Any, geometry: Any, *, threads: int | None = None) -> BackProjection:
    """Intersect the sight rays of continuous pixel coordinates with measured or reconstructed surfaces.

    The inverse of ``camera.project``: hits are decided and computed in double precision, from the very rays of the
    camera, so lens distortion is not undone by resampling. Objects that move are met where they are in the middle of the
    exposure.

    Parameters
    ----------
    pixels : (..., 2) float, continuous pixel coordinates
        The centre of the top-left pixel is (0.5, 0.5); add 0.5 to the coordinates of programs that put it at (0, 0), such
        as OpenCV. They may lie between pixels and beyond the picture. NaN meets nothing.
    camera : Camera
    geometry : Mesh, PointCloud, any other shape, a `Group` or an `Instance`, a list of these, or a `Scene`
        Metres, world. For many calls give a `Scene` without lights: it keeps what rays need of it.
    threads : at most so many; by default one for every core.

    Returns
    -------
    BackProjection

    Raises
    ------
    SceneError
        If an argument is something else, or there is no surface.

    Examples
    --------
    >>> import sightray as sr
    >>> camera = sr.CalibratedCamera(width=640, height=480, fx=500, k1=-0.2)
    >>> wall = sr.Plane(point=(0, 0, 2), normal=(0, 0, -1))
    >>> found = sr.vision.back_project([(320, 240), (100.25, 77.5)], camera, wall)
    >>> found.points[0], camera.project(found.points[1]).round(9)
    (array([0., 0., 2.]), array([100.25,  77.5 ]))
    """
    view = require_camera(camera, "back_project")
    scene = measured(geometry, "back_project")
    if any(map(moves, scene.objects)):
        scene = scene.at(exposure_middle(view))
    origins, directions = view.rays(coordinates(pixels, 2, "back_project: pixels"))
    hits = scene.intersect(origins, directions, threads=threads)
    return BackProjection(hits.position, hits.t, hits.normal, hits.shape, hits.primitive)
