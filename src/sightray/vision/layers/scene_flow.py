"""Scene flow."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.vision.layers.base import Layer


class SceneFlowLayer(Layer):
    """Movement in the world, until the picture `next`, of the point that is seen; NaN for nothing and what has gone."""

    label, unit, frame, columns, picture, letters = "scene_flow", "m", "world", 3, "vector", "XYZ"

    def needs(self, frame: Any) -> tuple[str, ...]:
        return ("position", "next_position")

    def compute(self, frame: Any) -> np.ndarray:
        return frame.values["next_position"] - frame.values["position"]
