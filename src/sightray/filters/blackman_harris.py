"""The window with the lowest side lobes."""

from __future__ import annotations

import numpy as np

from sightray.filters.base import Filter, radius_field

COSINES = (0.35875, 0.48829, 0.14128, 0.01168)  # weights of cos(k pi x / r): the minimum four-term window


class BlackmanHarrisFilter(Filter):
    """Four cosines whose side lobes in frequency stay 92 dB below the main lobe: a bell that truly ends at `radius`.

    Reference: F. J. Harris, "On the use of windows for harmonic analysis with the discrete Fourier transform", Proc.
    IEEE 66(1), 1978.
    """

    radius: float = radius_field(1.5)

    def profile(self, x: np.ndarray) -> np.ndarray:
        phase = np.pi * x / self.radius
        return np.sum([a * np.cos(k * phase) for k, a in enumerate(COSINES)], axis=0)
