"""Occlusion in another picture."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from sightray.vision.layers.base import Layer
from sightray.vision.rolling import clear_sight


class _Occlusion(Layer):
    """What occlusion masks have in common: a ray is cast to the point from the other camera; depths are not compared."""

    picture, columns, letters = "mask", 1, "Y"
    toward: ClassVar[str] = "next"
    flow_layer: ClassVar[str] = "flow"

    def needs(self, frame: Any) -> tuple[str, ...]:
        return (self.flow_layer, f"{self.toward}_position")

    def compute(self, frame: Any) -> np.ndarray:
        points = frame.values[f"{self.toward}_position"].reshape(-1, 3)
        y, x = np.indices((frame.height, frame.width))
        pixels = (frame.values[self.flow_layer] + np.stack([x, y], axis=-1) + 0.5).reshape(-1, 2)
        return hidden_from(frame, self.toward, points, pixels).reshape(frame.height, frame.width)


def hidden_from(frame: Any, name: str, points: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Whether points, (n, 3), that another view has at pixel coordinates within its picture are hidden there: (n,) bool."""
    other = frame.other(name)
    within = other.within(pixels)
    hidden = np.zeros(len(points), bool)
    if other.blurred:
        hidden[within] = ~clear_sight(frame.beside(name), points[within], pixels[within])
    else:
        hidden[within] = ~other.sees(points[within], pixels[within], frame.threads)
    return hidden


class OcclusionLayer(_Occlusion):
    """Whether the point that is seen is hidden in the picture `next`, though within its borders; by casting a ray."""

    label = "occlusion"


class BackwardOcclusionLayer(_Occlusion):
    """Whether the point that is seen is hidden in the picture `previous`, though within its borders; by casting a ray."""

    label, toward, flow_layer = "backward_occlusion", "previous", "backward_flow"
