"""One texture times another."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray._jit import implements
from sightray.mathlib.table import Table, table_at
from sightray.mathlib.vec import Vec3
from sightray.textures.base import Texture, Where, mean_brightness, texture_spectrum, texture_value, textured


class Multiply(Texture):
    """The product of two colours or textures: a picture tinted, or scaled by a number."""

    a: Any = textured("one factor")
    b: Any = textured("the other", default=1.0)

    def brightness(self) -> float:
        return mean_brightness([self.a]) * mean_brightness([self.b])

    def brightness_over(self, corners: np.ndarray) -> np.ndarray:
        a, b = (f.brightness_over(corners) if isinstance(f, Texture) else sum(f) / len(f) for f in (self.a, self.b))
        return np.asarray(a * b, np.float64) + np.zeros(len(corners))


A, B = Multiply.offsets()


@implements(texture_value, Multiply)
def value_of_product(texture: Table, where: Where) -> Vec3:
    return texture_value(table_at(texture, A), where) * texture_value(table_at(texture, B), where)


@implements(texture_spectrum, Multiply)
def spectrum_of_product(texture: Table, where: Where) -> Vec3:
    return texture_spectrum(table_at(texture, A), where) * texture_spectrum(table_at(texture, B), where)
