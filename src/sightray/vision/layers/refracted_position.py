"""Position of what is seen through glass."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.vision.layers.base import Layer
from sightray.vision.layers.flow import pixel_centres
from sightray.vision.paths import REFRACTED, path_ends


class RefractedPositionLayer(Layer):
    """Point in the world that is seen through glass: where the ray ends that is let through by the first surface.

    NaN elsewhere, and where the path meets nothing; `vision.paths` says how it goes on.
    """

    label, unit, frame, columns, picture, letters = "refracted_position", "m", "world", 3, "box", "XYZ"

    def compute(self, frame: Any) -> np.ndarray:
        ends = path_ends(frame, pixel_centres(frame.width, frame.height).reshape(-1, 2), REFRACTED)
        there = np.where((ends.way != 0)[:, None], ends.position, np.nan)
        return there.reshape(frame.height, frame.width, 3)
