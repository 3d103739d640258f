"""Depth from time of flight: a lamp that swings, and pixels that tell by how much its light comes back late.

The lamp shines as 1 + cos(2 pi f t). A pixel compares what arrives with a swing of its own, in N exposures that are
shifted by a = 2 pi k / N each:

    I_k = B + A cos(p - a),   B: all light,   A: contrast times the amplitude of what came from the lamp,

and takes the phase p from p = atan2(S, C), C = 2/N sum I_k cos a, S = 2/N sum I_k sin a. Light that went a way of
s metres has p = 2 pi f s / c; so distances repeat themselves every c / 2f, and several frequencies tell which it is. With
B electrons in an exposure, and a reading noise of r, the phase errs by

    sigma_p = sqrt(2 / N) sqrt(B + r²) / A

(for N = 3, B is less by A/2 cos 3p), which for N = 4 is the limit of R. Lange and P. Seitz ("Solid-state time-of-flight
range camera", IEEE J. Quantum Electronics 37(3), 2001). Light that came by other ways, off a second wall or from another
depth within the same pixel, adds its own swing to the sum (`PhasorTracer`): corners are rounded, edges hang in the air.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from sightray.engine.progress import Callback
from sightray.errors import SceneError
from sightray.fields import Point, flag, integer, number, other, vector
from sightray.integrators.phasor import SPEED_OF_LIGHT, PhasorTracer
from sightray.lights.base import Light
from sightray.lights.point import PointLight
from sightray.scene.scene import Scene
from sightray.vision.depth_sensors.base import DepthSensor, beside, mean_light, one_of, sight_rays
from sightray.vision.sensor import Sensor, noise_source, sensor

NOTHING = 1e-6  # electrons: what rounding leaves of no swing at all
MOST_TURNS = 10_000  # of the finest swing, among which the right one is looked for


class Flight(NamedTuple):
    """What a time-of-flight camera knows of each pixel."""

    depth: np.ndarray  # (h, w) float64, metres along the axis of sight; 0 where nothing was measured
    distance: np.ndarray  # (h, w) float64, metres along the ray of sight; 0 where nothing was measured
    phase: np.ndarray  # (n, h, w) float64, radians, 0 to 2 pi, for each frequency
    amplitude: np.ndarray  # (n, h, w) float64, electrons: A of the formula above


def _frequencies(value: Any) -> tuple[float, ...]:
    given = value if isinstance(value, list | tuple | np.ndarray) else (value,)
    good = [isinstance(f, int | float | np.number) and not isinstance(f, bool) and 1 <= f < 1e12 for f in given]
    if not good or not all(good):
        raise SceneError(f"got {value!r}; allowed: one or more numbers from 1 to 1e12 (Hz)")
    return tuple(float(f) for f in given)


class TimeOfFlight(DepthSensor):
    """Time of flight: a lamp that swings, light that comes back late, by every way that it takes, and phases with noise.

    The lamp is a point that shines to all sides alike. The way is taken to lead from it to the surface and straight to the
    eye, which `lamp` away is a triangle that is undone; ways by second surfaces are not, and lengthen depths. Light of
    the scene's own lamps, and of what glows in it, is steady: of that, the filter before the sensor lets through the share
    `passband`, which adds noise. Depths are those of rays through the pixels' centres. Any camera will do.

    Pixels are 0 whose swing is weaker than `least_amplitude`, or in which a well is full.

    References: R. Lange, P. Seitz, 2001 (above); M. Hansard, S. Lee, O. Choi, R. Horaud, "Time-of-Flight Cameras",
    2013, chapter 1.
    """

    frequencies: Sequence[float] = other(
        "of the lamp, Hz: one, or several among which distances are unwrapped", _frequencies, default=(20e6, 100e6),
        plain=list)  # fmt: skip
    phases: int = integer("exposures for each frequency", default=4, at_least=3, at_most=64)
    lamp: Point = vector("where the lamp is, in the camera's frame", default=(0.0, 0.0, 0.0), unit="m")
    intensity: float = number("radiant intensity of the lamp, mean over its swing", default=5.0, above=0, unit="W/sr")
    contrast: float = number(
        "of lamp and pixels together: share of the light that swings", default=0.8, above=0, at_most=1
    )
    passband: float = number("share of steady light that passes the filter", default=0.05, at_least=0, at_most=1)
    sensor: Sensor = sensor(
        "what makes electrons and numbers of light, for each exposure; its response must be linear, its filters none",
        exposure=0.01, full_well=100_000, read_noise=20, black=0.01, bits=14)  # fmt: skip
    least_amplitude: float = number("weakest swing that is trusted, electrons", default=30.0, at_least=0)
    unwrap: bool = flag("whether several frequencies find out how often the phase went round", default=True)
    reach: float | None = number(
        "farthest distance of the unwrapping; None for all that the frequencies can tell apart", default=None, above=0,
        optional=True, unit="m")  # fmt: skip
    max_depth: int = integer("surfaces on a way of light", default=4, at_least=1, at_most=1000)
    samples: int = integer("ways of light for each pixel", default=32, at_least=1, at_most=1 << 16)

    def check(self) -> None:
        """Refuse sensors whose numbers are no measure of light, and ranges with too many turns to choose from."""
        if self.sensor.response != "linear" or self.sensor.bayer is not None:
            raise SceneError(f"TimeOfFlight.sensor: got {self.sensor!r}; allowed: a linear response, and no filters")
        turns = 2 * self.range * max(self.frequencies) / SPEED_OF_LIGHT
        if turns > MOST_TURNS:
            raise SceneError(
                f"TimeOfFlight.reach: among {turns:.3g} turns of the finest swing; allowed: at most {MOST_TURNS}. State a "
                "reach, or frequencies with a larger common divisor"
            )

    @property
    def range(self) -> float:
        """Distance beyond which distances repeat themselves, metres."""
        if not self.unwrap or len(self.frequencies) == 1:
            return 0.5 * SPEED_OF_LIGHT / max(self.frequencies)
        farthest = 0.5 * SPEED_OF_LIGHT / math.gcd(*(round(f) for f in self.frequencies))
        return farthest if self.reach is None else min(farthest, self.reach)

    def capture(self, scene: Scene, seed: int = 0, frame: int = 0, threads: int | None = None,
                progress: Callback | None = None) -> np.ndarray:  # fmt: skip
        return self.measure(scene, seed, frame, threads, progress).depth

    def measure(self, scene: Scene, seed: int = 0, frame: int = 0, threads: int | None = None,
                progress: Callback | None = None) -> Flight:  # fmt: skip
        """All that the sensor knows; arguments as in `capture`."""
        self.accept(scene)
        random = noise_source("TimeOfFlight", seed, frame)
        options: dict[str, Any] = {"samples": self.samples, "seed": int(random.integers(2**63)), "threads": threads}
        steady, part = np.zeros(()), one_of(progress, 1 + len(self.frequencies))
        if self.passband > 0:
            steady = self.passband * mean_light(scene, **options, progress=part(0))[..., 0]
        lit = self.lit(scene)
        phase, amplitude, full = [], [], np.zeros((), bool)
        for k, frequency in enumerate(self.frequencies, 1):
            swing = PhasorTracer(frequency=frequency, max_depth=self.max_depth)
            cosine, sine, light = np.moveaxis(mean_light(lit, swing, **options, progress=part(k)), -1, 0)
            c, s, cut = self._exposed(steady + light, cosine, sine, random)
            phase.append(np.arctan2(s, c) % (2 * math.pi))
            amplitude.append(np.hypot(c, s))
            full = full | cut
        good = ~full & (np.min(amplitude, axis=0) >= max(self.least_amplitude, NOTHING))
        way = unwrapped(np.array(phase), np.array(amplitude), self.frequencies, 2 * self.range, self.unwrap)
        distance, depth = self._triangle(scene.camera, way)
        good &= distance > 0
        return Flight(np.where(good, depth, 0.0), np.where(good, distance, 0.0), np.array(phase), np.array(amplitude))

    def lit(self, scene: Scene) -> Scene:
        """The scene with the sensor's lamp in place of its own lights, of which only their bodies stay."""
        lamp = PointLight(position=beside(scene.camera, self.lamp), intensity=(self.intensity,) * 3)
        bodies = (thing.shape() if isinstance(thing, Light) else thing for thing in scene.objects)
        return scene.replace(objects=(*(body for body in bodies if body is not None), lamp))

    def _exposed(
        self, light: np.ndarray, cosine: np.ndarray, sine: np.ndarray, random: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The two sums C and S of all exposures, electrons, and whether a well was full in any of them."""
        angles = 2 * math.pi * np.arange(self.phases) / self.phases
        charges = []
        full = np.zeros(light.shape, bool)
        for a in angles:
            swinging = light + self.contrast * (math.cos(a) * cosine + math.sin(a) * sine)
            numbers = self.sensor.numbers(self.sensor.collected(swinging), random)
            full |= self.sensor.full(numbers)
            charges.append(self.sensor.charge(numbers))
        c, s = (np.tensordot(turn(angles), charges, 1) * 2 / self.phases for turn in (np.cos, np.sin))
        return c, s, full

    def _triangle(self, camera: Any, way: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance and depth of the point on each ray of sight that light reaches by a way of that length.

        |t d| + |t d - w| = s, with w from the eye to the lamp, is a plane's equation in t: t = (s² - w²) / 2 (s - w d).
        """
        origins, directions = sight_rays(camera)
        w = np.array(self.lamp) - origins
        aside = np.einsum("hwi,hwi->hw", w, directions)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (way**2 - np.einsum("hwi,hwi->hw", w, w)) / (2 * (way - aside))
        seen = np.isfinite(t) & (np.abs(directions).sum(axis=-1) > 0)
        t = np.where(seen, t, 0.0)
        return t, (origins + t[..., None] * directions)[..., 2]


def unwrapped(
    phase: np.ndarray, amplitude: np.ndarray, frequencies: Sequence[float], longest: float, several: bool
) -> np.ndarray:
    """Lengths of ways, (h, w) metres, from the phases at n frequencies, (n, h, w) radians.

    Of all lengths up to `longest` that the phase at the highest frequency allows, the one that fits the others best, in
    the sense of least squares; then the mean of what all say, weighed by 1 / variance, (frequency amplitude)².
    """
    per_radian = SPEED_OF_LIGHT / (2 * math.pi * np.array(frequencies))  # metres
    finest = int(np.argmax(frequencies))
    turn = 2 * math.pi * per_radian[finest]
    way = phase[finest] * per_radian[finest]
    if not several or len(frequencies) == 1:
        return way
    best, least = way, np.full(way.shape, np.inf)
    for k in range(max(1, math.ceil(longest / turn - 1e-9))):
        trial = way + k * turn
        misfit = sum(_half_turn(p - trial / m) ** 2 for p, m in zip(phase, per_radian, strict=True))
        best, least = np.where(misfit < least, trial, best), np.minimum(misfit, least)
    weights = (amplitude / per_radian[:, None, None]) ** 2
    said = best + _half_turn(phase - best / per_radian[:, None, None]) * per_radian[:, None, None]
    total = weights.sum(axis=0)
    return np.where(total > 0, (weights * said).sum(axis=0) / np.where(total > 0, total, 1.0), best)


def _half_turn(angle: np.ndarray) -> np.ndarray:
    """The same angle from -pi to pi."""
    return angle - 2 * math.pi * np.round(angle / (2 * math.pi))
