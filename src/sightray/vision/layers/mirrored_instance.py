"""Instance of what is seen in mirrors."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.vision.layers.base import Layer
from sightray.vision.layers.flow import pixel_centres
from sightray.vision.paths import MIRRORED, path_ends


class MirroredInstanceLayer(Layer):
    """Index in ``scene.objects`` of what is seen in mirrors; -1 elsewhere, and where the path meets nothing."""

    label, dtype, background, picture, letters = "mirrored_instance", np.int32, -1, "categories", "Y"

    def compute(self, frame: Any) -> np.ndarray:
        ends = path_ends(frame, pixel_centres(frame.width, frame.height).reshape(-1, 2), MIRRORED)
        numbers = np.array([*(item.object for item in frame.compiled.items), -1], np.int32)
        return np.where(ends.way != 0, numbers[ends.item], -1).reshape(frame.height, frame.width)
