"""The contract of cameras.

A camera turns continuous pixel coordinates into rays of sight in the world. The image spans [0, width] x [0, height],
row 0 is on top, and the centre of the top-left pixel is (0.5, 0.5). The camera's own frame is OpenCV's: +x right,
+y down, +z forward.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from sightray._jit import implements, kernel, method
from sightray.errors import SceneError
from sightray.fields import derived_integer, derived_number, derived_vector, integer, number
from sightray.mathlib.eight_paths import load8v, put_lane
from sightray.mathlib.eights import F64x8, Vec3x8, dot8, splat8v, sqrt8d, store8d
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, i64_at, scratch, vec3_at
from sightray.mathlib.vec import Vec3, normalize
from sightray.registry import Member

MAX_SIDE = 65_536
LENS, MOMENT = 1, 2  # what may differ between two rays through the same place of the picture


class Ray(NamedTuple):
    """A ray of sight: unit direction, or one of length zero, which meets nothing, where a pixel sees nothing."""

    origin: Vec3  # its 4th lane is the time, seconds
    direction: Vec3


class Rays8(NamedTuple):
    """Eight rays of sight, without their times."""

    origin: Vec3x8
    direction: Vec3x8


class Camera(Member, family="cameras"):
    """Base of all cameras."""

    width: int = integer("image width", default=640, at_least=1, at_most=MAX_SIDE, unit="pixels")
    height: int = integer("image height", default=480, at_least=1, at_most=MAX_SIDE, unit="pixels")
    shutter_open: float = number("when the exposure of the top row begins", default=0.0, unit="s")
    shutter_close: float = number("when it ends; the same for a picture of an instant", default=0.0, unit="s")
    readout: float = number("how much later the bottom row is exposed (rolling shutter)", default=0.0, unit="s")
    _spread: Any = derived_number("angle between neighbouring rays of sight, rad", lambda c: c.pixel_angle())
    _apart: Any = derived_number("distance between where neighbouring rays start, m", lambda c: c.pixel_distance())
    _chance: Any = derived_integer("what differs from sample to sample: 1 the lens, 2 the time", lambda c: c.chance())

    def world_from_camera(self) -> np.ndarray:
        """Pose, (4, 4) float64: columns +x right, +y down, +z forward, and the eye."""
        raise NotImplementedError(f"{type(self).__name__} does not state its pose")

    def project(self, points: Any) -> np.ndarray:
        """Where points are seen.

        Parameters
        ----------
        points : (..., 3) float, metres, world

        Returns
        -------
        (..., 2) float64, continuous pixel coordinates, also beyond the image; NaN for points behind the camera.
        """
        raise NotImplementedError(f"{type(self).__name__} cannot project points")

    def rays(self, pixels: Any) -> tuple[np.ndarray, np.ndarray]:
        """Rays of sight: the same as `generate_ray`, for arrays.

        Parameters
        ----------
        pixels : (..., 2) float, continuous pixel coordinates; the centre of the top-left pixel is (0.5, 0.5)

        Returns
        -------
        origins, directions : (..., 3) float64 each, metres, world; directions have unit length, or length zero where
        the pixel sees nothing, as outside the image circle of a fisheye lens.
        """
        raise NotImplementedError(f"{type(self).__name__} cannot list its rays")

    def in_camera(self, points: Any) -> np.ndarray:
        """World points in the camera's frame, (..., 3) float64, metres: x right, y down, z forward (the depth)."""
        pose = self.world_from_camera()
        return (coordinates(points, 3, f"{type(self).__name__}: points") - pose[:3, 3]) @ np.linalg.inv(pose[:3, :3]).T

    def pixel_angle(self) -> float:
        """Angle between the rays of the two pixels in the middle of the picture, radians."""
        x, y = self.width / 2, self.height / 2
        _, (a, b) = self.rays([(x - 0.5, y), (x + 0.5, y)])
        return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))

    @property
    def has_lens(self) -> bool:
        """Whether it matters through which place of a lens a ray goes."""
        return False

    def eye_of_all_rays(self) -> np.ndarray | None:
        """The point, (3,) float64, where all rays of sight begin; None if they begin at several, or it is not known."""
        one = self.chance() == 0 and self.readout == 0.0 and self.pixel_distance() == 0.0
        if not one or type(self).world_from_camera is Camera.world_from_camera:
            return None
        return self.world_from_camera()[:3, 3]

    def chance(self) -> int:
        """What of a ray is left to chance, as bits: `LENS`, `MOMENT`. The engine draws no numbers for the rest."""
        return LENS * self.has_lens + MOMENT * (self.shutter_close > self.shutter_open)

    def pixel_distance(self) -> float:
        """Distance between where the rays of the two pixels in the middle start, metres; 0 if all leave one point."""
        x, y = self.width / 2, self.height / 2
        (a, b), _ = self.rays([(x - 0.5, y), (x + 0.5, y)])
        return float(np.linalg.norm(b - a))

    def check(self) -> None:
        if self.shutter_close < self.shutter_open:
            raise SceneError(
                f"{type(self).__name__}.shutter_close: got {self.shutter_close:g}, before shutter_open "
                f"{self.shutter_open:g}; allowed: the same time or later"
            )

    def resized(self, width: int, height: int) -> Any:
        """The same view with another number of pixels."""
        return self.replace(width=width, height=height)


