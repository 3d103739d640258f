"""Depth from triangulation, as stereo cameras and structured light measure it: with their noise, steps and holes.

Two eyes at a distance B find a point at the depth z where their disparity is d = f B / z. What they measure is d, with an
error that does not depend on z and, inside the matcher, in steps of a fraction of a pixel. So depths err by

    sigma_z = z² / (f B) sigma_d,

they come in steps that grow with z², and there is no depth where one of the eyes does not see the point (R. Szeliski,
"Computer Vision: Algorithms and Applications", 2nd ed. 2022, chapter 12). A structured-light sensor is the same, with the
projector as second eye. What a surface looks like does not matter here: matching that fails for want of texture, or
at edges, is not modelled.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from sightray.errors import SceneError
from sightray.vision.label import make_labels
from sightray.vision.rigs import stereo_rig
from sightray.vision.sensor import noise_source
from sightray.vision.view import is_linear


@dataclass(frozen=True)
class StereoDepth:
    """A depth sensor whose left eye is the scene's camera.

    Parameters
    ----------
    baseline : metres from the left eye to the right one, or to the projector, along the camera's +x; > 0.
    noise : standard deviation of a disparity, pixels, >= 0.
    step : smallest difference between disparities, pixels, >= 0; 0: none.
    least, most : disparities that the matcher looks for, pixels: they are the farthest and the nearest depth.

    Examples
    --------
    >>> import sightray as sr
    >>> wall = sr.Rectangle(corner=(-5, -5, -2), edge_u=(10, 0, 0), edge_v=(0, 10, 0))
    >>> camera = sr.PinholeCamera(fx=100, cx=8, cy=6, width=16, height=12)
    >>> scene = sr.Scene(wall, camera=camera.replace(pose=sr.Transform.rotate((1, 0, 0), 180)))
    >>> float(StereoDepth(baseline=0.1, noise=0, step=0).capture(scene)[6, 12])
    2.0
    """

    baseline: float = 0.055
    noise: float = 0.1
    step: float = 1 / 16
    least: float = 1.0
    most: float = 128.0

    def __post_init__(self) -> None:
        for name, least in (("baseline", None), ("noise", 0.0), ("step", 0.0), ("least", None), ("most", self.least)):
            value = getattr(self, name)
            number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
            if not number or not math.isfinite(value) or (value <= 0 if least is None else value < least):
                allowed = "a finite number > 0" if least is None else f"a finite number >= {least:g}"
                raise SceneError(f"StereoDepth.{name}: got {value!r}; allowed: {allowed}")

    def capture(self, scene: Any, seed: int = 0, frame: int = 0) -> np.ndarray:
        """The depths that the sensor delivers, beside the exact ones of `sightray.label`.

        Parameters
        ----------
        scene : one with a pinhole camera, whose picture the depths belong to.
        seed, frame : whole numbers >= 0; the noise is a function of both.

        Returns
        -------
        (h, w) float64, metres along the axis of sight; 0 where nothing was measured: what the other eye does not see, what
        is nearer than ``f baseline / most`` or farther than ``f baseline / least``, and the background.

        Raises
        ------
        SceneError
            If the scene has no camera, or one that is no pinhole.
        """
        camera = scene.camera
        if camera is None or not is_linear(camera):
            raise SceneError(f"StereoDepth: got a scene with {camera!r}; allowed: one with a pinhole camera")
        other = stereo_rig(camera, self.baseline).at(camera.world_from_camera())["right"]
        pair = scene.replace(camera=other)
        exact = make_labels(scene, ("disparity", "occlusion", "out_of_view", "instance"), stereo=pair, next=pair)

        # What is matched, and how exactly.
        random = noise_source("StereoDepth", seed, frame)
        measured = exact.disparity + self.noise * random.normal(size=exact.disparity.shape)
        if self.step > 0:
            measured = np.floor(measured / self.step + 0.5) * self.step
        seen = (exact.instance >= 0) & (exact.occlusion == 0) & (exact.out_of_view == 0)
        seen &= (measured >= self.least) & (measured <= self.most)
        reach = camera.intrinsics()[0, 0] * self.baseline
        return np.where(seen, reach / np.where(seen, measured, 1.0), 0.0)
