"""Two-view geometry of pinhole cameras, in continuous pixel coordinates (top-left centre at (0.5, 0.5)).

Reference: R. Hartley, A. Zisserman, Multiple View Geometry, 2nd ed. 2003, chapter 9.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from sightray.errors import SceneError
from sightray.vision.legend import Swatches
from sightray.vision.masks import backdrop, draw_line
from sightray.vision.pictures import Painting, palette, title
from sightray.vision.view import View, is_linear


def relative_pose(before: View, after: View) -> np.ndarray:
    """``after_from_before``, (4, 4): camera coordinates of one view in the other's."""
    return after.camera_from_world @ before.world_from_camera


def essential_matrix(before: View, after: View) -> np.ndarray:
    """E = [t]x R, (3, 3) metres: ``y1ᵀ E y0 = 0`` for directions y in the two cameras' frames."""
    pose = relative_pose(before, after)
    x, y, z = pose[:3, 3]
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ pose[:3, :3]


def fundamental_matrix(before: View, after: View) -> np.ndarray:
    """F = K1⁻ᵀ E K0⁻¹, (3, 3): ``x1ᵀ F x0 = 0`` for homogeneous pixels x0 and x1 of a point that does not move."""
    k0, k1 = require_pinhole(before), require_pinhole(after)
    return np.linalg.inv(k1).T @ essential_matrix(before, after) @ np.linalg.inv(k0)


def require_pinhole(view: View) -> Any:
    """K of a view, or a `SceneError`."""
    if not is_linear(view.camera):
        raise SceneError(f"label: {type(view.camera).__name__} is no pinhole; epipolar geometry needs pinholes")
    return view.intrinsics


def marked_pixels(view: View, count: int = 7) -> np.ndarray:
    """Pixels of a picture for which lines are drawn, (n, 2): along its diagonal."""
    shares = (np.arange(count) + 0.5) / count
    return np.stack([shares * view.camera.width, shares * view.camera.height], axis=1)


def paint_pencil(labels: Any, layer: Any, normals: np.ndarray) -> Painting:
    """Epipolar lines over what is seen: where planes through the eye with these normals, (n, 3) in the camera's frame, are
    seen by the picture; with distortion they are curves."""
    pixels = backdrop(labels, palette(len(labels.objects)))
    colors = palette(len(normals))
    angles, pose = np.linspace(0, 2 * np.pi, 721), labels.world_from_camera
    for color, normal in zip(colors, normals, strict=True):
        across, along, _ = np.linalg.svd(normal[None])[2][[1, 2, 0]]
        ways = np.cos(angles)[:, None] * across + np.sin(angles)[:, None] * along
        with np.errstate(invalid="ignore", divide="ignore"):
            seen = labels.camera.project(ways @ pose[:3, :3].T + pose[:3, 3])
        reach = 2 * max(labels.width, labels.height)
        seen[np.abs(seen).max(axis=1) > reach] = np.nan
        for a, b in itertools.pairwise(seen):
            draw_line(pixels, a, b, color)
    places = [f"({x:.0f}, {y:.0f})" for x, y in marked_pixels(labels.views["next"], len(normals))]
    return Painting(
        pixels, Swatches(list(zip(colors, places, strict=True)), f"{title(layer)}: lines of points of next")
    )