WIDTH, HEIGHT, SHUTTER_OPEN, SHUTTER_CLOSE, READOUT, SPREAD, APART, CHANCE = Camera.offsets()


@method(0)
def generate_ray(camera: Table, x: f64, y: f64, lens_u: f64, lens_v: f64, time: f64) -> Ray:
    """The ray of sight through continuous pixel coordinates, at a time in seconds.

    `lens_u` and `lens_v` in [0, 1) choose the place on the lens, if there is one; (0.5, 0.5) is its centre.
    """
    raise NotImplementedError


@kernel
def sight_ray(camera: Table, x: f64, y: f64, lens_u: f64, lens_v: f64, time_u: f64) -> Ray:
    """The ray of sight at a moment of the exposure, `time_u` in [0, 1); its origin carries the time in its 4th lane.

    Points on the ray, and rays that start there, inherit the time, so everything along a path sees the same moment.
    """
    time = f64_at(camera, SHUTTER_OPEN)
    time += time_u * (f64_at(camera, SHUTTER_CLOSE) - time) + y / i64_at(camera, HEIGHT) * f64_at(camera, READOUT)
    ray = generate_ray(camera, x, y, lens_u, lens_v, time)
    o = ray.origin
    return Ray(Vec3(o.x, o.y, o.z, time), ray.direction)


@method(1, form_of=(generate_ray,))
def generate_eight(camera: Table, x: F64x8, y: F64x8, lens_u: F64x8, lens_v: F64x8, time: F64x8) -> Rays8:
    """`generate_ray` for eight places and moments."""
    raise NotImplementedError


@implements(generate_eight, Camera)
def generate_one_by_one(camera: Table, x: F64x8, y: F64x8, lens_u: F64x8, lens_v: F64x8, time: F64x8) -> Rays8:
    words = scratch(88)
    store8d(words, 0, x)
    store8d(words, 8, y)
    store8d(words, 16, lens_u)
    store8d(words, 24, lens_v)
    store8d(words, 32, time)
    for k in range(8):
        ray = generate_ray(
            camera, f64_at(words, k), f64_at(words, 8 + k), f64_at(words, 16 + k), f64_at(words, 24 + k),
            f64_at(words, 32 + k),
        )  # fmt: skip
        put_lane(words, 40 + k, ray.origin)
        put_lane(words, 64 + k, ray.direction)
    return Rays8(load8v(words, 40), load8v(words, 64))


@kernel
def moments(camera: Table, y: F64x8, time_u: F64x8) -> F64x8:
    """When eight rays through these rows are sent, in seconds; see `sight_ray`."""
    start = f64_at(camera, SHUTTER_OPEN)
    row = y * (f64_at(camera, READOUT) / i64_at(camera, HEIGHT))
    return time_u * (f64_at(camera, SHUTTER_CLOSE) - start) + row + start


