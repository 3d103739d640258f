"""A chessboard, on the surface or carved out of space."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import implements, kernel
from sightray.fields import choice, number
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, i64_at, table_at
from sightray.mathlib.vec import Vec3
from sightray.textures.base import Texture, Where, reach, texture_spectrum, texture_value, textured

UV, SOLID = 0, 1
NUDGE = 1e-6  # of a cell: a floor at y = 0 lies on a boundary of solid cells, where rounding would choose its colour
PERIOD = 2.0  # cells
BOX = 0.5  # of a footprint where it is longest: it is narrower across, and samples lie all over a pixel anyway


class Checker(Texture):
    """Two colours or textures in turn: `even` where the sum of the cell's whole coordinates is even, else `odd`.

    ``"uv"`` counts `scale` cells per unit of the texture coordinates u and v, ``"solid"`` per metre of x, y and z in
    the space of the shape, so that the pattern runs through corners as if the shape were carved out of it. Cell
    boundaries lie a millionth of a cell below the whole numbers.

    Where the footprint of the ray covers parts of several cells, both colours show, by their areas in a box half as wide
    as the footprint is long: its mean is known in closed form, because the pattern is a product of one square wave for
    each axis. From a box of two cells on, it is an even mixture.

    References: D. Peachey, "Solid texturing of complex surfaces", SIGGRAPH 1985; A. Norton, A. Rockwood, P. Skolmoski,
    "Clamping: a method of antialiasing textured surfaces by bandwidth limiting in object space", SIGGRAPH 1982.
    """

    even: Any = textured("colour of the cell at the origin", default=0.8)
    odd: Any = textured("colour of its neighbours", default=0.2)
    scale: float = number("cells per unit of u and v, or per metre if solid", default=1.0, above=0)
    mode: str = choice("what is divided into cells", ("uv", "solid"), default="uv")


EVEN, ODD, SCALE, MODE = Checker.offsets()


@kernel
def rise(x: f64) -> f64:
    """The integral of the square wave from 0 to x: up and down again in each two cells."""
    t = x - 2.0 * np.floor(0.5 * x)
    return t if t < 1.0 else 2.0 - t


@kernel
def wave(x: f64, width: f64) -> f64:
    """The mean, over a width about x, of what is 1 in even cells and -1 in odd ones; both in cells."""
    if width >= PERIOD:
        return 0.0
    x -= 2.0 * np.floor(0.5 * x)  # stay in floating point, so that far away no integer overflows
    if not width > NUDGE:
        return 1.0 if x < 1.0 else -1.0
    return (rise(x + 0.5 * width) - rise(x - 0.5 * width)) / width


@kernel
def share_of_even(texture: Table, where: Where) -> f64:
    """How much of the footprint lies in even cells, 0 to 1."""
    s = f64_at(texture, SCALE)
    if i64_at(texture, MODE) == UV:
        width = BOX * where.width * s
        return 0.5 + 0.5 * wave(where.u * s + NUDGE, width) * wave(where.v * s + NUDGE, width)

    # A patch of the surface reaches as far along an axis as the axis lies in the surface.
    n, width = where.normal, BOX * reach(where) * s
    x = wave(where.p.x * s + NUDGE, width * math.sqrt(max(0.0, 1.0 - n.x * n.x)))
    y = wave(where.p.y * s + NUDGE, width * math.sqrt(max(0.0, 1.0 - n.y * n.y)))
    z = wave(where.p.z * s + NUDGE, width * math.sqrt(max(0.0, 1.0 - n.z * n.z)))
    return 0.5 + 0.5 * x * y * z


@implements(texture_value, Checker)
def value_of_checker(texture: Table, where: Where) -> Vec3:
    share = share_of_even(texture, where)
    if share >= 1.0 or share <= 0.0:
        return texture_value(table_at(texture, EVEN if share > 0.5 else ODD), where)
    even, odd = texture_value(table_at(texture, EVEN), where), texture_value(table_at(texture, ODD), where)
    return even * share + odd * (1.0 - share)


@implements(texture_spectrum, Checker)
def spectrum_of_checker(texture: Table, where: Where) -> Vec3:
    share = share_of_even(texture, where)
    if share >= 1.0 or share <= 0.0:
        return texture_spectrum(table_at(texture, EVEN if share > 0.5 else ODD), where)
    even, odd = texture_spectrum(table_at(texture, EVEN), where), texture_spectrum(table_at(texture, ODD), where)
    return even * share + odd * (1.0 - share)
