"""Visible boxes."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.vision.layers.base import Layer
from sightray.vision.masks import boxes_of, paint_boxes
from sightray.vision.pictures import Painting


class VisibleBoxesLayer(Layer):
    """Box around what is seen of each object, (n, 4): left, top, right, bottom.

    Edges of pixels in continuous coordinates, so width is right - left; NaN for objects without a pixel. Rows follow
    ``labels.objects``.
    """

    label, unit, frame, picture = "visible_boxes", "pixels", "pixel", "own"

    def needs(self, frame: Any) -> tuple[str, ...]:
        return ("visible_masks", "instance")

    def compute(self, frame: Any) -> np.ndarray:
        return boxes_of(frame.values["visible_masks"])

    def painting(self, labels: Any) -> Painting:
        """The boxes over what is seen."""
        return paint_boxes(labels, self)
