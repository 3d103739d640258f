"""The same colour everywhere."""

from __future__ import annotations

from sightray._jit import implements
from sightray.fields import Color, color
from sightray.mathlib.table import Table, vec3_at
from sightray.mathlib.vec import Vec3
from sightray.textures.base import Texture, Where, texture_value


class Constant(Texture):
    """The same colour everywhere."""

    color: Color = color("linear Rec. 709 colour")

    def brightness(self) -> float:
        return sum(self.color) / 3


(COLOR,) = Constant.offsets()


@implements(texture_value, Constant)
def value_of_constant(texture: Table, where: Where) -> Vec3:
    return vec3_at(texture, COLOR)
