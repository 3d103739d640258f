"""Depth from structured light: a projector throws stripes, a camera beside it finds out which column lights each pixel.

Stripes of half a period are numbered by pictures of a Gray code, each thrown with its negative, so that a pixel is a one
where it is brighter in the first (K. Sato, S. Inokuchi, "Three-dimensional surface measurement by space encoding range
imaging", J. Robotic Systems 2, 1985). Within its period the column x follows from N pictures of a wave,

    I_k = B + A cos(2 pi x / period - 2 pi k / N),   x = period / 2 pi atan2(S, C),

with C and S as in `time_of_flight`; of the x that differ by periods, the one in the numbered stripe is meant (J. Salvi,
S. Fernandez, T. Pribanic, X. Llado, "A state of the art in structured light patterns for surface profilometry", Pattern
Recognition 43, 2010). With sigma_I electrons of noise in a picture the column errs by

    sigma_x = period / 2 pi sqrt(2 / N) sigma_I / A.

The column is a plane in space, which the ray of sight meets in the point.
"""

from __future__ import annotations

import math

import numpy as np

from sightray.engine.progress import Callback
from sightray.errors import SceneError
from sightray.fields import integer, number
from sightray.lights.projector import PIXELS
from sightray.mathlib.table import link
from sightray.scene.compile import compile_scene, require_view
from sightray.scene.scene import Scene
from sightray.vision.depth_sensors.base import DepthSensor, light_of, one_of, projector_beside, sight_rays
from sightray.vision.sensor import Sensor, noise_source, sensor


