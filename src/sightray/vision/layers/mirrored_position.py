"""Position of what is seen in mirrors."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.vision.layers.base import Layer
from sightray.vision.layers.flow import pixel_centres
from sightray.vision.paths import MIRRORED, path_ends


class MirroredPositionLayer(Layer):
    """Point in the world that is seen in mirrors: where the ray ends that is thrown back by the first surface:
    a mirror, or glass that mirrors a part.

    NaN elsewhere, and where the path meets nothing; `vision.paths` says how it goes on.
    """

    label, unit, frame, columns, picture, letters = "mirrored_position", "m", "world", 3, "box", "XYZ"

    def compute(self, frame: Any) -> np.ndarray:
        ends = path_ends(frame, pixel_centres(frame.width, frame.height).reshape(-1, 2), MIRRORED)
        there = np.where((ends.way != 0)[:, None], ends.position, np.nan)
        return there.reshape(frame.height, frame.width, 3)
