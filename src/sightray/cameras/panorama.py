"""Panoramas: all the way round in one picture."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import implements
from sightray.cameras.base import Ray, generate_ray
from sightray.cameras.central import _Aimed, central_ray
from sightray.errors import SceneError
from sightray.fields import choice, derived_number, number
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, i64_at
from sightray.mathlib.vec import Vec3

EQUIRECTANGULAR, CYLINDRICAL = 0, 1
FLATTEST = 179.0  # degrees that a cylinder can show from bottom to top; at 180 it would be infinitely high


class PanoramaCamera(_Aimed):
    """Looks all the way round from `eye`: columns are headings, rows are pitches.

    The middle of the picture looks at `target`. Heading turns to the right: that of column x is ``hfov (x/width - 1/2)``.
    With pitch counted upwards from the horizon, the plane across `up`'s image in the camera,

    - ``"equirectangular"`` rows are linear in the pitch: ``pitch = vfov (1/2 - y/height)``. With 360 by 180 degrees it
      is the latitude-longitude map of the whole sphere, which environment lights read;
    - ``"cylindrical"`` rows are linear in its tangent: ``tan pitch = 2 tan(vfov/2) (1/2 - y/height)``. It is what is
      painted on the inside of a cylinder: plumb lines stay straight.

    In the camera's frame (+x right, +y down, +z forward) the line of sight is
    ``(sin heading cos pitch, -sin pitch, cos heading cos pitch)``.

    References
    ----------
    R. Szeliski, H.-Y. Shum, "Creating full view panoramic image mosaics and environment maps", SIGGRAPH 1997.
    """

    projection: str = choice("what rows are linear in", ("equirectangular", "cylindrical"), default="equirectangular")
    hfov: float = number("headings from the left to the right edge", default=360.0, above=0, at_most=360,
                         unit="degrees")  # fmt: skip
    vfov: float | None = number("pitches from the lower to the upper edge; None: 180, or 90 on a cylinder",
                                default=None, above=0, at_most=180, optional=True, unit="degrees")  # fmt: skip
    _across: Any = derived_number("headings in the picture, rad", lambda c: math.radians(c.hfov))
    _upright: Any = derived_number("pitches in the picture, rad, or the height of the cylinder", lambda c: c.extent())

    def check(self) -> None:
        super().check()
        if self.projection == "cylindrical" and self.vfov is not None and self.vfov > FLATTEST:
            raise SceneError(
                f"PanoramaCamera.vfov: got {self.vfov:g} on a cylinder; allowed: at most {FLATTEST:g} (degrees)"
            )

    def extent(self) -> float:
        """What rows count, from the lower to the upper edge: radians of pitch, or its tangent on a cylinder."""
        if self.projection == "equirectangular":
            return math.radians(180.0 if self.vfov is None else self.vfov)
        return 2.0 * math.tan(math.radians(90.0 if self.vfov is None else self.vfov) / 2)

    def directions(self, xy: np.ndarray) -> np.ndarray:
        heading = math.radians(self.hfov) * (xy[..., 0] / self.width - 0.5)
        rise = self.extent() * (0.5 - xy[..., 1] / self.height)
        if self.projection == "cylindrical":
            return np.stack([np.sin(heading), -rise, np.cos(heading)], axis=-1)
        return np.stack([np.sin(heading) * np.cos(rise), -np.sin(rise), np.cos(heading) * np.cos(rise)], axis=-1)

    def pixels(self, p: np.ndarray) -> np.ndarray:
        heading, level = np.arctan2(p[..., 0], p[..., 2]), np.hypot(p[..., 0], p[..., 2])
        rise = -p[..., 1] / level if self.projection == "cylindrical" else np.arctan2(-p[..., 1], level)
        x = self.width * (0.5 + heading / math.radians(self.hfov))
        y = self.height * (0.5 - rise / self.extent())
        found = np.stack([x, y], axis=-1)
        return np.where(np.isfinite(found).all(-1, keepdims=True) & p.any(-1, keepdims=True), found, np.nan)


PROJECTION, _, _, ACROSS, UPRIGHT = PanoramaCamera.offsets()[-5:]
WIDTH, HEIGHT = PanoramaCamera.offsets()[:2]


@implements(generate_ray, PanoramaCamera)
def generate_panorama_ray(camera: Table, x: f64, y: f64, lens_u: f64, lens_v: f64, time: f64) -> Ray:
    heading = f64_at(camera, ACROSS) * (x / i64_at(camera, WIDTH) - 0.5)
    rise = f64_at(camera, UPRIGHT) * (0.5 - y / i64_at(camera, HEIGHT))
    level, up = math.cos(rise), math.sin(rise)
    if i64_at(camera, PROJECTION) == CYLINDRICAL:
        level, up = 1.0, rise
    return central_ray(camera, Vec3(math.sin(heading) * level, -up, math.cos(heading) * level))