class StructuredLight(DepthSensor):
    """Structured light: pictures under a projector's Gray code and waves, made, taken and decoded.

    The pictures are those of the scene's integrator (`Whitted` unless it states one) with all its lamps, the projector
    among them; the sensor sees the mean of their colours. So it fails as real ones do: where the projector's
    light does not reach, on what is dark, averted or far, on mirrors and glass, where it is too bright, and with a
    `PathTracer` by light from one surface to another. The projector stands `baseline` along the camera's +x and looks the
    same way. Any camera with a single eye will do.

    A pixel is 0 if its wave is weaker than `least_swing`, if in more than one pair of the Gray code the pictures differ by
    less than that, if a well is full, or if wave and Gray code contradict one another.
    """

    baseline: float = number("from the camera to the projector, along the camera's +x", default=0.1, above=0, unit="m")
    columns: int = integer("of the projector", default=1024, at_least=8, at_most=8192)
    rows: int = integer("of the projector", default=768, at_least=1, at_most=8192)
    vfov: float = number("vertical angle of the projector", default=45.0, above=0, below=180, unit="degrees")
    intensity: float = number("radiant intensity of the projector's white", default=10.0, above=0, unit="W/sr")
    period: int = integer("of the wave, columns", default=16, at_least=4, at_most=4096)
    shifts: int = integer("pictures of the wave", default=4, at_least=3, at_most=64)
    sensor: Sensor = sensor(
        "what makes electrons and numbers of light, for each picture; its filters must be none", exposure=0.01,
        full_well=50_000, read_noise=10, black=0.01)  # fmt: skip
    least_swing: float = number("weakest wave that is trusted, electrons", default=100.0, above=0)
    samples: int = integer("rays of sight for each pixel and picture", default=4, at_least=1, at_most=1 << 16)

    def check(self) -> None:
        """Refuse colour filters, and periods without a middle."""
        if self.sensor.bayer is not None:
            raise SceneError(
                f"StructuredLight.sensor: got bayer {self.sensor.bayer}; allowed: a sensor without filters"
            )
        if self.period % 2:
            raise SceneError(f"StructuredLight.period: got {self.period}; allowed: an even number")

    @property
    def bits(self) -> int:
        """Pictures of the Gray code, not counting negatives."""
        return max(1, math.ceil(math.log2(self.columns / (self.period / 2))))

    def patterns(self) -> np.ndarray:
        """What the projector throws, (2 bits + shifts, columns), 0 to 1: each bit and its negative, then the waves."""
        x = np.arange(self.columns) + 0.5
        stripe = (x / (self.period / 2)).astype(int)
        code = stripe ^ stripe >> 1
        bits = [code >> k & 1 for k in reversed(range(self.bits))]
        waves = [0.5 + 0.5 * np.cos(2 * math.pi * (x / self.period - k / self.shifts)) for k in range(self.shifts)]
        return np.array([one for bit in bits for one in (bit, 1 - bit)] + waves, np.float64)

    def capture(self, scene: Scene, seed: int = 0, frame: int = 0, threads: int | None = None,
                progress: Callback | None = None) -> np.ndarray:  # fmt: skip
        column = self.decode(self.pictures(scene, seed, frame, threads, progress))
        origins, directions = sight_rays(scene.camera)
        focal = 0.5 * self.rows / math.tan(math.radians(self.vfov) / 2)
        slope = (column - 0.5 * self.columns) / focal  # of the column's plane: x = baseline + slope z
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (self.baseline + slope * origins[..., 2] - origins[..., 0]) / (
                directions[..., 0] - slope * directions[..., 2]
            )
            depth = origins[..., 2] + t * directions[..., 2]
        return np.where(np.isfinite(depth) & (t > 0) & (depth > 0), depth, 0.0)

    def pictures(self, scene: Scene, seed: int = 0, frame: int = 0, threads: int | None = None,
                 progress: Callback | None = None) -> np.ndarray:  # fmt: skip
        """The numbers of all pictures, (n, h, w), in the order of `patterns`; arguments as in `capture`."""
        self.accept(scene)
        require_view(scene)
        random = noise_source("StructuredLight", seed, frame)
        render_seed = int(random.integers(2**63))
        patterns, found = self.patterns(), []
        white = np.ones((self.rows, self.columns))
        projector = projector_beside(scene.camera, self.baseline, white, self.vfov, self.intensity)
        lit = compile_scene(scene.replace(objects=(*scene.objects, projector)))
        thrown, part = np.empty((self.rows, self.columns, 3), np.float32), one_of(progress, len(patterns))
        for k, pattern in enumerate(patterns):  # the tables stay, but for what the projector shows
            thrown[:] = pattern[:, np.newaxis]
            link(lit.tables.row_of(projector), PIXELS, lit.tables.space.array(thrown))
            light = light_of(lit, samples=self.samples, seed=render_seed, threads=threads, progress=part(k))
            found.append(self.sensor.numbers(self.sensor.collected(light.mean(axis=-1)), random))
        return np.array(found)

    def decode(self, numbers: np.ndarray) -> np.ndarray:
        """The projector's column that lights each pixel, continuous, (h, w) float64; NaN where that is not known."""
        charge = self.sensor.charge(numbers)
        pairs, waves = charge[: 2 * self.bits], charge[2 * self.bits :]

        # Number the stripe: a Gray code's bit says whether the plain one differs from that before it.
        difference = pairs[0::2] - pairs[1::2]
        ones = np.logical_xor.accumulate(difference > 0, axis=0)
        stripe = np.tensordot(2.0 ** np.arange(self.bits)[::-1], ones, 1)
        middle = (stripe + 0.5) * self.period / 2

        # Place the column within its period.
        angles = 2 * math.pi * np.arange(self.shifts) / self.shifts
        c, s = (np.tensordot(turn(angles), waves, 1) * 2 / self.shifts for turn in (np.cos, np.sin))
        column = self.period / (2 * math.pi) * np.arctan2(s, c)
        column += self.period * np.round((middle - column) / self.period)

        good = np.hypot(c, s) >= self.least_swing
        size = np.sort(np.abs(difference), axis=0)  # one bit may be undecided: between stripes, where the wave decides
        good &= (size[1:] >= self.least_swing).all(axis=0) & ~self.sensor.full(numbers).any(axis=0)
        good &= np.abs(column - middle) <= 0.375 * self.period  # half a stripe, and half as much again
        return np.where(good, column, np.nan)
