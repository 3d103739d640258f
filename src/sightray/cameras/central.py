"""What cameras share whose rays leave one point in directions that are no linear map of the pixel."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray._jit import kernel
from sightray.cameras.base import Camera, Ray, coordinates, look_at, rolled
from sightray.fields import Point, derived_vector, number, vector
from sightray.mathlib.table import Table, vec3_at
from sightray.mathlib.vec import Vec3, normalize


class _Central(Camera):
    """One centre of projection. Subclasses state `world_from_camera`, and the map in the camera's frame twice over:
    `directions` and `pixels`, which invert each other."""

    _eye: Any = derived_vector("centre of projection", lambda c: c.world_from_camera()[:3, 3])
    _right: Any = derived_vector("axis x of the camera", lambda c: c.world_from_camera()[:3, 0])
    _down: Any = derived_vector("axis y of the camera", lambda c: c.world_from_camera()[:3, 1])
    _forward: Any = derived_vector("axis z of the camera", lambda c: c.world_from_camera()[:3, 2])

    def directions(self, xy: np.ndarray) -> np.ndarray:
        """Lines of sight in the camera's frame, (..., 3), of any length; zero where a pixel sees nothing."""
        raise NotImplementedError

    def pixels(self, p: np.ndarray) -> np.ndarray:
        """Pixel coordinates, (..., 2), of points in the camera's frame; NaN where they are not seen."""
        raise NotImplementedError

    def project(self, points: Any) -> np.ndarray:
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            return self.pixels(self.in_camera(points))

    def rays(self, pixels: Any) -> tuple[np.ndarray, np.ndarray]:
        pose = self.world_from_camera()
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            d = self.directions(coordinates(pixels, 2, f"{type(self).__name__}: pixels"))
        size = np.linalg.norm(d, axis=-1, keepdims=True)
        d = (d / np.where(size > 0, size, 1.0)) @ pose[:3, :3].T
        return np.broadcast_to(pose[:3, 3], d.shape).copy(), d


_EYE, _RIGHT, _DOWN, _FORWARD = _Central.offsets()[-4:]


@kernel
def central_ray(camera: Table, d: Vec3) -> Ray:
    """The ray of sight along d, a direction of the camera's frame of any length but zero."""
    world = vec3_at(camera, _RIGHT) * d.x + vec3_at(camera, _DOWN) * d.y + vec3_at(camera, _FORWARD) * d.z
    return Ray(vec3_at(camera, _EYE), normalize(world))


@kernel
def no_ray(camera: Table) -> Ray:
    """For a pixel that sees nothing: a direction of length zero, which meets nothing."""
    return Ray(vec3_at(camera, _EYE), Vec3(0.0, 0.0, 0.0))


class _Aimed(_Central):
    """Central cameras that stand at `eye` and look at `target`."""

    eye: Point = vector("where the camera stands", default=(0.0, 0.0, 5.0), unit="m")
    target: Point = vector("what it looks at", default=(0.0, 0.0, 0.0), unit="m")
    up: Point = vector("what is up in the picture", default=(0.0, 1.0, 0.0), nonzero=True)
    roll: float = number("clockwise turn about the line of sight", default=0.0, unit="degrees")

    def check(self) -> None:
        super().check()
        self.world_from_camera()

    def world_from_camera(self) -> np.ndarray:
        return rolled(look_at(self.eye, self.target, self.up, type(self).__name__), self.roll)
