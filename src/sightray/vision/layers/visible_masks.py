"""Visible masks."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.vision.layers.base import Layer
from sightray.vision.masks import check_room, paint_masks
from sightray.vision.pictures import Painting


class VisibleMasksLayer(Layer):
    """What is seen of each object, (n, h, w) bool, in the order of ``labels.objects``: no two share a pixel."""

    label, picture = "visible_masks", "own"

    def needs(self, frame: Any) -> tuple[str, ...]:
        check_room(frame, self.label, 1)
        return ("instance",)

    def compute(self, frame: Any) -> np.ndarray:
        numbers = np.array([thing.index for thing in frame.objects])
        return frame.values["instance"] == numbers[:, None, None]

    def painting(self, labels: Any) -> Painting:
        """Each object in its colour."""
        return paint_masks(labels, self)
