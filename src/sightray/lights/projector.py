"""A projector: a picture that shines from a point."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import implements, kernel
from sightray.errors import SceneError
from sightray.fields import (
    Color,
    Point,
    choice,
    color,
    derived_array,
    derived_integer,
    derived_number,
    derived_vector,
    number,
    vector,
)
from sightray.lights.base import LightBounds, LightSample, illuminate
from sightray.lights.lit import _Lit
from sightray.lights.picture import LUMINANCE, picture, pixel_at, radiant_pixels
from sightray.mathlib.axes import unit
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, i64_at, table_at, vec3_at
from sightray.mathlib.vec import Vec3, dot, grey, length

NEAREST, BILINEAR = 0, 1


class ProjectorLight(_Lit):
    """Throws a picture from `eye` towards `target`, as a pinhole camera of the same pose would take it.

    The point (X, Y, Z) in the frame of the pose (+x right, +y down, +z forward) lies in the pixel

        x = f X/Z + W/2,  y = f Y/Z + H/2,  f = H / (2 tan(vfov/2)),

    in continuous coordinates, the top-left pixel's centre at (0.5, 0.5): what a `PerspectiveCamera` with the same eye,
    target, up and vfov sees there. Its radiant intensity is `intensity` times that pixel, so the irradiance at distance
    r is ``intensity * pixel / r²``, and nothing outside of the picture. Structured light is a projector and a camera
    side by side.

    `filter` says whether pixels have hard edges ("nearest") or blend ("bilinear"). Where a `spectrum` is stated, as for the
    one laser or diode of a scanner, all of the picture has it, and its pixels count by their luminance.

    Reference: R. Hartley, A. Zisserman, Multiple View Geometry, 2nd ed. 2003, section 6.1.
    """

    image: Any = picture()
    eye: Point = vector("where it stands", default=(0.0, 0.0, 5.0), unit="m")
    target: Point = vector("what it looks at", default=(0.0, 0.0, 0.0), unit="m")
    up: Point = vector("what is up in the picture", default=(0.0, 1.0, 0.0), nonzero=True)
    vfov: float = number("vertical angle of the picture", default=30.0, above=0, below=180, unit="degrees")
    intensity: Color = color("radiant intensity where the picture is white", default=1.0, unit="W/sr")
    filter: str = choice("how pixels are blended", ("nearest", "bilinear"), default="bilinear")
    _right: Any = derived_vector("x axis of the pose", lambda p: p.world_from_projector()[:3, 0])
    _down: Any = derived_vector("y axis of the pose", lambda p: p.world_from_projector()[:3, 1])
    _forward: Any = derived_vector("z axis of the pose", lambda p: p.world_from_projector()[:3, 2])
    _focal: Any = derived_number("focal length in pixels", lambda p: p.focal())
    _width: Any = derived_integer("columns", lambda p: p.pixels.shape[1])
    _height: Any = derived_integer("rows", lambda p: p.pixels.shape[0])
    _pixels: Any = derived_array("colours, three floats each", lambda p: p.pixels)
    _shown: Any = derived_vector("radiant intensity in RGB", lambda p: p.shown())

    @property
    def pixels(self) -> np.ndarray:
        """The picture, (h, w, 3) float32, linear, read-only."""
        return self.__dict__["_picture"]

    def check(self) -> None:
        """Read the file once, so that a missing one is an error where the light is stated."""
        if self.image is None:
            raise SceneError("ProjectorLight.image: missing; it needs a picture file or an array")
        found = radiant_pixels(self.image, "ProjectorLight")
        if self.spectrum is not None:
            found = np.repeat((found.astype(np.float64) @ LUMINANCE)[..., None], 3, axis=2).astype(np.float32)
            found.flags.writeable = False
        object.__setattr__(self, "_picture", found)
        self.world_from_projector()

    def color_of_light(self) -> Any:
        return self.intensity

    def focal(self) -> float:
        """Focal length, pixels."""
        return 0.5 * self.pixels.shape[0] / math.tan(math.radians(self.vfov) / 2)

    def world_from_projector(self) -> np.ndarray:
        """Pose, (4, 4) float64: columns +x right, +y down, +z forward, and the eye."""
        if self.eye == self.target:
            raise SceneError(f"ProjectorLight: eye and target are the same point {self.eye}; allowed: two points")
        forward = unit(np.subtract(self.target, self.eye))
        right = np.cross(forward, unit(self.up))
        if np.linalg.norm(right) <= 1e-12:
            raise SceneError(
                f"ProjectorLight: up {self.up} is parallel to the line of sight; allowed: any other direction"
            )
        pose = np.eye(4)
        pose[:3, 0], pose[:3, 2], pose[:3, 3] = unit(right), forward, self.eye
        pose[:3, 1] = np.cross(forward, pose[:3, 0])
        return pose

    def project(self, points: Any) -> np.ndarray:
        """The pixel that lights each of `points`, (..., 3), metres, world: (..., 2) float64, continuous coordinates.

        Also beyond the picture; NaN for points behind the projector.
        """
        pose = self.world_from_projector()
        q = (np.asarray(points, np.float64) - pose[:3, 3]) @ pose[:3, :3]
        z = np.where(q[..., 2:] > 0, q[..., 2:], np.nan)
        return self.focal() * q[..., :2] / z + np.array([self.pixels.shape[1], self.pixels.shape[0]]) / 2

    def bounds(self) -> LightBounds:
        pose, (h, w, _) = self.world_from_projector(), self.pixels.shape
        half = math.atan(math.hypot(w, h) / 2 / self.focal())
        at = np.array(self.eye)
        return LightBounds(
            at, at, pose[:3, 2], half, 1e-3, float((self.pixels.mean(axis=(0, 1)) * self.shown()).mean())
        )


EYE, _, _, _, _, FILTER, RIGHT, DOWN, FORWARD, FOCAL, WIDTH, HEIGHT, PIXELS, INTENSITY = ProjectorLight.offsets()[1:]


@kernel
def pixel_of(light: Table, x: f64, y: f64) -> Vec3:
    """Colour of the picture at continuous pixel coordinates within it."""
    w, h, pixels = i64_at(light, WIDTH), i64_at(light, HEIGHT), table_at(light, PIXELS)
    if i64_at(light, FILTER) == NEAREST:
        return pixel_at(pixels, w, min(int(x), w - 1), min(int(y), h - 1))
    left, top = math.floor(x - 0.5), math.floor(y - 0.5)
    s, t = x - 0.5 - left, y - 0.5 - top
    first, second = min(max(int(left), 0), w - 1), min(max(int(left) + 1, 0), w - 1)
    above, below = min(max(int(top), 0), h - 1), min(max(int(top) + 1, 0), h - 1)
    upper = pixel_at(pixels, w, first, above) * (1.0 - s) + pixel_at(pixels, w, second, above) * s
    lower = pixel_at(pixels, w, first, below) * (1.0 - s) + pixel_at(pixels, w, second, below) * s
    return upper * (1.0 - t) + lower * t


@implements(illuminate, ProjectorLight)
def illuminate_from_projector(light: Table, p: Vec3, cell: i64, u: f64, v: f64) -> LightSample:
    to_light = vec3_at(light, EYE) - p
    r = length(to_light)
    forward = vec3_at(light, FORWARD)
    z = -dot(forward, to_light)
    if not z > 0.0:
        return LightSample(to_light / r if r > 0.0 else -forward, r, grey(0.0), 0.0)
    focal, w, h = f64_at(light, FOCAL), i64_at(light, WIDTH), i64_at(light, HEIGHT)
    x = 0.5 * w - focal * dot(vec3_at(light, RIGHT), to_light) / z
    y = 0.5 * h - focal * dot(vec3_at(light, DOWN), to_light) / z
    if not (0.0 <= x < w and 0.0 <= y < h):
        return LightSample(to_light / r, r, grey(0.0), 0.0)
    return LightSample(to_light / r, r, vec3_at(light, INTENSITY) * pixel_of(light, x, y) / (r * r), 0.0)
