"""A real camera: what a calibration measured, with the distortion of its lens."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import implements
from sightray.cameras import brown_conrady, kannala_brandt
from sightray.cameras.base import Ray, generate_ray
from sightray.cameras.brown_conrady import unbend
from sightray.cameras.central import _Central, central_ray, no_ray
from sightray.cameras.kannala_brandt import angle_before
from sightray.cameras.pinhole import _rigid
from sightray.errors import SceneError
from sightray.fields import choice, derived_number, number, other
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, i64_at
from sightray.mathlib.transform import Transform
from sightray.mathlib.vec import Vec3

BROWN_CONRADY, KANNALA_BRANDT = 0, 1
COEFFICIENTS = ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2")
OPENCV = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")  # the order of its distortion vectors


class CalibratedCamera(_Central):
    """A camera with a distorting lens, whose rays of sight are exact: ``u = fx x' + skew y' + cx, v = fy y' + cy``.

    (x', y') is the distorted image of the point (X, Y, Z) of the camera's frame, +x right, +y down, +z forward:

    - ``"brown_conrady"``, for common lenses: of (X/Z, Y/Z), by k1 k2 k3 (k4 k5 k6) p1 p2; see `cameras.brown_conrady`;
    - ``"kannala_brandt"``, for fisheyes to 180 degrees and more: of the angle between the point and the line of sight, by
      k1 k2 k3 k4; see `cameras.kannala_brandt`.

    The names are those of OpenCV, whose vectors are ordered k1 k2 p1 p2 k3 k4 k5 k6. The middle of the top-left pixel is
    (0.5, 0.5) here and (0, 0) there: `from_opencv` adds the half pixel to the principal point. Undistortion has no
    closed form; Newton's method solves it to rounding error. Pixels beyond the rim, where the polynomial turns back on
    itself, see nothing, and points there project to NaN.

    `pose` is ``world_from_camera``; left out, the camera stands at the origin and looks along +z with -y up.
    """

    fx: float = number("focal length in widths of a pixel", above=0, unit="pixels")
    fy: float | None = number("focal length in heights of a pixel; None: fx", default=None, above=0, optional=True,
                              unit="pixels")  # fmt: skip
    cx: float | None = number("principal point, x; None: middle", default=None, optional=True, unit="pixels")
    cy: float | None = number("principal point, y; None: middle", default=None, optional=True, unit="pixels")
    skew: float = number("shift of x by y'", default=0.0, unit="pixels")
    model: str = choice("formula of the distortion", ("brown_conrady", "kannala_brandt"), default="brown_conrady")
    k1: float = number("radial, second order", default=0.0)
    k2: float = number("radial, fourth order", default=0.0)
    k3: float = number("radial, sixth order", default=0.0)
    k4: float = number("divisor, second order; Kannala-Brandt: eighth order", default=0.0)
    k5: float = number("divisor, fourth order", default=0.0)
    k6: float = number("divisor, sixth order", default=0.0)
    p1: float = number("tangential, along y", default=0.0)
    p2: float = number("tangential, along x", default=0.0)
    _reach: Any = derived_number("end of the lens: largest r², or widest angle in rad", lambda c: c.reach())
    _xx: Any = derived_number("x' per pixel of x", lambda c: c.inverse()[0, 0])
    _xy: Any = derived_number("x' per pixel of y", lambda c: c.inverse()[0, 1])
    _x0: Any = derived_number("x' of the image's corner", lambda c: c.inverse()[0, 2])
    _yy: Any = derived_number("y' per pixel of y", lambda c: c.inverse()[1, 1])
    _y0: Any = derived_number("y' of the image's corner", lambda c: c.inverse()[1, 2])
    pose: Transform = other("world_from_camera, a rigid 4x4 matrix", _rigid, default=None,
                            plain=lambda pose: pose.matrix.tolist())  # fmt: skip

    @classmethod
    def from_opencv(cls, K: Any, dist: Any = (), *, model: str = "brown_conrady", **others: Any) -> CalibratedCamera:
        """The camera of an OpenCV calibration.

        Parameters
        ----------
        K : (3, 3) float, pixels, with the centre of the top-left pixel at (0, 0)
        dist : up to 14 floats k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 taux tauy, or with ``model="kannala_brandt"``
            (``cv2.fisheye``) up to four, k1 k2 k3 k4
        others : `width`, `height`, `pose` and other fields

        Raises
        ------
        SceneError
            If there are coefficients of a thin prism (s1 ... s4) or a tilted sensor (taux, tauy): not modelled.
        """
        try:
            k, numbers = np.array(K, np.float64), np.array(dist, np.float64).ravel()
        except (TypeError, ValueError):
            raise SceneError("CalibratedCamera.from_opencv: got no numbers; allowed: K (3, 3) and dist (n,)") from None
        if k.shape != (3, 3) or k[1, 0] != 0 or (k[2] != (0, 0, 1)).any():
            raise SceneError(f"CalibratedCamera.from_opencv: K: got {k.tolist()}; allowed: fx s cx, 0 fy cy, 0 0 1")
        names = OPENCV if model == "brown_conrady" else ("k1", "k2", "k3", "k4")
        if numbers[len(names) :].any():
            raise SceneError(
                f"CalibratedCamera.from_opencv: dist: got {numbers.tolist()}; allowed: {' '.join(names)}, then zeros"
            )
        values: dict[str, Any] = dict(zip(names, numbers.tolist(), strict=False))
        return cls(fx=k[0, 0], fy=k[1, 1], cx=k[0, 2] + 0.5, cy=k[1, 2] + 0.5, skew=k[0, 1], model=model, **values,
                   **others)  # fmt: skip

    def check(self) -> None:
        super().check()
        unused = [name for name in COEFFICIENTS[4:] if getattr(self, name) != 0]
        if self.model == "kannala_brandt" and unused:
            raise SceneError(f"CalibratedCamera.{unused[0]}: given for kannala_brandt (k1 k2 k3 k4); allowed: 0")

    def world_from_camera(self) -> np.ndarray:
        return self.pose.matrix

    def intrinsics(self) -> np.ndarray:
        """Matrix K, (3, 3) float64, pixels: ``[u, v, 1] = K @ [x', y', 1]``, top-left pixel centre at (0.5, 0.5)."""
        fy = self.fx if self.fy is None else self.fy
        cx = self.width / 2 if self.cx is None else self.cx
        cy = self.height / 2 if self.cy is None else self.cy
        return np.array([[self.fx, self.skew, cx], [0, fy, cy], [0, 0, 1]])

    def inverse(self) -> np.ndarray:
        """Inverse of the intrinsics."""
        return np.linalg.inv(self.intrinsics())

    def lens(self) -> np.ndarray:
        """The distortion's numbers, (8,) float64: k1 k2 k3 k4 k5 k6 p1 p2."""
        return np.array([getattr(self, name) for name in COEFFICIENTS])

    def reach(self) -> float:
        """Where the lens ends: the largest r² = (X² + Y²)/Z², or the widest angle in radians for Kannala-Brandt."""
        return (kannala_brandt if self.model == "kannala_brandt" else brown_conrady).reach(self.lens())

    def directions(self, xy: np.ndarray) -> np.ndarray:
        p = xy @ self.inverse()[:2, :2].T + self.inverse()[:2, 2]
        if self.model == "brown_conrady":
            x, y = brown_conrady.undistort(self.lens(), p[..., 0], p[..., 1])
            d = np.stack([x, y, np.ones_like(x)], axis=-1)
        else:
            r = np.hypot(p[..., 0], p[..., 1])
            theta = kannala_brandt.angle(self.lens(), r)
            s = np.sin(theta) / np.where(r > 0, r, 1.0)
            d = np.stack([s * p[..., 0], s * p[..., 1], np.cos(theta)], axis=-1)
        return np.where(np.isfinite(d).all(-1, keepdims=True), d, 0.0)

    def pixels(self, p: np.ndarray) -> np.ndarray:
        if self.model == "brown_conrady":
            x, y = p[..., 0] / p[..., 2], p[..., 1] / p[..., 2]
            seen = (p[..., 2] > 0) & (x * x + y * y <= self.reach() * (1 + 1e-12))
            x, y, _ = brown_conrady.distort(self.lens(), np.where(seen, x, np.nan), y)
        else:
            across = np.hypot(p[..., 0], p[..., 1])
            seen = (across > 0) | (p[..., 2] > 0)
            s = kannala_brandt.radius(self.lens(), np.arctan2(across, p[..., 2])) / np.where(across > 0, across, 1.0)
            x, y = np.where(seen, s * p[..., 0], np.nan), s * p[..., 1]
        found = np.stack([x, y], axis=-1) @ self.intrinsics()[:2, :2].T + self.intrinsics()[:2, 2]
        return np.where(np.isfinite(found).all(-1, keepdims=True), found, np.nan)

    def resized(self, width: int, height: int) -> CalibratedCamera:
        """The same view with another number of pixels, in which focal lengths and principal point are counted."""
        x, y, k = width / self.width, height / self.height, self.intrinsics()
        return self.replace(width=width, height=height, fx=x * k[0, 0], fy=y * k[1, 1], cx=x * k[0, 2],
                            cy=y * k[1, 2], skew=x * k[0, 1])  # fmt: skip


MODEL, LENS = CalibratedCamera.offsets()[-15:-13]
XX, XY, X0, YY, Y0 = CalibratedCamera.offsets()[-5:]


@implements(generate_ray, CalibratedCamera)
def generate_calibrated_ray(camera: Table, x: f64, y: f64, lens_u: f64, lens_v: f64, time: f64) -> Ray:
    xs = f64_at(camera, XX) * x + f64_at(camera, XY) * y + f64_at(camera, X0)
    ys = f64_at(camera, YY) * y + f64_at(camera, Y0)
    if i64_at(camera, MODEL) == BROWN_CONRADY:
        plain = unbend(camera, LENS, xs, ys)
        return central_ray(camera, Vec3(plain.x, plain.y, 1.0)) if plain.ok else no_ray(camera)
    r = math.sqrt(xs * xs + ys * ys)
    theta = angle_before(camera, LENS, r)
    if theta != theta:
        return no_ray(camera)
    s = math.sin(theta) / r if r > 0.0 else 0.0
    return central_ray(camera, Vec3(s * xs, s * ys, math.cos(theta)))
