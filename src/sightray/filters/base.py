"""The contract of pixel filters.

The colour of a pixel is the integral of light over the picture times a filter that stands at the pixel's centre. All
filters here are products of one function of x and the same function of y. `filters.table` turns that function into
sample positions, so that kernels need nothing else of a filter.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.fields import number
from sightray.registry import Member

MAX_RADIUS = 16.0


def radius_field(default: float) -> Any:
    """The field `radius` with a member's own default."""
    return number("half-width: the filter is zero beyond", default=default, above=0, at_most=MAX_RADIUS, unit="pixels")


class Filter(Member, family="filters"):
    """Base of all filters: an even function of one coordinate, zero beyond `radius`, not normalised."""

    radius: float = radius_field(1.0)

    def weight(self, x: Any) -> np.ndarray:
        """Value at offsets `x` (any shape, float, pixels) from the pixel's centre: float64, 1 at most."""
        x = np.abs(np.asarray(x, np.float64))
        return np.where(x <= self.radius, self.profile(np.minimum(x, self.radius)), 0.0)

    def profile(self, x: np.ndarray) -> np.ndarray:
        """The filter for 0 <= x <= radius."""
        raise NotImplementedError
