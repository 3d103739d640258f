"""Attached shadow."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.vision.layers.base import Layer


class AttachedShadowLayer(Layer):
    """Share of each light, (h, w, n), that is behind the surface itself: 1 where it is turned away from the light.

    Decided by the geometric normal on the side that is seen. NaN for nothing.
    """

    label, picture = "attached_shadow", "shares"

    def needs(self, frame: Any) -> tuple[str, ...]:
        return ("light_shares",)

    def compute(self, frame: Any) -> np.ndarray:
        shares = frame.values["light_shares"]
        return 1.0 - shares[..., 1::2]
