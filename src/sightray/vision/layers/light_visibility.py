"""Light visibility."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.vision.layers.base import Layer


class LightVisibilityLayer(Layer):
    """Share of each light that the point sees, (h, w, n) from 0 to 1, in the order of ``scene.lights``.

    With `attached_shadow` and `cast_shadow` it sums to 1. Where a light does not shine (outside a spot's cone) only geometry
    counts. NaN for nothing.
    """

    label, picture = "light_visibility", "shares"

    def needs(self, frame: Any) -> tuple[str, ...]:
        return ("light_shares",)

    def compute(self, frame: Any) -> np.ndarray:
        shares = frame.values["light_shares"]
        return shares[..., 0::2]
