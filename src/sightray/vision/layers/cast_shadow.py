"""Cast shadow."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.vision.layers.base import Layer


class CastShadowLayer(Layer):
    """Share of each light, (h, w, n), that is before the surface, but hidden by something: 0 < share < 1 in penumbrae.

    Shadow rays pass nothing, not even glass. NaN for nothing.
    """

    label, picture = "cast_shadow", "shares"

    def needs(self, frame: Any) -> tuple[str, ...]:
        return ("light_shares",)

    def compute(self, frame: Any) -> np.ndarray:
        shares = frame.values["light_shares"]
        return shares[..., 1::2] - shares[..., 0::2]
