"""Numbers that may vary over a surface, such as roughness: a number, or the red of a texture."""

from __future__ import annotations

from typing import Any

from sightray._jit import kernel
from sightray.fields import REQUIRED
from sightray.mathlib.eights import F64x8, I64x8, gather8d, gather8i, splat8d, vmax8d, vmin8d
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, words_to
from sightray.textures.base import Texture, Textured, Where, texture_value
from sightray.textures.constant import COLOR


class Data(Textured):
    """A texture that holds plain numbers: its PNG or JPEG is read without the sRGB curve."""

    def convert(self, value: Any) -> Any:
        found = super().convert(value)
        return found.as_numbers() if isinstance(found, Texture) else found


def data(doc: str, default: Any = REQUIRED, *, at_most: float = 1.0) -> Any:
    """A number of at least 0, or a texture whose red is that number."""
    return Data(doc, default, at_most=at_most)


@kernel
def number_at(texture: Table, where: Where) -> f64:
    """The number at a place."""
    return texture_value(texture, where).x


@kernel
def share_of(texture: Table, where: Where) -> f64:
    """The number at a place, brought into 0 to 1."""
    return min(1.0, max(0.0, texture_value(texture, where).x))


@kernel
def share8_of(material: Table, rows: I64x8, word: i64) -> F64x8:
    """`share_of` for eight materials whose texture in `word` is constant."""
    number = gather8d(material, (gather8i(material, rows + word) >> 3) + (words_to(material, 0) + COLOR))
    return vmin8d(vmax8d(number, splat8d(0.0)), splat8d(1.0))
