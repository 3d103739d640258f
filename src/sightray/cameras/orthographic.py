"""Parallel projection: the camera of plans and elevations."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray._jit import implements
from sightray.cameras.base import Camera, Ray, coordinates, generate_ray, look_at, rolled
from sightray.fields import Point, derived_vector, number, vector
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, vec3_at


class OrthographicCamera(Camera):
    """All rays of sight run parallel from `eye` to `target`; they start in the plane through `eye`.

    The picture shows `view_height` metres from its upper to its lower edge, at any depth. Pixels are square unless
    `pixel_aspect` (width over height of a pixel) says otherwise; `roll` turns the camera clockwise about its line of
    sight, so the picture turns counter-clockwise.
    """

    eye: Point = vector("where the camera stands", default=(0.0, 0.0, 5.0), unit="m")
    target: Point = vector("what it looks at", default=(0.0, 0.0, 0.0), unit="m")
    up: Point = vector("what is up in the picture", default=(0.0, 1.0, 0.0), nonzero=True)
    view_height: float = number("height of what is seen", default=2.0, above=0, unit="m")
    roll: float = number("clockwise turn about the line of sight", default=0.0, unit="degrees")
    pixel_aspect: float = number("width of a pixel over its height", default=1.0, above=0)
    _direction: Any = derived_vector("line of sight", lambda c: c.world_from_camera()[:3, 2])
    _corner: Any = derived_vector("where the ray of the top-left corner starts", lambda c: c.plane()[0])
    _right: Any = derived_vector("one pixel to the right", lambda c: c.plane()[1])
    _down: Any = derived_vector("one pixel down", lambda c: c.plane()[2])

    def check(self) -> None:
        super().check()
        self.world_from_camera()

    def world_from_camera(self) -> np.ndarray:
        return rolled(look_at(self.eye, self.target, self.up, "OrthographicCamera"), self.roll)

    def pixel_size(self) -> np.ndarray:
        """Width and height of a pixel, (2,) float64, metres."""
        height = self.view_height / self.height
        return np.array([height * self.pixel_aspect, height])

    def plane(self) -> np.ndarray:
        """Start of the top-left corner's ray, and the steps by one pixel right and down: (3, 3), a row each, world."""
        pose = self.world_from_camera()
        right, down = pose[:3, :2].T * self.pixel_size()[:, np.newaxis]
        return np.stack([pose[:3, 3] - right * (self.width / 2) - down * (self.height / 2), right, down])

    def project(self, points: Any) -> np.ndarray:
        p = self.in_camera(points)
        seen = np.where(p[..., 2:] >= 0, p[..., :2], np.nan)
        return seen / self.pixel_size() + np.array([self.width / 2, self.height / 2])

    def rays(self, pixels: Any) -> tuple[np.ndarray, np.ndarray]:
        corner, right, down = self.plane()
        xy = coordinates(pixels, 2, "OrthographicCamera: pixels")
        origins = corner + xy[..., :1] * right + xy[..., 1:] * down
        return origins, np.broadcast_to(self.world_from_camera()[:3, 2], origins.shape).copy()


_DIRECTION, _CORNER, _RIGHT, _DOWN = OrthographicCamera.offsets()[-4:]


@implements(generate_ray, OrthographicCamera)
def generate_parallel_ray(camera: Table, x: f64, y: f64, lens_u: f64, lens_v: f64, time: f64) -> Ray:
    origin = vec3_at(camera, _CORNER) + vec3_at(camera, _RIGHT) * x + vec3_at(camera, _DOWN) * y
    return Ray(origin, vec3_at(camera, _DIRECTION))
