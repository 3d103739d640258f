"""Measured depths as pictures for people: how deep, and how wrong."""

from __future__ import annotations

import numpy as np

from sightray.images import Image
from sightray.images.transfer import srgb_decode
from sightray.vision.legend import Bar, strip
from sightray.vision.pictures import NOTHING, heat_colors

NEARER, RIGHT, FARTHER = np.array([0.16, 0.42, 0.85]), np.array([0.93, 0.93, 0.93]), np.array([0.85, 0.2, 0.13])  # sRGB
USUAL = 95  # per cent of the errors that lie within the colour scale


def depth_picture(depth: np.ndarray, title: str) -> Image:
    """Depths in colours, near is light, with a legend; what was not measured is dark.

    Parameters
    ----------
    depth : (h, w) metres, 0 for nothing. Colours reach from the first to the 99th percentile.
    title : words for the legend.
    """
    seen = depth > 0
    low, high = np.percentile(depth[seen], (1, 99)) if seen.any() else (0.0, 1.0)
    part = np.clip((depth - low) / max(high - low, 1e-300), 0.0, 1.0)
    pixels = np.where(seen[..., None], heat_colors(1.0 - part), NOTHING)
    return _with_legend(pixels, Bar(low, high, lambda v: heat_colors(1.0 - v), f"{title} [m]"))


def error_picture(depth: np.ndarray, exact: np.ndarray, title: str) -> Image:
    """Measured less exact depths: blue is too near, red too far, dark not measured.

    Parameters
    ----------
    depth, exact : (h, w) metres; 0 in the first, and what is not finite in the second, for nothing. The scale ends where
        95 % of all errors lie within it.
    title : words for the legend.
    """
    there = (depth > 0) & np.isfinite(exact)
    error = np.where(there, depth, 0.0) - np.where(there, exact, 0.0)
    most = max(float(np.percentile(np.abs(error[there]), USUAL)) if there.any() else 1.0, 1e-9)
    pixels = np.where(there[..., None], error_colors(0.5 + 0.5 * np.clip(error / most, -1.0, 1.0)), NOTHING)
    return _with_legend(pixels, Bar(-1000 * most, 1000 * most, error_colors, f"{title}: measured less exact [mm]"))


def error_colors(value: np.ndarray) -> np.ndarray:
    """From blue (0) over white (0.5) to red (1), as sRGB."""
    side = (2.0 * np.asarray(value, np.float64) - 1.0)[..., None]
    return RIGHT + np.abs(side) * (np.where(side < 0, NEARER, FARTHER) - RIGHT)


def _with_legend(pixels: np.ndarray, legend: Bar) -> Image:
    whole = np.concatenate([np.clip(pixels, 0.0, 1.0), strip(legend, pixels.shape[1])])
    return Image(srgb_decode(whole).astype(np.float32))
