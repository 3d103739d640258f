"""`Film`: sums of weighted samples for every pixel."""

from __future__ import annotations

import numpy as np

from sightray._jit import kernel
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, aligned, f64_at, f64_put, vec3_at, vec3_put
from sightray.mathlib.vec import Vec3

SUM, WEIGHT, SQUARES, COUNT = 0, 4, 5, 6
PIXEL_WORDS = 7


class Film:
    """Accumulates samples. ``pixels`` (height, width, 7) float64: sum (4), weight, squared luminance, count."""

    def __init__(self, width: int, height: int):
        self.width, self.height = width, height
        self.pixels = aligned((height, width, PIXEL_WORDS), np.float64)
        self.table = Table(self.pixels)

    def image(self) -> np.ndarray:
        """The picture so far, (height, width, 3) float32; pixels without samples are black."""
        weight = self.pixels[..., WEIGHT : WEIGHT + 1]
        with np.errstate(divide="ignore", invalid="ignore"):
            mean = self.pixels[..., :3] / weight
        return np.where(weight > 0, mean, 0.0).astype(np.float32)

    def counts(self) -> np.ndarray:
        """Samples per pixel, (height, width) int64."""
        return self.pixels[..., COUNT].astype(np.int64)

    def standard_error(self) -> np.ndarray:
        """Standard error of each pixel's luminance, (height, width) float64; infinite below two samples."""
        n = self.pixels[..., COUNT]
        with np.errstate(divide="ignore", invalid="ignore"):
            mean = self.pixels[..., :3] @ LUMINANCE / n
            variance = np.maximum(self.pixels[..., SQUARES] / n - mean * mean, 0.0) / (n - 1)
        return np.where(n > 1, np.sqrt(variance), np.inf)


LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
_R, _G, _B = LUMINANCE.tolist()


@kernel
def add_sample(film: Table, pixel: i64, color: Vec3, weight: f64) -> None:
    """Add one weighted sample to a pixel."""
    word = pixel * PIXEL_WORDS
    y = _R * color.x + _G * color.y + _B * color.z
    vec3_put(film, word + SUM, vec3_at(film, word + SUM) + color * weight)
    f64_put(film, word + WEIGHT, f64_at(film, word + WEIGHT) + weight)
    f64_put(film, word + SQUARES, f64_at(film, word + SQUARES) + y * y)
    f64_put(film, word + COUNT, f64_at(film, word + COUNT) + 1.0)
