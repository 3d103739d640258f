"""Linear interpolation seen from the pixel."""

from __future__ import annotations

import numpy as np

from sightray.filters.base import Filter, radius_field


class TentFilter(Filter):
    """Falls in a straight line from 1 to 0 at `radius`: f = 1 - |x|/r (M. S. Bartlett's window, 1950)."""

    radius: float = radius_field(1.0)

    def profile(self, x: np.ndarray) -> np.ndarray:
        return 1.0 - x / self.radius
