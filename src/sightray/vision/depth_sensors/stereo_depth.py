"""Depth from triangulation, as stereo cameras and structured light measure it: with their noise, steps and holes.

Two eyes at a distance B find a point at the depth z where their disparity is d = f B / z. What they measure is d, with an
error that does not depend on z and, inside the matcher, in steps of a fraction of a pixel. So depths err by

    sigma_z = z² / (f B) sigma_d,

they come in steps that grow with z², and there is no depth where one of the eyes does not see the point (R. Szeliski,
"Computer Vision: Algorithms and Applications", 2nd ed. 2022, chapter 12). A structured-light sensor is the same, with the
projector as second eye. What a surface looks like does not matter here: `MatchedStereo` and `StructuredLight` make pictures
and search them, and fail where those do.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.engine.progress import Callback
from sightray.errors import SceneError
from sightray.fields import number
from sightray.scene.scene import Scene
from sightray.vision.depth_sensors.base import DepthSensor, require_pinhole
from sightray.vision.label import make_labels
from sightray.vision.rigs import stereo_rig
from sightray.vision.sensor import noise_source


class StereoDepth(DepthSensor):
    """Stereo as a formula: exact disparities with noise and steps, and holes where the other eye does not see.

    It wants a pinhole camera, and measures nothing nearer than ``f baseline / most`` or farther than
    ``f baseline / least``.

    Examples
    --------
    >>> import sightray as sr
    >>> wall = sr.Rectangle(corner=(-5, -5, -2), edge_u=(10, 0, 0), edge_v=(0, 10, 0))
    >>> camera = sr.PinholeCamera(fx=100, cx=8, cy=6, width=16, height=12)
    >>> scene = sr.Scene(wall, camera=camera.replace(pose=sr.Transform.rotate((1, 0, 0), 180)))
    >>> float(StereoDepth(baseline=0.1, noise=0, step=0).capture(scene)[6, 12])
    2.0
    """

    baseline: float = number("from the left eye to the right one, or to the projector, along the camera's +x",
                             default=0.055, above=0, unit="m")  # fmt: skip
    noise: float = number("standard deviation of a disparity, pixels", default=0.1, at_least=0)
    step: float = number("smallest difference between disparities, pixels; 0: none", default=1 / 16, at_least=0)
    least: float = number("smallest disparity that is looked for, pixels: the farthest depth", default=1.0, above=0)
    most: float = number("largest disparity that is looked for, pixels: the nearest depth", default=128.0, above=0)

    def check(self) -> None:
        """Refuse a range of disparities that is empty."""
        if self.most < self.least:
            raise SceneError(f"StereoDepth.most: got {self.most:g}; allowed: at least `least`, {self.least:g}")

    def accept(self, scene: Scene) -> None:
        require_pinhole(self, scene)

    def capture(self, scene: Scene, seed: int = 0, frame: int = 0, threads: int | None = None,
                progress: Callback | None = None) -> np.ndarray:  # fmt: skip
        self.accept(scene)
        camera: Any = scene.camera
        other = stereo_rig(camera, self.baseline).at(camera.world_from_camera())["right"]
        pair = scene.replace(camera=other)
        exact = make_labels(scene, ("disparity", "occlusion", "out_of_view", "instance"), stereo=pair, next=pair,
                            threads=threads, progress=progress)  # fmt: skip

        # What is matched, and how exactly.
        random = noise_source("StereoDepth", seed, frame)
        measured = exact.disparity + self.noise * random.normal(size=exact.disparity.shape)
        if self.step > 0:
            measured = np.floor(measured / self.step + 0.5) * self.step
        seen = (exact.instance >= 0) & (exact.occlusion == 0) & (exact.out_of_view == 0)
        seen &= (measured >= self.least) & (measured <= self.most)
        reach = camera.intrinsics()[0, 0] * self.baseline
        return np.where(seen, reach / np.where(seen, measured, 1.0), 0.0)
