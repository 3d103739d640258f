"""One texture times another."""

from __future__ import annotations

from typing import Any

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


A, B = Multiply.offsets()


@implements(texture_value, Multiply)
def value_of_product(texture: Table, where: Where) -> Vec3:
    return texture_value(table_at(texture, A), where) * texture_value(table_at(texture, B), where)


@implements(texture_spectrum, Multiply)
def spectrum_of_product(texture: Table, where: Where) -> Vec3:
    return texture_spectrum(table_at(texture, A), where) * texture_spectrum(table_at(texture, B), where)
