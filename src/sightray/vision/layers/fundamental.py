"""Fundamental matrix."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.vision.epipolar import fundamental_matrix
from sightray.vision.layers.base import Layer


class FundamentalLayer(Layer):
    """Fundamental matrix from this picture to `next`, (3, 3): x1ᵀ F x0 = 0 for homogeneous pixel coordinates.

    Only what does not move between the two pictures obeys it.
    """

    label = "fundamental"

    def compute(self, frame: Any) -> np.ndarray:
        return fundamental_matrix(frame.view, frame.other("next"))
