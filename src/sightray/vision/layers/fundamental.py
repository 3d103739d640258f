"""Fundamental matrix."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.vision.epipolar import fundamental_matrix, marked_pixels, paint_pencil
from sightray.vision.layers.base import Layer
from sightray.vision.pictures import Painting


class FundamentalLayer(Layer):
    """Fundamental matrix from this picture to `next`, (3, 3): x1ᵀ F x0 = 0 for homogeneous pixel coordinates.

    Only what does not move between the two pictures obeys it.
    """

    label, picture = "fundamental", "own"

    def needs(self, frame: Any) -> tuple[str, ...]:
        return ("instance",)

    def compute(self, frame: Any) -> np.ndarray:
        return fundamental_matrix(frame.view, frame.other("next"))

    def painting(self, labels: Any) -> Painting:
        """Lines l = Fᵀ x1 on which points of the next picture lie, by the planes K0ᵀ l through them."""
        pixels = marked_pixels(labels.views["next"])
        lines = np.column_stack([pixels, np.ones(len(pixels))]) @ labels[self.label]
        return paint_pencil(labels, self, lines @ labels.intrinsics)
