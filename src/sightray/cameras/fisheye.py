"""Fisheye lenses by their four ideal projections."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import implements
from sightray.cameras.base import Ray, generate_ray
from sightray.cameras.central import _Aimed, central_ray, no_ray
from sightray.errors import SceneError
from sightray.fields import choice, derived_number, number
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, i64_at
from sightray.mathlib.vec import Vec3

EQUIDISTANT, EQUISOLID, STEREOGRAPHIC, ORTHOGRAPHIC = 0, 1, 2, 3
WIDEST = {"equidistant": 360.0, "equisolid": 360.0, "stereographic": 359.0, "orthographic": 180.0}


class FisheyeCamera(_Aimed):
    """Looks from `eye` at `target` through a fisheye lens; `fov` is the angle across its image circle.

    A point at the angle theta from the line of sight is seen at the distance r from the middle of the picture:

    - ``"equidistant"``: r = f theta, angles are measured with a ruler;
    - ``"equisolid"``: r = 2 f sin(theta/2), areas are solid angles;
    - ``"stereographic"``: r = 2 f tan(theta/2), small circles stay circles;
    - ``"orthographic"``: r = f sin(theta), areas are what a surface facing the camera receives.

    The focal length f, in pixels, follows from the circle: its rim is at theta = fov/2. `circle` is its diameter over
    the smaller side of the picture; ``hypot(width, height) / min(width, height)`` puts the corners on it. Pixels outside
    the circle see nothing.

    Reference: K. Miyamoto, "Fish eye lens", Journal of the Optical Society of America 54(8), 1964.
    """

    projection: str = choice("which radius an angle is seen at", tuple(WIDEST), default="equidistant")
    fov: float = number("angle of view across the image circle", default=180.0, above=0, at_most=360, unit="degrees")
    circle: float = number("diameter of the image circle over the smaller side of the picture", default=1.0, above=0)
    _focal: Any = derived_number("focal length, pixels", lambda c: c.focal())
    _rim: Any = derived_number("square of the image circle's radius, pixels", lambda c: c.rim() ** 2)

    def check(self) -> None:
        super().check()
        if self.fov > WIDEST[self.projection]:
            raise SceneError(
                f"FisheyeCamera.fov: got {self.fov:g}; allowed: at most {WIDEST[self.projection]:g} (degrees) in the "
                f"{self.projection} projection"
            )

    def rim(self) -> float:
        """Radius of the image circle, pixels."""
        return 0.5 * self.circle * min(self.width, self.height)

    def focal(self) -> float:
        """Focal length, pixels."""
        return self.rim() / float(self._radius(np.float64(math.radians(self.fov) / 2)))

    def _radius(self, theta: Any) -> Any:
        """Distance from the middle over the focal length."""
        if self.projection == "equidistant":
            return theta
        if self.projection == "orthographic":
            return np.sin(theta)
        return 2.0 * (np.sin(theta / 2) if self.projection == "equisolid" else np.tan(theta / 2))

    def _angle(self, r: np.ndarray) -> np.ndarray:
        """Angle from the line of sight, of a distance over the focal length."""
        if self.projection == "equidistant":
            return r
        if self.projection == "stereographic":
            return 2.0 * np.arctan(r / 2)
        return np.arcsin(np.minimum(r, 1.0)) if self.projection == "orthographic" else 2 * np.arcsin(r.clip(max=2) / 2)

    def directions(self, xy: np.ndarray) -> np.ndarray:
        x, y = xy[..., 0] - self.width / 2, xy[..., 1] - self.height / 2
        r = np.hypot(x, y)
        theta = self._angle(r / self.focal())
        s = np.where(r > 0, np.sin(theta) / np.where(r > 0, r, 1.0), 0.0)
        seen = x * x + y * y <= self.rim() ** 2
        return np.stack([s * x, s * y, np.cos(theta)], axis=-1) * seen[..., np.newaxis]

    def pixels(self, p: np.ndarray) -> np.ndarray:
        across = np.hypot(p[..., 0], p[..., 1])
        theta = np.arctan2(across, p[..., 2])
        s = self.focal() * self._radius(theta) / np.where(across > 0, across, 1.0)
        seen = (theta <= math.radians(self.fov) / 2 * (1.0 + 1e-12)) & ((across > 0) | (p[..., 2] > 0))
        found = p[..., :2] * s[..., np.newaxis] + np.array([self.width / 2, self.height / 2])
        return np.where(seen[..., np.newaxis], found, np.nan)


PROJECTION, _, _, FOCAL, RIM = FisheyeCamera.offsets()[-5:]
WIDTH, HEIGHT = FisheyeCamera.offsets()[:2]


@implements(generate_ray, FisheyeCamera)
def generate_fisheye_ray(camera: Table, x: f64, y: f64, lens_u: f64, lens_v: f64, time: f64) -> Ray:
    x, y = x - 0.5 * i64_at(camera, WIDTH), y - 0.5 * i64_at(camera, HEIGHT)
    rr = x * x + y * y
    if rr > f64_at(camera, RIM):
        return no_ray(camera)
    if rr == 0.0:
        return central_ray(camera, Vec3(0.0, 0.0, 1.0))
    r, projection = math.sqrt(rr) / f64_at(camera, FOCAL), i64_at(camera, PROJECTION)
    theta = r
    if projection == EQUISOLID:
        theta = 2.0 * math.asin(min(0.5 * r, 1.0))
    elif projection == STEREOGRAPHIC:
        theta = 2.0 * math.atan(0.5 * r)
    elif projection == ORTHOGRAPHIC:
        theta = math.asin(min(r, 1.0))
    s = math.sin(theta) / math.sqrt(rr)
    return central_ray(camera, Vec3(s * x, s * y, math.cos(theta)))
