"""The contract of textures: a linear colour for every point of a surface."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from sightray._jit import implements, kernel, method
from sightray.errors import SceneError
from sightray.fields import REQUIRED, Child, ColorField, Packer
from sightray.mathlib.bands import as_reflectance
from sightray.mathlib.eight_paths import gather8v
from sightray.mathlib.eights import I64x8, Vec3x8, gather8i
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, is_null, no_table, words_to
from sightray.mathlib.vec import Vec3
from sightray.registry import Member


class Where(NamedTuple):
    """Where on a surface a texture or material is asked."""

    u: f64  # texture coordinates; v runs upwards
    v: f64
    p: Vec3  # the point in the space of the shape, so that solid textures move with it
    normal: Vec3  # unit, outward, geometric, in the space of the shape; its 4th lane is the width there, see `reach`
    width: f64  # of the ray's footprint where it is longest, in units of u; 0 for a ray without width
    bands: Table  # what the lanes of colours stand for; null for RGB (see mathlib/bands.py)


class Texture(Member, family="textures"):
    """Base of all textures."""

    def as_numbers(self) -> Texture:
        """The same texture for a field that wants plain numbers, not colours: PNG and JPEG files are read as they are.

        Roughness, opacity, height and normal maps are such numbers; the sRGB curve of a picture file is for colours.
        """
        children = {name: value for name, value in self.values().items() if isinstance(value, Texture)}
        numbers = {name: value.as_numbers() for name, value in children.items()}
        return self.replace(**numbers) if any(numbers[name] is not children[name] for name in numbers) else self

    def brightness(self) -> float:
        """About its mean over places and red, green and blue: for choosing among surfaces that glow.

        Unless a member knows better, that of the colours and textures that it is made of.
        """
        stated = [value for name, value in self.values().items() if isinstance(self.given[name], Textured)]
        return mean_brightness([value for value in stated if value is not None])

    def brightness_over(self, corners: np.ndarray) -> np.ndarray:
        """The same over each of n triangles of texture coordinates, (n, 3, 2): (n,) float64, for choosing among them.

        Unless a member knows better it is alike everywhere.
        """
        return np.full(len(corners), self.brightness())


@method(0)
def texture_value(texture: Table, where: Where) -> Vec3:
    """Linear RGB at a place."""
    raise NotImplementedError


@method(1)
def texture_spectrum(texture: Table, where: Where) -> Vec3:
    """Reflectance at a place, at the wavelengths of `where.bands`; by default the colour, up-sampled."""
    raise NotImplementedError


@implements(texture_spectrum, Texture)
def up_sampled(texture: Table, where: Where) -> Vec3:
    return as_reflectance(where.bands, texture_value(texture, where))


@kernel
def value_at(texture: Table, where: Where) -> Vec3:
    """What materials see of a texture: its colour or its spectrum, as the path's lanes ask."""
    if is_null(where.bands):
        return texture_value(texture, where)
    return texture_spectrum(texture, where)


@kernel
def constant8(material: Table, rows: I64x8, word: i64, value: i64) -> Vec3x8:
    """Colours of eight materials whose texture in `word` is a `Constant`, which has its colour in the word `value`.

    `rows`: how many words it is from `material` to each of them.
    """
    first = words_to(material, 0)
    return gather8v(material, (gather8i(material, rows + word) >> 3) + (first + value))


@kernel
def reach(where: Where) -> f64:
    """Width of the ray's footprint where it is longest, in metres of the space of the shape: for solid textures.

    It travels in the 4th lane of the normal, as time does in that of points.
    """
    return where.normal.w


@kernel
def anywhere(u: f64, v: f64, p: Vec3) -> Where:
    """A place asked about by itself, outside of any picture: in RGB, by a ray without width."""
    return Where(u, v, p, Vec3(0.0, 0.0, 1.0), 0.0, no_table())


def mean_brightness(colours: list[Any]) -> float:
    """Mean over textures and linear colours."""
    means = [c.brightness() if isinstance(c, Texture) else sum(c) / len(c) for c in colours]
    return sum(means) / len(means)


class Textured(Child):
    """A colour or a texture; kernels always see a texture."""

    def __init__(
        self, doc: str, default: Any = REQUIRED, *, at_most: float = float("inf"), optional: bool = False,
        packed: bool = True,
    ):  # fmt: skip
        super().__init__(doc, "textures", default, optional=optional, packed=packed)
        self._color = ColorField(doc, at_most=at_most)

    def convert(self, value: Any) -> Any:
        if isinstance(value, Texture) or (value is None and self.optional):
            return value
        if isinstance(value, Member):
            raise SceneError(f"got {value!r}; allowed: {self.allowed()}")
        try:
            return self._color.convert(value)
        except SceneError:
            raise self.wrong(value) from None

    def pack(self, row: Table, word: int, value: Any, packer: Packer) -> None:
        from sightray.textures.constant import Constant

        known = value is None or isinstance(value, Texture)
        super().pack(row, word, value if known else Constant(color=value), packer)

    def plain(self, value: Any) -> Any:
        return value if value is None or isinstance(value, Texture) else self._color.plain(value)

    def allowed(self) -> str:
        return f"{self._color.allowed()}, or a texture" + (", or None" if self.optional else "")


def textured(
    doc: str, default: Any = REQUIRED, *, at_most: float = float("inf"), optional: bool = False, packed: bool = True
) -> Any:  # fmt: skip
    """A linear colour, or a texture that gives one; kernels do not see it if it is not `packed`."""
    return Textured(doc, default, at_most=at_most, optional=optional, packed=packed)
