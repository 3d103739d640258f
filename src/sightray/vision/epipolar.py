"""Two-view geometry of pinhole cameras, in continuous pixel coordinates (top-left centre at (0.5, 0.5)).

Reference: R. Hartley, A. Zisserman, Multiple View Geometry, 2nd ed. 2003, chapter 9.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.errors import SceneError
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
