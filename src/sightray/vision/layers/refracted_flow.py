"""Flow of what is seen through glass."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.vision.layers.base import Layer
from sightray.vision.path_flow import path_flow
from sightray.vision.paths import REFRACTED


class RefractedFlowLayer(Layer):
    """Optical flow to the picture `next` of what is seen through glass, by the same surfaces there.

    NaN where nothing is seen so, and where no pixel of the other picture shows it by the same way. Whether something
    stands in front of it there is not asked. `vision.path_flow` says how it is solved.
    """

    label, unit, frame, columns, picture, letters = "refracted_flow", "pixels", "pixel", 2, "flow", "XY"

    def needs(self, frame: Any) -> tuple[str, ...]:
        frame.other("next")
        return ()

    def compute(self, frame: Any) -> np.ndarray:
        return path_flow(frame, REFRACTED)
