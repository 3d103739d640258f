"""Residual."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.vision.layers.base import Layer


class ResidualLayer(Layer):
    """All light of the picture that is no diffuse reflection of the lights: ``color - albedo * irradiance / pi``.

    Highlights, mirrored and refracted light, emission, ambient light, and the background.
    """

    label, unit, columns, picture, letters = "residual", "W/(m² sr)", 3, "color", "RGB"

    def needs(self, frame: Any) -> tuple[str, ...]:
        return ("color", "albedo", "irradiance")

    def compute(self, frame: Any) -> np.ndarray:
        color, albedo, irradiance = (frame.values[name] for name in self.needs(frame))
        return color - np.nan_to_num(albedo * irradiance) / np.pi
