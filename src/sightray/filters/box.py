"""The pixel as a little square."""

from __future__ import annotations

import numpy as np

from sightray.filters.base import Filter, radius_field


class BoxFilter(Filter):
    """Every place within `radius` counts the same: the mean over the pixel with the default of half a pixel.

    The only one whose pixels do not share light; it blurs little and lets fine patterns alias. Its name sets it apart
    from the shape `Box`.
    """

    radius: float = radius_field(0.5)

    def profile(self, x: np.ndarray) -> np.ndarray:
        return np.ones_like(x)
