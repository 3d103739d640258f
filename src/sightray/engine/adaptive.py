"""Adaptive supersampling: more rays where neighbours differ (T. Whitted, CACM 1980; D. Mitchell, SIGGRAPH 1987)."""

from __future__ import annotations

import numpy as np

from sightray.film.film import Film


def where_neighbours_differ(film: Film, threshold: float, extra: int) -> np.ndarray:
    """Additional samples for each pixel, (height, width) int32: `extra` where contrast with a neighbour is high.

    The contrast of two pixels is ``|a - b| / (a + b)`` of their brightest-differing channel (Mitchell's measure), with
    colours clipped to the visible range, so that differences between whites beyond white do not count.
    """
    image = np.clip(film.image().astype(np.float64), 0.0, 1.0)
    differs = np.zeros(image.shape[:2], bool)
    for a, b in ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[1:, :], np.s_[:-1, :])):
        p, q = image[a], image[b]
        contrast = np.abs(p - q) / (p + q + 1e-3)
        over = (contrast > threshold).any(axis=-1)
        differs[a] |= over
        differs[b] |= over
    return np.where(differs, extra, 0).astype(np.int32)
