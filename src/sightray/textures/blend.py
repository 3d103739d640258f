"""What textures share that lie between two colours."""

from __future__ import annotations

from typing import Any

from sightray._jit import implements, method
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, table_at
from sightray.mathlib.vec import Vec3
from sightray.textures.base import Texture, Where, texture_spectrum, texture_value, textured


class _Blend(Texture):
    """Colours or textures in shares that a pattern decides; members state `share`."""

    dark: Any = textured("where the pattern is 0", default=0.0)
    light: Any = textured("where the pattern is 1", default=1.0)


DARK, LIGHT = _Blend.offsets()


@method(2)
def share(texture: Table, where: Where) -> f64:
    """The pattern at a place: how much of `light` shows, 0 to 1."""
    raise NotImplementedError


@implements(texture_value, _Blend)
def blended_value(texture: Table, where: Where) -> Vec3:
    s = share(texture, where)
    dark, light = texture_value(table_at(texture, DARK), where), texture_value(table_at(texture, LIGHT), where)
    return dark * (1.0 - s) + light * s


@implements(texture_spectrum, _Blend)
def blended_spectrum(texture: Table, where: Where) -> Vec3:
    s = share(texture, where)
    dark, light = texture_spectrum(table_at(texture, DARK), where), texture_spectrum(table_at(texture, LIGHT), where)
    return dark * (1.0 - s) + light * s
