"""Layered depth."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from sightray.vision.layers.base import Layer
from sightray.vision.legend import Bar
from sightray.vision.pictures import NOTHING, Painting, heat_colors, title
from sightray.vision.rolling import crossings


class Surfaces(NamedTuple):
    """Every surface along the rays of a picture. Pixel (x, y) has the rows offsets[k] to offsets[k + 1], k = y w + x.

    Attributes
    ----------
    offsets : (h * w + 1,) int64
    distance : (m,) float64, metres, along the ray, ascending for each pixel
    depth : (m,) float64, metres, z in the camera's frame
    instance, primitive : (m,) int32
    entering : (m,) bool, whether the ray comes from the outer side
    """

    offsets: np.ndarray
    distance: np.ndarray
    depth: np.ndarray
    instance: np.ndarray
    primitive: np.ndarray
    entering: np.ndarray


class SurfacesLayer(Layer):
    """Layered depth: every surface along the ray through the pixel's centre, in order, as if all were transparent.

    Rays go straight on; `Surfaces` says what its arrays are.
    """

    label, unit, picture = "surfaces", "m", "own"

    def needs(self, frame: Any) -> tuple[str, ...]:
        return ("ray_origin", "ray_direction")

    def compute(self, frame: Any) -> Surfaces:
        origins, directions = (frame.values[name].reshape(-1, 3) for name in ("ray_origin", "ray_direction"))
        found = crossings(frame)
        forward = frame.view.camera_from_world[2]
        start, slope = origins @ forward[:3] + forward[3], directions @ forward[:3]
        depth = start[found.ray] + found.t * slope[found.ray]
        return Surfaces(found.offsets, found.t, depth, found.shape, found.primitive, found.entering)

    def painting(self, labels: Any) -> Painting:
        """How many surfaces there are."""
        counts = np.diff(labels[self.label].offsets).reshape(labels.height, labels.width)
        most = max(1, int(counts.max()))
        pixels = np.where((counts > 0)[..., None], heat_colors(counts / most), NOTHING)
        return Painting(pixels, Bar(0, most, heat_colors, f"{title(self)}: how many a ray crosses"))
