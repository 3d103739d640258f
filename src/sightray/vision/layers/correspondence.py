"""Dense correspondences."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.vision.layers.base import Layer
from sightray.vision.layers.flow import pixel_centres


class CorrespondenceLayer(Layer):
    """Where the picture `next` shows the same point, in its pixel coordinates; NaN where it does not."""

    label, unit, frame, columns, letters = "correspondence", "pixels", "pixel", 2, "XY"
    picture = "place"

    def needs(self, frame: Any) -> tuple[str, ...]:
        return ("flow", "occlusion", "out_of_view")

    def compute(self, frame: Any) -> np.ndarray:
        there = frame.values["flow"] + pixel_centres(frame.width, frame.height)
        lost = frame.values["occlusion"] | frame.values["out_of_view"]
        return np.where(lost[..., None], np.nan, there)
