"""Smooth interpolation between evenly spaced measurements."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Powers of t (rows) by the six values around an interval (columns), times 24.
_QUINTIC = np.array([
    [0, 0, 24, 0, 0, 0],
    [2, -16, 0, 16, -2, 0],
    [-1, 16, -30, 16, -1, 0],
    [-9, 39, -70, 66, -33, 7],
    [13, -64, 126, -124, 61, -12],
    [-5, 25, -50, 50, -25, 5],
]) / 24  # fmt: skip
# The two values in front of the first one, from the first six, times 209.
_BEFORE = np.array([[884, -1960, 3033, -2648, 1080, -180], [508, -540, 488, -367, 144, -24]]) / 209


def sprague(x: NDArray[np.float64], y: NDArray[np.float64], at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quintic interpolation with continuous second derivatives, which the CIE recommends for spectra.

    Parameters
    ----------
    x : (n,) float, n >= 6, evenly spaced and increasing.
    y : (n,) float.
    at : (m,) float; outside of x the end values are held.

    Returns
    -------
    (m,) float.

    References: T. Sprague, "Explanation of a new formula for interpolation", Journal of the Institute of Actuaries 22,
    1880; CIE 167:2005.
    """
    padded = np.concatenate([_BEFORE @ y[:6], y, (_BEFORE @ y[:-7:-1])[::-1]])
    place = (np.clip(at, x[0], x[-1]) - x[0]) / (x[1] - x[0])
    cell = np.minimum(place.astype(np.int64), len(x) - 2)
    around = padded[cell + np.arange(6)[:, np.newaxis]]
    return np.sum((_QUINTIC @ around) * (place - cell) ** np.arange(6)[:, np.newaxis], axis=0)
