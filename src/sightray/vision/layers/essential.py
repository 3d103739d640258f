"""Essential matrix."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.vision.epipolar import essential_matrix, marked_pixels, paint_pencil
from sightray.vision.layers.base import Layer
from sightray.vision.pictures import Painting


class EssentialLayer(Layer):
    """Essential matrix from this picture to `next`, (3, 3) metres: y1ᵀ E y0 = 0 for directions in the cameras' frames.

    Only what does not move between the two pictures obeys it.
    """

    label, picture = "essential", "own"

    def needs(self, frame: Any) -> tuple[str, ...]:
        return ("instance",)

    def compute(self, frame: Any) -> np.ndarray:
        return essential_matrix(frame.view, frame.other("next"))

    def painting(self, labels: Any) -> Painting:
        """Lines on which points of the next picture lie: the planes Eᵀ y1."""
        other = labels.views["next"]
        _, ways = other.camera.rays(marked_pixels(other))
        return paint_pencil(labels, self, ways @ other.world_from_camera[:3, :3] @ labels[self.label])
