"""The camera of computer vision: focal lengths, principal point, pose."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.cameras.base import _Pinhole
from sightray.errors import SceneError
from sightray.fields import number, other
from sightray.mathlib.transform import Transform

RIGID = 1e-6  # how far the axes may be from orthonormal: what matrices written with seven digits need


def _rigid(value: Any) -> Transform:
    """A rotation and a translation, or a `SceneError` that says which property is missing."""
    pose = Transform(value)
    axes = pose.matrix[:3, :3]
    error = np.abs(axes.T @ axes - np.eye(3)).max()
    if error > RIGID:
        raise SceneError(f"axes are not orthonormal (off by {error:.3g}); allowed: a rotation and a translation")
    if np.linalg.det(axes) < 0:
        raise SceneError("the axes form a mirror image (determinant -1); allowed: a rotation and a translation")
    return pose


class PinholeCamera(_Pinhole):
    """A calibrated camera without distortion: ``x = fx X/Z + cx, y = fy Y/Z + cy`` for (X, Y, Z) in the camera's frame.

    `pose` is ``world_from_camera``, in OpenCV's frame: +x right, +y down, +z forward. Left out, the camera stands at
    the origin and looks along +z with -y up. Left out, the principal point is the middle of the image, and `fy` is
    `fx`. Calibrations that put the *centre* of the top-left pixel at (0, 0), as OpenCV's do, need 0.5 added to cx and
    cy; those that put its corner there, as COLMAP's do, are taken as they are.

    Reference: R. Hartley, A. Zisserman, Multiple View Geometry, 2nd ed. 2003, section 6.1.
    """

    fx: float = number("focal length in widths of a pixel", above=0, unit="pixels")
    fy: float | None = number("focal length in heights of a pixel; None: fx", default=None, above=0, optional=True,
                              unit="pixels")  # fmt: skip
    cx: float | None = number("principal point, x; None: middle", default=None, optional=True, unit="pixels")
    cy: float | None = number("principal point, y; None: middle", default=None, optional=True, unit="pixels")
    pose: Transform = other("world_from_camera, a rigid 4x4 matrix", _rigid, default=None,
                            plain=lambda pose: pose.matrix.tolist())  # fmt: skip

    def world_from_camera(self) -> np.ndarray:
        return self.pose.matrix

    def intrinsics(self) -> np.ndarray:
        fy = self.fx if self.fy is None else self.fy
        cx = self.width / 2 if self.cx is None else self.cx
        cy = self.height / 2 if self.cy is None else self.cy
        return np.array([[self.fx, 0, cx], [0, fy, cy], [0, 0, 1]])

    def resized(self, width: int, height: int) -> PinholeCamera:
        """The same view with another number of pixels, in which focal lengths and principal point are counted."""
        x, y, k = width / self.width, height / self.height, self.intrinsics()
        fx, fy, cx, cy = x * k[0, 0], y * k[1, 1], x * k[0, 2], y * k[1, 2]
        return self.replace(width=width, height=height, fx=fx, fy=fy, cx=cx, cy=cy)
