"""From radiance to what a camera delivers: a sensor that counts photons, with the errors that real ones have.

The model is that of the EMVA standard 1288 (release 4.0, 2021): photons arrive at random, the sensor collects electrons
until its wells are full, reading adds noise, and an amplifier and a quantiser make whole numbers of them:

    mean electrons = exposure (sensitivity * vignetting * radiance + dark_current),
    electrons      = Poisson(mean), at most full_well, + Normal(0, read_noise),
    number         = round((2^bits - 1) response(black + (1 - black) electrons / full_well)), cut to its range.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sightray.errors import SceneError, unknown
from sightray.images.transfer import srgb_encode

PATTERNS = {"RGGB": ((0, 1), (1, 2)), "BGGR": ((2, 1), (1, 0)), "GRBG": ((1, 0), (2, 1)), "GBRG": ((1, 2), (0, 1))}
RESPONSES = ("linear", "srgb")


def noise_source(who: str, seed: Any, frame: Any) -> np.random.Generator:
    """Random numbers that are a function of two whole numbers >= 0, or a `SceneError`."""
    for name, value in (("seed", seed), ("frame", frame)):
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 0:
            raise SceneError(f"{who}: {name}: got {value!r}; allowed: a whole number >= 0")
    return np.random.default_rng([seed, frame])


@dataclass(frozen=True)
class Sensor:
    """What a camera makes of radiance: exposure, vignetting, colour filters, noise, response and quantisation.

    Parameters
    ----------
    exposure : seconds, > 0.
    sensitivity : electrons that a pixel collects each second of radiance 1, > 0; the lens included.
    full_well : electrons that a pixel can hold, > 0: the brightest that is told apart.
    read_noise : standard deviation of reading, electrons, >= 0.
    dark_current : electrons each second without light, >= 0.
    shot_noise : whether photons arrive at random (Poisson); False for their mean.
    bayer : the colour filters of the top-left 2 x 2 pixels, "RGGB", "BGGR", "GRBG" or "GBRG", row by row; None: three
        sensors, one for each colour.
    vignetting : coefficients a1, a2, ... of ``1 + a1 r² + a2 r⁴ + ...``, at least 0; r is 0 in the middle of the picture
        and 1 in its corners.
    response : "linear"; "srgb"; or a number g > 0, for ``x ** (1 / g)``.
    black : share of the range at which no light stands, 0 to less than 1: leaves room for noise below zero.
    bits : of the numbers, 1 to 16.

    Examples
    --------
    >>> import numpy as np
    >>> Sensor(bits=8, read_noise=0, shot_noise=False, full_well=1000).capture(np.full((2, 2, 3), 0.05))[0, 0]
    array([128, 128, 128], dtype=uint8)
    """

    exposure: float = 0.01
    sensitivity: float = 1e6
    full_well: float = 10_000.0
    read_noise: float = 3.0
    dark_current: float = 0.0
    shot_noise: bool = True
    bayer: str | None = None
    vignetting: Sequence[float] = ()
    response: str | float = "linear"
    black: float = 0.0
    bits: int = 12

    def __post_init__(self) -> None:
        for name in ("exposure", "sensitivity", "full_well"):
            self._number(name, "a finite number > 0", lambda x: 0 < x < math.inf)
        for name in ("read_noise", "dark_current"):
            self._number(name, "a finite number >= 0", lambda x: 0 <= x < math.inf)
        self._number("black", "a number from 0 to less than 1", lambda x: 0 <= x < 1)
        self._number("bits", "a whole number from 1 to 16", lambda x: x in range(1, 17))
        if self.bayer is not None and self.bayer not in PATTERNS:
            raise SceneError(f"Sensor.bayer: {unknown('pattern', str(self.bayer), PATTERNS)}")
        if isinstance(self.response, str) and self.response not in RESPONSES:
            raise SceneError(f"Sensor.response: {unknown('response', self.response, RESPONSES)}; or a number > 0")
        if not isinstance(self.response, str):
            self._number("response", "'linear', 'srgb', or a number > 0", lambda x: 0 < x < math.inf)
        coefficients = np.asarray(self.vignetting, np.float64)
        if coefficients.ndim != 1 or not np.isfinite(coefficients).all():
            raise SceneError(f"Sensor.vignetting: got {self.vignetting!r}; allowed: a row of finite numbers")

    def _number(self, name: str, allowed: str, good: Any) -> None:
        value = getattr(self, name)
        if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not good(value):
            raise SceneError(f"Sensor.{name}: got {value!r}; allowed: {allowed}")

    def falloff(self, height: int, width: int) -> np.ndarray:
        """What vignetting leaves of the light of each pixel: (height, width) float64, at least 0."""
        y = (np.arange(height) + 0.5 - height / 2)[:, None]
        x = np.arange(width) + 0.5 - width / 2
        r2 = (x**2 + y**2) / ((width / 2) ** 2 + (height / 2) ** 2)
        powers = (a * r2 ** (k + 1) for k, a in enumerate(self.vignetting))
        return np.maximum(sum(powers, np.ones((height, width))), 0.0)

    def electrons(self, radiance: Any) -> np.ndarray:
        """Electrons that pixels collect on average, (h, w, 3) or (h, w) float64, before any noise; see `capture`."""
        light = np.asarray(getattr(radiance, "pixels", radiance), np.float64)
        if light.ndim != 3 or light.shape[2] < 3:
            raise SceneError(f"Sensor: got radiance of shape {light.shape}; allowed: an Image, or an array (h, w, 3)")
        if not np.isfinite(light[..., :3]).all():
            raise SceneError("Sensor: got radiance that is not finite; allowed: finite numbers")
        height, width = light.shape[:2]
        light = np.maximum(light[..., :3], 0.0) * self.falloff(height, width)[..., None]
        if self.bayer is not None:
            filters = np.tile(PATTERNS[self.bayer], (height // 2 + 1, width // 2 + 1))[:height, :width]
            light = np.take_along_axis(light, filters[..., None], axis=2)[..., 0]
        return self.exposure * (self.sensitivity * light + self.dark_current)

    def capture(self, radiance: Any, seed: int = 0, frame: int = 0) -> np.ndarray:
        """What the camera delivers of a picture.

        Parameters
        ----------
        radiance : an `Image`, or (h, w, 3) floats: linear, W/(m² sr). Less than 0 counts as 0.
        seed, frame : whole numbers >= 0. The noise is a function of both, so that every frame can be made again by itself.

        Returns
        -------
        (h, w, 3), or with `bayer` (h, w): uint8 up to 8 bits, else uint16.

        Raises
        ------
        SceneError
            If `radiance` has another shape or is not finite.
        """
        mean = self.electrons(radiance)
        random = noise_source("Sensor", seed, frame)
        charge = random.poisson(np.minimum(mean, 4.0 * self.full_well)) if self.shot_noise else mean
        charge = np.minimum(charge, self.full_well) + random.normal(0.0, 1.0, mean.shape) * self.read_noise
        share = np.clip(self.black + (1.0 - self.black) * charge / self.full_well, 0.0, 1.0)
        signal = np.floor((2**self.bits - 1) * self._respond(share) + 0.5)
        return signal.astype(np.uint8 if self.bits <= 8 else np.uint16)

    def _respond(self, share: np.ndarray) -> np.ndarray:
        if self.response == "linear":
            return share
        if self.response == "srgb":
            return srgb_encode(share)
        return share ** (1.0 / float(self.response))
