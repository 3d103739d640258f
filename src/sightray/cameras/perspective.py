"""The pinhole camera that looks from one point at another."""

from __future__ import annotations

import math

import numpy as np

from sightray.cameras.base import _Pinhole, look_at, rolled
from sightray.fields import Point, number, vector


class PerspectiveCamera(_Pinhole):
    """Looks from `eye` at `target`; `vfov` is the full vertical angle of view.

    Pixels are square unless `pixel_aspect` (width over height of a pixel) says otherwise; `roll` turns the camera
    clockwise about its line of sight, so the picture turns counter-clockwise.
    """

    eye: Point = vector("where the camera stands", default=(0.0, 0.0, 5.0), unit="m")
    target: Point = vector("what it looks at", default=(0.0, 0.0, 0.0), unit="m")
    up: Point = vector("what is up in the picture", default=(0.0, 1.0, 0.0), nonzero=True)
    vfov: float = number("vertical field of view", default=45.0, above=0, below=180, unit="degrees")
    roll: float = number("clockwise turn about the line of sight", default=0.0, unit="degrees")
    pixel_aspect: float = number("width of a pixel over its height", default=1.0, above=0)

    def check(self) -> None:
        super().check()
        self.world_from_camera()

    def world_from_camera(self) -> np.ndarray:
        return rolled(look_at(self.eye, self.target, self.up, type(self).__name__), self.roll)

    def intrinsics(self) -> np.ndarray:
        fy = 0.5 * self.height / math.tan(math.radians(self.vfov) / 2)
        return np.array([[fy / self.pixel_aspect, 0, self.width / 2], [0, fy, self.height / 2], [0, 0, 1]])
