"""What a camera's rays are in the terms of calibrations: a `Lens`, for formats that state cameras by numbers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sightray.cameras.base import Camera
from sightray.cameras.calibrated import CalibratedCamera
from sightray.errors import SceneError
from sightray.vision.view import is_linear

PINHOLE, BROWN_CONRADY, KANNALA_BRANDT = "pinhole", "brown_conrady", "kannala_brandt"


class Lens(NamedTuple):
    """Intrinsics of a camera without skew, the centre of the top-left pixel at (0.5, 0.5).

    Attributes
    ----------
    model : "pinhole", "brown_conrady" or "kannala_brandt".
    fx, fy, cx, cy : pixels.
    coefficients : by name, k1 ... k6 p1 p2 of Brown-Conrady (as in OpenCV, with the rational k4 k5 k6), or k1 ... k4 of
        Kannala-Brandt; only those that are not zero.
    """

    model: str
    fx: float
    fy: float
    cx: float
    cy: float
    coefficients: dict[str, float]

    def several(self, *names: str) -> list[float]:
        """Some coefficients in a format's order; zero for those that are not there."""
        return [self.coefficients.get(name, 0.0) for name in names]

    def matrix(self, shift: float = 0.0) -> np.ndarray:
        """K, (3, 3); `shift` is added to the principal point: -0.5 puts the top-left pixel's centre at (0, 0)."""
        return np.array([[self.fx, 0, self.cx + shift], [0, self.fy, self.cy + shift], [0, 0, 1]])


def lens_of(camera: Camera, who: str, models: tuple[str, ...] = (PINHOLE,), but: tuple[str, ...] = ()) -> Lens:
    """The lens of a camera, for a format that knows some models, less the coefficients `but`.

    Raises
    ------
    SceneError
        If the format cannot state this camera.
    """
    kind = type(camera).__name__
    if is_linear(camera):
        model, coefficients, k = PINHOLE, {}, camera.intrinsics()  # type: ignore[attr-defined]
    elif isinstance(camera, CalibratedCamera):
        names = ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2")
        coefficients = {name: getattr(camera, name) for name in names if getattr(camera, name) != 0}
        model, k = camera.model if coefficients or camera.model != BROWN_CONRADY else PINHOLE, camera.intrinsics()
        kind += f" of model {camera.model}"
    else:
        raise SceneError(f"{who}: camera: got a {kind}; allowed: {_allowed(models)}")
    if model not in models:
        raise SceneError(f"{who}: camera: got a {kind}; allowed: {_allowed(models)}")
    extra = [name for name in but if name in coefficients]
    if extra or k[0, 1] != 0:
        raise SceneError(
            f"{who}: camera: got a {kind} with {', '.join(extra or ['skew'])}, which the format cannot state"
        )
    return Lens(model, float(k[0, 0]), float(k[1, 1]), float(k[0, 2]), float(k[1, 2]), coefficients)


def _allowed(models: tuple[str, ...]) -> str:
    names = ["pinholes (PerspectiveCamera, PinholeCamera)"]
    names += [f"CalibratedCamera(model='{model}')" for model in models if model != PINHOLE]
    return ", ".join(names)
