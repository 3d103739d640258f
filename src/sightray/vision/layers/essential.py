"""Essential matrix."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.vision.epipolar import essential_matrix
from sightray.vision.layers.base import Layer


class EssentialLayer(Layer):
    """Essential matrix from this picture to `next`, (3, 3) metres: y1ᵀ E y0 = 0 for directions in the cameras' frames.

    Only what does not move between the two pictures obeys it.
    """

    label = "essential"

    def compute(self, frame: Any) -> np.ndarray:
        return essential_matrix(frame.view, frame.other("next"))