class _Pinhole(Camera):
    """Perspective cameras in any parametrisation: all rays leave the eye, directions are linear in the pixel.

    Subclasses state `world_from_camera` and `intrinsics`; direction = corner + x * right + y * down.
    """

    _eye: Any = derived_vector("centre of projection", lambda c: c.world_from_camera()[:3, 3])
    _corner: Any = derived_vector("direction to the top-left corner", lambda c: c.plane()[0])
    _right: Any = derived_vector("change of direction by one pixel to the right", lambda c: c.plane()[1])
    _down: Any = derived_vector("change of direction by one pixel down", lambda c: c.plane()[2])

    def intrinsics(self) -> np.ndarray:
        """Matrix K, (3, 3) float64, pixels: ``[u, v, 1] ~ K @ p_camera``, top-left pixel centre at (0.5, 0.5)."""
        raise NotImplementedError

    def plane(self) -> np.ndarray:
        """Directions to the corner, and by one pixel right and down: (3, 3) float64, a row each, world."""
        inverse = np.linalg.inv(self.intrinsics())
        columns = self.world_from_camera()[:3, :3] @ inverse
        return np.stack([columns[:, 2], columns[:, 0], columns[:, 1]])

    def project(self, points: Any) -> np.ndarray:
        p = self.in_camera(points)
        z = np.where(p[..., 2:] > 0, p[..., 2:], np.nan)
        return (p / z) @ self.intrinsics()[:2].T

    def rays(self, pixels: Any) -> tuple[np.ndarray, np.ndarray]:
        corner, right, down = self.plane()
        xy = coordinates(pixels, 2, f"{type(self).__name__}: pixels")
        d = corner + xy[..., :1] * right + xy[..., 1:] * down
        d /= np.linalg.norm(d, axis=-1, keepdims=True)
        return np.broadcast_to(self.world_from_camera()[:3, 3], d.shape).copy(), d


_EYE, _CORNER, _RIGHT, _DOWN = _Pinhole.offsets()[-4:]


@implements(generate_ray, _Pinhole)
def generate_pinhole_ray(camera: Table, x: f64, y: f64, lens_u: f64, lens_v: f64, time: f64) -> Ray:
    d = vec3_at(camera, _CORNER) + vec3_at(camera, _RIGHT) * x + vec3_at(camera, _DOWN) * y
    return Ray(vec3_at(camera, _EYE), normalize(d))


@implements(generate_eight, _Pinhole)
def generate_eight_pinhole_rays(
    camera: Table, x: F64x8, y: F64x8, lens_u: F64x8, lens_v: F64x8, time: F64x8
) -> Rays8:  # fmt: skip
    right, down = splat8v(vec3_at(camera, _RIGHT)), splat8v(vec3_at(camera, _DOWN))
    d = splat8v(vec3_at(camera, _CORNER)) + right * x + down * y
    return Rays8(splat8v(vec3_at(camera, _EYE)), d * (1.0 / sqrt8d(dot8(d, d))))


def coordinates(values: Any, columns: int, who: str) -> np.ndarray:
    """`values` as float64 of shape (..., columns), or a `SceneError`."""
    try:
        found = np.asarray(values, np.float64)
    except (TypeError, ValueError):
        raise SceneError(f"{who}: got {values!r}; allowed: an array of numbers of shape (..., {columns})") from None
    if found.ndim == 0 or found.shape[-1] != columns:
        raise SceneError(f"{who}: got an array of shape {found.shape}; allowed: (..., {columns})")
    return found


def rolled(pose: np.ndarray, degrees: float) -> np.ndarray:
    """The pose after a clockwise turn about the line of sight, as the camera sees it."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    turn = np.eye(4)
    turn[:2, :2] = [[c, -s], [s, c]]
    return pose @ turn


def _cross(a: Any, b: Any) -> np.ndarray:
    """The cross product of two vectors, sooner than NumPy has found out that they are two."""
    (ax, ay, az), (bx, by, bz) = map(float, a), map(float, b)
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def look_at(eye: Any, target: Any, up: Any, who: str) -> np.ndarray:
    """Camera pose, (4, 4): +z from `eye` to `target`, -y as near to `up` as can be.

    Raises
    ------
    SceneError
        If eye and target coincide, or `up` is parallel to the line of sight.
    """
    forward = np.asarray(target, np.float64) - np.asarray(eye, np.float64)
    if not forward.any():
        raise SceneError(f"{who}: eye and target are the same point {tuple(eye)}; allowed: two different points")
    forward /= np.linalg.norm(forward)
    right = _cross(forward, up)
    if np.linalg.norm(right) <= 1e-12 * np.linalg.norm(up):
        raise SceneError(f"{who}: up {tuple(up)} is parallel to the line of sight; allowed: any other direction")
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = right, _cross(forward, right), forward, eye
    return pose
