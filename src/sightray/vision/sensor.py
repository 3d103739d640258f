"""From radiance to what a camera delivers: a sensor that counts photons, with the errors that real ones have.

The model is that of the EMVA standard 1288 (release 4.0, 2021): photons arrive at random, the sensor collects electrons
until its wells are full, reading adds noise, and an amplifier and a quantiser make whole numbers of them:

    mean electrons = exposure (sensitivity * vignetting * radiance + dark_current),
    electrons      = Poisson(mean), at most full_well, + Normal(0, read_noise),
    number         = round((2^bits - 1) response(black + (1 - black) electrons / full_well)), cut to its range.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sightray.errors import SceneError, unknown
from sightray.fields import flag, integer, number, other
from sightray.images.transfer import srgb_decode, srgb_encode
from sightray.registry import Member

PATTERNS = {"RGGB": ((0, 1), (1, 2)), "BGGR": ((2, 1), (1, 0)), "GRBG": ((1, 0), (2, 1)), "GBRG": ((1, 2), (0, 1))}
RESPONSES = ("linear", "srgb")


def noise_source(who: str, seed: Any, frame: Any) -> np.random.Generator:
    """Random numbers that are a function of two whole numbers >= 0, or a `SceneError`."""
    for name, value in (("seed", seed), ("frame", frame)):
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 0:
            raise SceneError(f"{who}: {name}: got {value!r}; allowed: a whole number >= 0")
    return np.random.default_rng([seed, frame])


def _pattern(value: Any) -> str | None:
    if value is not None and (not isinstance(value, str) or value not in PATTERNS):
        raise SceneError(f"{unknown('pattern', str(value), PATTERNS)}; or None")
    return value


def _response(value: Any) -> str | float:
    if isinstance(value, str):
        if value not in RESPONSES:
            raise SceneError(f"{unknown('response', value, RESPONSES)}; or a number > 0")
        return value
    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not 0 < value < math.inf:
        raise SceneError(f"got {value!r}; allowed: 'linear', 'srgb', or a number > 0")
    return float(value)


def _coefficients(value: Any) -> tuple[float, ...]:
    try:
        numbers = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        numbers = np.array(math.nan)
    if numbers.ndim != 1 or not np.isfinite(numbers).all():
        raise SceneError(f"got {value!r}; allowed: a row of finite numbers")
    return tuple(numbers.tolist())


class Sensor(Member, family="vision.sensor"):
    """What a camera makes of radiance: exposure, vignetting, colour filters, noise, response and quantisation.

    Examples
    --------
    >>> import numpy as np
    >>> Sensor(bits=8, read_noise=0, shot_noise=False, full_well=1000).capture(np.full((2, 2, 3), 0.05))[0, 0]
    array([128, 128, 128], dtype=uint8)
    """

    exposure: float = number("how long light is collected", default=0.01, above=0, unit="s")
    sensitivity: float = number(
        "electrons that a pixel collects each second of radiance 1, the lens included", default=1e6, above=0)  # fmt: skip
    full_well: float = number("electrons that a pixel can hold: the brightest that is told apart", default=1e4, above=0)
    read_noise: float = number("standard deviation of reading, electrons", default=3.0, at_least=0)
    dark_current: float = number("electrons each second without light", default=0.0, at_least=0)
    shot_noise: bool = flag("whether photons arrive at random (Poisson); else their mean counts", default=True)
    bayer: str | None = other(
        "colour filters of the top-left 2 x 2 pixels, row by row: RGGB, BGGR, GRBG or GBRG; None: three sensors, one for "
        "each colour", _pattern, default=None)  # fmt: skip
    vignetting: Sequence[float] = other(
        "coefficients a1, a2, ... of 1 + a1 r² + a2 r⁴ + ..., at least 0; r is 0 in the middle, 1 in the corners",
        _coefficients, default=(), plain=list)  # fmt: skip
    response: str | float = other("'linear'; 'srgb'; or a number g, for x ** (1 / g)", _response, default="linear")
    black: float = number("share of the range at which no light stands: room for noise below zero", default=0.0,
                          at_least=0, below=1)  # fmt: skip
    bits: int = integer("of the numbers", default=12, at_least=1, at_most=16)

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
        light = light[..., :3]
        if self.bayer is not None:
            filters = np.tile(PATTERNS[self.bayer], (height // 2 + 1, width // 2 + 1))[:height, :width]
            light = np.take_along_axis(light, filters[..., None], axis=2)[..., 0]
        return self.collected(light)

    def collected(self, light: np.ndarray) -> np.ndarray:
        """The same of radiance behind the filters, (h, w) or (h, w, n): one number for each pixel of each channel."""
        falloff = self.falloff(*light.shape[:2]).reshape(light.shape[:2] + (1,) * (light.ndim - 2))
        return self.exposure * (self.sensitivity * np.maximum(light, 0.0) * falloff + self.dark_current)

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
        return self.numbers(self.electrons(radiance), noise_source("Sensor", seed, frame))

    def numbers(self, mean: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """The numbers read from pixels that collect so many electrons on average, any shape: see `capture`."""
        charge = random.poisson(np.minimum(mean, 4.0 * self.full_well)) if self.shot_noise else mean
        charge = np.minimum(charge, self.full_well) + random.normal(0.0, 1.0, mean.shape) * self.read_noise
        share = np.clip(self.black + (1.0 - self.black) * charge / self.full_well, 0.0, 1.0)
        signal = np.floor((2**self.bits - 1) * self._respond(share) + 0.5)
        return signal.astype(np.uint8 if self.bits <= 8 else np.uint16)

    def charge(self, numbers: np.ndarray) -> np.ndarray:
        """Electrons that numbers stand for, float64: the way back, but for what was cut off and rounded."""
        signal = np.asarray(numbers, np.float64) / (2**self.bits - 1)
        if self.response == "srgb":
            signal = srgb_decode(signal)
        elif self.response != "linear":
            signal = signal ** float(self.response)
        return self.full_well * (signal - self.black) / (1.0 - self.black)

    def full(self, numbers: np.ndarray) -> np.ndarray:
        """Whether numbers are the greatest there is, so that nobody knows how much light there was: bool."""
        return np.asarray(numbers) >= 2**self.bits - 1

    def _respond(self, share: np.ndarray) -> np.ndarray:
        if self.response == "linear":
            return share
        if self.response == "srgb":
            return srgb_encode(share)
        return share ** (1.0 / float(self.response))


def sensor(doc: str, **values: Any) -> Any:
    """A field that holds a `Sensor`: `values` are those of its default; a mapping in its place changes some of them."""
    default = Sensor(**values)

    def check(value: Any) -> Sensor:
        if isinstance(value, Mapping) and all(isinstance(name, str) for name in value):
            return default.replace(**value)
        if not isinstance(value, Sensor):
            raise SceneError(f"got {value!r}; allowed: a Sensor, or a mapping of fields of one")
        return value

    return other(doc, check, default=default, plain=_stated)


def _stated(value: Sensor) -> dict[str, Any]:
    return {name: field.plain(getattr(value, name)) for name, field in value.given.items()}
