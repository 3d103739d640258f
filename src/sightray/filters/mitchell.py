"""The compromise between blur and ringing."""

from __future__ import annotations

import numpy as np

from sightray.filters.base import Filter, radius_field

B = C = 1 / 3  # chosen by nine viewers, in the paper


class MitchellFilter(Filter):
    """A cubic spline with small negative lobes, which keep edges crisp; B = C = 1/3.

    In x = 2 |offset| / radius, and divided by 6 and by its value at 0,

        f = (12 - 9B - 6C) x³ + (-18 + 12B + 6C) x² + (6 - 2B)             for x < 1
        f = (-B - 6C) x³ + (6B + 30C) x² + (-12B - 48C) x + (8B + 24C)     for 1 <= x < 2

    Reference: D. Mitchell, A. Netravali, "Reconstruction filters in computer graphics", SIGGRAPH 1988.
    """

    radius: float = radius_field(2.0)

    def profile(self, x: np.ndarray) -> np.ndarray:
        x = 2.0 * x / self.radius
        inner = np.polyval([12 - 9 * B - 6 * C, -18 + 12 * B + 6 * C, 0, 6 - 2 * B], x)
        outer = np.polyval([-B - 6 * C, 6 * B + 30 * C, -12 * B - 48 * C, 8 * B + 24 * C], x)
        return np.where(x < 1, inner, outer) / (6 - 2 * B)
