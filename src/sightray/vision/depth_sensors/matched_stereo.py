"""Depth from two pictures that are searched for one another's pieces, as stereo cameras do.

A window of the left picture is compared with the windows of the right one that stand d pixels further left in the same
row, for each d, by the zero-mean normalised cross-correlation

    s(d) = sum (L - mean L) (R - mean R) / sqrt(sum (L - mean L)² sum (R - mean R)²),

which is 1 for windows that are alike but for brightness and contrast. The best d wins; a parabola through it and its
neighbours places it between whole numbers. It counts if it is alike enough, clearly better than all others, and if the
right picture, asked the same, agrees (D. Scharstein, R. Szeliski, "A taxonomy and evaluation of dense two-frame stereo
correspondence algorithms", IJCV 47, 2002; H. Hirschmüller, D. Scharstein, "Evaluation of stereo matching costs on images
with radiometric differences", PAMI 31(9), 2009).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray.engine.progress import Callback
from sightray.errors import SceneError
from sightray.fields import integer, number
from sightray.lights.projector import ProjectorLight
from sightray.scene.scene import Scene
from sightray.vision.depth_sensors.base import DepthSensor, mean_light, one_of, projector_beside, require_pinhole
from sightray.vision.rigs import stereo_rig
from sightray.vision.sensor import Sensor, noise_source, sensor

BAND = 32  # rows that are searched at once
DOT = 3  # pixels of the picture that a projected dot is wide
MARGIN = 1.25  # by which the projected dots exceed the picture
FLAT = 1e-10  # of the picture's mean square: windows that differ less from their mean have nothing in them


class MatchedStereo(DepthSensor):
    """Stereo as it is done: the pictures of two eyes, with their noise, and block matching.

    It fails as real ones do: where there is nothing to match or the same again and again, where only one eye sees the
    surface or each sees something else in it (mirrors, glass, gloss), and within half a window of edges, where the
    stronger side wins. The pictures are those of the scene's integrator (`Whitted` unless it states one); the sensor sees
    the mean of their colours. With `dots`, a projector between the eyes throws random dots on what has no texture.
    It wants a pinhole camera. Least and greatest depth are ``f baseline / most`` and ``f baseline / least``.
    """

    baseline: float = number(
        "from the left eye to the right one, along the camera's +x", default=0.1, above=0, unit="m"
    )
    window: int = integer("side of the windows, pixels, odd", default=9, at_least=3, at_most=101)
    least: int = integer("smallest disparity that is looked for, pixels", default=1, at_least=0)
    most: int = integer("largest disparity that is looked for, pixels", default=64, at_least=1, at_most=4096)
    likeness: float = number("least correlation that is trusted", default=0.7, at_least=-1, at_most=1)
    lead: float = number("by how much the best must exceed all others, its neighbours apart", default=0.02, at_least=0)
    agreement: float = number("greatest difference between what left and right say, pixels", default=1.0, at_least=0)
    dots: float = number(
        "radiant intensity of a projector of random dots; 0: none", default=0.0, at_least=0, unit="W/sr"
    )
    sensor: Sensor = sensor(
        "what makes numbers of light, for each eye; its filters must be none", exposure=0.005, full_well=20_000,
        read_noise=5, bits=10)  # fmt: skip
    samples: int = integer("rays of sight for each pixel", default=16, at_least=1, at_most=1 << 16)

    def check(self) -> None:
        """Refuse windows without a middle, empty ranges and colour filters."""
        if self.window % 2 == 0:
            raise SceneError(f"MatchedStereo.window: got {self.window}; allowed: an odd number")
        if self.most <= self.least:
            raise SceneError(f"MatchedStereo.most: got {self.most}; allowed: more than `least`, {self.least}")
        if self.sensor.bayer is not None:
            raise SceneError(f"MatchedStereo.sensor: got bayer {self.sensor.bayer}; allowed: a sensor without filters")

    def accept(self, scene: Scene) -> None:
        require_pinhole(self, scene)

    def capture(self, scene: Scene, seed: int = 0, frame: int = 0, threads: int | None = None,
                progress: Callback | None = None) -> np.ndarray:  # fmt: skip
        disparity = self.match(*self.pictures(scene, seed, frame, threads, progress))
        camera: Any = scene.camera
        reach = camera.intrinsics()[0, 0] * self.baseline
        return np.where(disparity > 0, reach / np.where(disparity > 0, disparity, 1.0), 0.0)

    def pictures(
        self, scene: Scene, seed: int = 0, frame: int = 0, threads: int | None = None, progress: Callback | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """The numbers that the left and the right eye deliver, (h, w) each; arguments as in `capture`."""
        self.accept(scene)
        camera, random = scene.camera, noise_source("MatchedStereo", seed, frame)
        if self.dots > 0:
            scene = scene.replace(objects=(*scene.objects, self.projector(camera)))
        found, part = [], one_of(progress, 2)
        for k, eye in enumerate(stereo_rig(camera, self.baseline).at(camera.world_from_camera()).values()):
            light = mean_light(scene.replace(camera=eye), samples=self.samples, seed=int(random.integers(2**63)),
                               threads=threads, progress=part(k)).mean(axis=-1)  # fmt: skip
            found.append(self.sensor.numbers(self.sensor.collected(light), random))
        return found[0], found[1]

    def projector(self, camera: Any) -> ProjectorLight:
        """The projector midway between the eyes; its dots are the same whatever the seed, as those of a device are."""
        rows, columns = (math.ceil(MARGIN * side / DOT) for side in (camera.height, camera.width))
        dots = np.random.default_rng(rows * 65536 + columns).random((rows, columns)) < 0.5
        vfov = 2 * math.degrees(math.atan(0.5 * rows * DOT / camera.intrinsics()[1, 1]))
        return projector_beside(camera, 0.5 * self.baseline, dots, vfov, self.dots)

    def match(self, left: Any, right: Any) -> np.ndarray:
        """Disparities of a rectified pair: x in the left picture minus x in the right one.

        Parameters
        ----------
        left, right : (h, w) or (h, w, n) numbers, of which the mean over the last axis counts.

        Returns
        -------
        (h, w) float64, pixels of the left picture; NaN where nothing was matched.

        Raises
        ------
        SceneError
            If the pictures differ in size or are not finite.
        """
        pair = [_grey(picture) for picture in (left, right)]
        if pair[0].shape != pair[1].shape:
            raise SceneError(f"MatchedStereo: got pictures of {pair[0].shape} and {pair[1].shape}; allowed: one size")
        height, half = len(pair[0]), self.window // 2
        found = np.full(pair[0].shape, np.nan)
        for first in range(half, height - half, BAND):
            last = min(first + BAND, height - half)
            rows = slice(first - half, last + half)
            found[first:last] = self._choose(self._likeness(pair[0][rows], pair[1][rows]))
        return found

    def _likeness(self, left: np.ndarray, right: np.ndarray) -> np.ndarray:
        """s(d) for each disparity from `least` to `most`, (n, h - window + 1, w); -1 where there are no two windows."""
        side, half = self.window, self.window // 2
        height, width = left.shape[0] - side + 1, left.shape[1]
        scores = np.full((self.most - self.least + 1, height, width), -1.0)
        flat = FLAT * side * side * max((left * left).mean(), (right * right).mean())
        sums = [_boxes(picture, side) for picture in (left, right)]
        spread = [
            np.maximum(_boxes(p * p, side) - s * s / side**2, 0.0) for p, s in zip((left, right), sums, strict=True)
        ]
        for d in range(self.least, min(self.most, width - side) + 1):
            n = sums[0].shape[1] - d
            both = _boxes(left[:, d:] * right[:, : width - d], side) - sums[0][:, d:] * sums[1][:, :n] / side**2
            a, b = spread[0][:, d:], spread[1][:, :n]
            usable = (a > flat) & (b > flat)
            score = np.where(usable, both / np.sqrt(np.where(usable, a * b, 1.0)), -1.0)
            scores[d - self.least, :, half + d : half + d + n] = score
        return scores

    def _choose(self, scores: np.ndarray) -> np.ndarray:
        """The disparity of each pixel, NaN for none: the best, if it passes all checks, between whole numbers."""
        count, height, width = scores.shape
        best = scores.argmax(axis=0)
        y, x = np.mgrid[:height, :width]
        top = scores[best, y, x]

        # Ask the right picture: its pixel x - d is the left one's x.
        theirs = np.full(scores.shape, -1.0)
        for k in range(count):
            d = self.least + k
            theirs[k, :, : max(0, width - d)] = scores[k, :, d:]
        answer = theirs.argmax(axis=0)
        partner = x - (best + self.least)
        agrees = (partner >= 0) & (np.abs(answer[y, np.maximum(partner, 0)] - best) <= self.agreement)

        # Ask for the best of the others.
        others = scores.copy()
        for step in (-1, 0, 1):
            others[np.clip(best + step, 0, count - 1), y, x] = -1.0
        clear = top - others.max(axis=0) >= self.lead

        # Between whole numbers; at the ends of the range nobody knows whether the best lies beyond.
        inner = (best > 0) & (best < count - 1)
        before, after = scores[np.maximum(best - 1, 0), y, x], scores[np.minimum(best + 1, count - 1), y, x]
        bend = before - 2.0 * top + after
        shift = np.where(bend < 0, 0.5 * (before - after) / np.where(bend < 0, bend, 1.0), 0.0)
        good = inner & agrees & clear & (top >= self.likeness) & (top > -1.0)
        return np.where(good, best + self.least + shift, np.nan)


def _grey(picture: Any) -> np.ndarray:
    """A picture as (h, w) float64 about its mean."""
    values = np.asarray(getattr(picture, "pixels", picture), np.float64)
    values = values.mean(axis=-1) if values.ndim == 3 else values
    if values.ndim != 2 or not np.isfinite(values).all():
        raise SceneError(
            f"MatchedStereo: got a picture of shape {values.shape}; allowed: (h, w) or (h, w, n) finite numbers"
        )
    return values - values.mean()


def _boxes(values: np.ndarray, side: int) -> np.ndarray:
    """Sums over all squares of so many pixels, (h - side + 1, w - side + 1)."""
    sums = np.zeros((values.shape[0] + 1, values.shape[1] + 1))
    np.cumsum(np.cumsum(values, axis=0), axis=1, out=sums[1:, 1:])
    return sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side]
