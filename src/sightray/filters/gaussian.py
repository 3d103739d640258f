"""The bell curve."""

from __future__ import annotations

import numpy as np

from sightray.fields import number
from sightray.filters.base import Filter, radius_field


class GaussianFilter(Filter):
    """A bell of standard deviation `sigma`, lowered so that it ends at zero.

        f = (g(x) - g(r)) / (1 - g(r)),  g(x) = exp(-x² / (2 sigma²))

    Smooth and free of ringing, a little soft (M. Pharr, W. Jakob, G. Humphreys, Physically Based Rendering, 4th ed.
    2023, section 8.8).
    """

    radius: float = radius_field(1.5)
    sigma: float = number("standard deviation of the bell before it is cut", default=0.5, above=0, unit="pixels")

    def profile(self, x: np.ndarray) -> np.ndarray:
        # expm1 keeps the shape where sigma is much larger than the radius.
        scale = -0.5 / self.sigma**2
        end = np.expm1(scale * self.radius**2)
        return (np.expm1(scale * x**2) - end) / -end
