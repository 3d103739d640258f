"""`Film`: sums of weighted samples for every pixel."""

from __future__ import annotations

import math

import numpy as np

from sightray._jit import kernel
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, advance, aligned, f64_at, f64_put, vec3_at, vec3_put
from sightray.mathlib.vec import Vec3, max4

SUM, WEIGHT, SQUARES, COUNT, INVALID = 0, 4, 5, 6, 7
PIXEL_WORDS = 8
NEAR = 4  # pixels to each side over which is averaged how evenly samples were spread


class Film:
    """Accumulates samples.

    ``pixels`` (height, width, 8) float64: sum (4), weight, squared luminance, count, and how many samples were thrown
    away because they were no finite numbers. ``marked`` (height, width, 2) float64: luminance and count at the mark.
    """

    def __init__(self, width: int, height: int):
        self.width, self.height = width, height
        self.pixels = aligned((height, width, PIXEL_WORDS), np.float64)
        self.marked = np.zeros((height, width, 2))
        self.table = Table(self.pixels)

    def image(self) -> np.ndarray:
        """The picture so far, (height, width, 3) float32; pixels without samples are black."""
        weight = self.pixels[..., WEIGHT : WEIGHT + 1].copy()  # threads may be adding samples meanwhile
        with np.errstate(divide="ignore", invalid="ignore"):
            mean = self.pixels[..., :3] / weight
        return np.where(weight > 0, mean, 0.0).astype(np.float32)

    def luminance(self) -> np.ndarray:
        """Luminance of the picture so far, (height, width) float64; 0 without samples."""
        weight = self.pixels[..., WEIGHT]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(weight > 0, self.pixels[..., :3] @ LUMINANCE / weight, 0.0)

    def counts(self) -> np.ndarray:
        """Samples in each pixel, (height, width) int64."""
        return self.pixels[..., COUNT].astype(np.int64)

    def taken(self) -> np.ndarray:
        """Samples that were taken of each pixel, those thrown away included: (height, width) float64."""
        return self.pixels[..., COUNT] + self.pixels[..., INVALID]

    def taken_in(self, x0: int, y0: int, x1: int, y1: int) -> int:
        """Samples that were taken in a rectangle of pixels."""
        return int(self.pixels[y0:y1, x0:x1, COUNT:].sum())

    def invalid(self) -> int:
        """How many samples were thrown away."""
        return int(self.pixels[..., INVALID].sum())

    def variance(self) -> np.ndarray:
        """Variance of the luminance of one sample, as found in each pixel, (height, width); infinite below two samples.

        Filters with negative lobes make it approximate.
        """
        n, mean = self.pixels[..., COUNT], self.luminance()
        with np.errstate(divide="ignore", invalid="ignore"):
            variance = np.maximum(self.pixels[..., SQUARES] / n - mean * mean, 0.0) * (n / (n - 1))
        return np.where(n > 1, variance, np.inf)

    def mark(self) -> None:
        """Remember luminance and number of samples of each pixel as they are now, to see later how they moved."""
        self.marked[..., 0] = self.luminance()
        self.marked[..., 1] = self.pixels[..., COUNT]

    def standard_error(self) -> np.ndarray:
        """Standard error of each pixel's luminance, (height, width) float64; infinite below two samples.

        Of n independent samples of variance v it would be root v/n. Samples that are spread evenly err less, which
        shows in how far the pixels moved since the mark: independent samples move them by v (1/n_marked - 1/n) on the
        average of the square. The ratio of what happened to that, averaged over 9 by 9 pixels, scales the estimate.
        """
        n = np.maximum(self.pixels[..., COUNT], 1.0)
        variance = self.variance()
        moved = (self.pixels[..., COUNT] > self.marked[..., 1]) & (self.marked[..., 1] > 1) & np.isfinite(variance)
        if not moved.any():
            return np.sqrt(variance / n)
        then = np.where(moved, self.marked[..., 1], 1.0)
        expected = np.where(moved, variance, 0.0) * np.where(moved, 1 / then - 1 / n, 0.0)
        happened = np.where(moved, (self.luminance() - self.marked[..., 0]) ** 2, 0.0)
        expected, happened = averaged(expected, NEAR), averaged(happened, NEAR)
        ratio = np.divide(happened, expected, out=np.ones_like(expected), where=expected > 0)
        return np.sqrt(ratio * variance / n)


def averaged(values: np.ndarray, reach: int) -> np.ndarray:
    """Mean over a square of 2 reach + 1 pixels around each pixel, or what of it lies in the picture: (h, w)."""
    for axis in (0, 1):
        n = values.shape[axis]
        sums = np.concatenate([np.zeros_like(values.take([0], axis)), np.cumsum(values, axis)], axis)
        first, last = np.maximum(np.arange(n) - reach, 0), np.minimum(np.arange(n) + reach + 1, n)
        lengths = (last - first).reshape((-1, 1) if axis == 0 else (1, -1))
        values = (sums.take(last, axis) - sums.take(first, axis)) / lengths
    return np.maximum(values, 0.0)


LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
_R, _G, _B = LUMINANCE.tolist()


@kernel
def samples_taken(film: Table, pixel: i64) -> i64:
    """How many samples a pixel has taken: the number of its next one."""
    word = pixel * PIXEL_WORDS
    return int(f64_at(film, word + COUNT) + f64_at(film, word + INVALID))


@kernel
def brightness_so_far(film: Table, pixel: i64) -> f64:
    """Brightest channel of the mean of a pixel's samples; 0 where there is none."""
    row = advance(film, pixel * PIXEL_WORDS)
    weight = f64_at(row, WEIGHT)
    return max(max4(vec3_at(row, SUM)) / weight, 0.0) if weight > 0.0 else 0.0


@kernel
def add_sample(film: Table, pixel: i64, color: Vec3, weight: f64) -> None:
    """Add one weighted sample to a pixel; what is not finite is only counted."""
    word = pixel * PIXEL_WORDS
    if not math.isfinite(color.x * color.x + color.y * color.y + color.z * color.z):
        f64_put(film, word + INVALID, f64_at(film, word + INVALID) + 1.0)
        return
    y = _R * color.x + _G * color.y + _B * color.z
    vec3_put(film, word + SUM, vec3_at(film, word + SUM) + Vec3(color.x, color.y, color.z) * weight)
    f64_put(film, word + WEIGHT, f64_at(film, word + WEIGHT) + weight)
    f64_put(film, word + SQUARES, f64_at(film, word + SQUARES) + y * y)
    f64_put(film, word + COUNT, f64_at(film, word + COUNT) + 1.0)
