"""What leaves the picture."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.vision.layers.base import Layer
from sightray.vision.layers.flow import pixel_centres


class OutOfViewLayer(Layer):
    """Whether the point that is seen lies outside the borders of the picture `next`, behind its camera, or is gone."""

    label, picture, letters = "out_of_view", "mask", "Y"

    def needs(self, frame: Any) -> tuple[str, ...]:
        return ("flow",)

    def compute(self, frame: Any) -> np.ndarray:
        return ~frame.other("next").within(frame.values["flow"] + pixel_centres(frame.width, frame.height))
