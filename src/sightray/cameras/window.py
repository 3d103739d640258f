"""The eye and the window through which it looks."""

from __future__ import annotations

import numpy as np

from sightray.cameras.base import _Pinhole, look_at
from sightray.errors import SceneError
from sightray.fields import Point, number, vector


class WindowCamera(_Pinhole):
    """Looks from `eye` towards `target` through a window that stands upright at `distance` before the eye.

    The window spans [left, right] x [bottom, top], in metres from the point where the line of sight pierces it, with x
    to the right and y along `up`. It need not be centred: the halves of a stereo display and the tiles of a wall of
    screens are windows off the middle. The picture fills the window, so pixels are square only if width : height is
    as (right - left) : (top - bottom). In pixels,

        x = width (X - left) / (right - left),  y = height (top - Y) / (top - bottom).

    Reference: A. Appel, "Some techniques for shading machine renderings of solids", AFIPS 1968; the same numbers as
    OpenGL's glFrustum with `distance` as its near plane.
    """

    eye: Point = vector("where the camera stands", default=(0.0, 0.0, 5.0), unit="m")
    target: Point = vector("what it looks at", default=(0.0, 0.0, 0.0), unit="m")
    up: Point = vector("what is up in the picture", default=(0.0, 1.0, 0.0), nonzero=True)
    left: float = number("left edge of the window", default=-1.0, unit="m")
    right: float = number("right edge of the window", default=1.0, unit="m")
    bottom: float = number("lower edge of the window", default=-0.75, unit="m")
    top: float = number("upper edge of the window", default=0.75, unit="m")
    distance: float = number("from the eye to the window", default=2.0, above=0, unit="m")

    def check(self) -> None:
        super().check()
        for low, high in (("left", "right"), ("bottom", "top")):
            a, b = getattr(self, low), getattr(self, high)
            if not a < b:
                raise SceneError(f"WindowCamera: {low} {a:g} is not below {high} {b:g}; allowed: {low} < {high}")
        self.world_from_camera()

    def world_from_camera(self) -> np.ndarray:
        return look_at(self.eye, self.target, self.up, "WindowCamera")

    def intrinsics(self) -> np.ndarray:
        x = self.width / (self.right - self.left)  # pixels per metre of the window
        y = self.height / (self.top - self.bottom)
        return np.array([[x * self.distance, 0, -x * self.left], [0, y * self.distance, y * self.top], [0, 0, 1]])
