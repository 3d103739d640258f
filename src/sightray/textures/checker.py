"""A chessboard, on the surface or carved out of space."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray._jit import implements, kernel
from sightray.fields import choice, number
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, i64_at, table_at
from sightray.mathlib.vec import Vec3
from sightray.textures.base import Texture, Where, texture_spectrum, texture_value, textured

UV, SOLID = 0, 1
NUDGE = 1e-6  # of a cell: a floor at y = 0 lies on a boundary of solid cells, where rounding would choose its colour


class Checker(Texture):
    """Two colours or textures in turn: `even` where the sum of the cell's whole coordinates is even, else `odd`.

    ``"uv"`` counts `scale` cells per unit of the texture coordinates u and v, ``"solid"`` per metre of x, y and z in
    the space of the shape, so that the pattern runs through corners as if the shape were carved out of it. Cell
    boundaries lie a millionth of a cell below the whole numbers.

    Reference: D. Peachey, "Solid texturing of complex surfaces", SIGGRAPH 1985.
    """

    even: Any = textured("colour of the cell at the origin", default=0.8)
    odd: Any = textured("colour of its neighbours", default=0.2)
    scale: float = number("cells per unit of u and v, or per metre if solid", default=1.0, above=0)
    mode: str = choice("what is divided into cells", ("uv", "solid"), default="uv")


EVEN, ODD, SCALE, MODE = Checker.offsets()


@kernel
def cell_of(texture: Table, where: Where) -> Table:
    """The texture of the cell that a place is in."""
    s = f64_at(texture, SCALE)
    cells = np.floor(where.u * s + NUDGE) + np.floor(where.v * s + NUDGE)
    if i64_at(texture, MODE) == SOLID:
        cells = np.floor(where.p.x * s + NUDGE) + np.floor(where.p.y * s + NUDGE) + np.floor(where.p.z * s + NUDGE)
    # Stay in floating point, so that far away no integer overflows.
    half: f64 = 0.5 * cells
    return table_at(texture, EVEN if half == np.floor(half) else ODD)


@implements(texture_value, Checker)
def value_of_checker(texture: Table, where: Where) -> Vec3:
    return texture_value(cell_of(texture, where), where)


@implements(texture_spectrum, Checker)
def spectrum_of_checker(texture: Table, where: Where) -> Vec3:
    return texture_spectrum(cell_of(texture, where), where)
