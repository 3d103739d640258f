"""Another texture, moved over the surface."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import implements, kernel
from sightray.fields import derived_vector, number, other
from sightray.mathlib.table import Table, table_at, vec3_at
from sightray.mathlib.vec import Vec3
from sightray.textures.base import Texture, Where, texture_spectrum, texture_value, textured
from sightray.textures.bitmap import _pair


class UvTransform(Texture):
    """Looks up `texture` at ``R(rotate) (scale * (u, v)) + offset``: coordinates are scaled, turned and shifted.

    A larger `scale` makes the pattern smaller, and a counter-clockwise turn of coordinates turns it clockwise, as seen
    with u to the right and v upwards.
    """

    texture: Any = textured("what is moved")
    scale: tuple[float, float] = other("factors of u and v", _pair, default=1.0, plain=list)
    rotate: float = number("counter-clockwise turn of the coordinates", default=0.0, unit="degrees")
    offset: tuple[float, float] = other("added to u and v", _pair, default=0.0, plain=list)
    _u: Any = derived_vector("new u: factors of u, v and 1", lambda t: t.rows()[0])
    _v: Any = derived_vector("new v: factors of u, v and 1", lambda t: t.rows()[1])

    def rows(self) -> np.ndarray:
        """The affine map of (u, v, 1), (2, 3) float64."""
        c, s = math.cos(math.radians(self.rotate)), math.sin(math.radians(self.rotate))
        turn = np.array([[c, -s], [s, c]])
        return np.column_stack([turn * np.array(self.scale), np.array(self.offset)])

    def brightness_over(self, corners: np.ndarray) -> np.ndarray:
        if not isinstance(self.texture, Texture):
            return super().brightness_over(corners)
        rows = self.rows()
        return self.texture.brightness_over(corners @ rows[:, :2].T + rows[:, 2])


TEXTURE, _, U, V = UvTransform.offsets()


@kernel
def moved(texture: Table, where: Where) -> Where:
    """The place that is looked up."""
    a, b = vec3_at(texture, U), vec3_at(texture, V)
    u, v = a.x * where.u + a.y * where.v + a.z, b.x * where.u + b.y * where.v + b.z
    grown = math.sqrt(max(a.x * a.x + b.x * b.x, a.y * a.y + b.y * b.y))
    return Where(u, v, where.p, where.normal, where.width * grown, where.bands)


@implements(texture_value, UvTransform)
def value_of_moved(texture: Table, where: Where) -> Vec3:
    return texture_value(table_at(texture, TEXTURE), moved(texture, where))


@implements(texture_spectrum, UvTransform)
def spectrum_of_moved(texture: Table, where: Where) -> Vec3:
    return texture_spectrum(table_at(texture, TEXTURE), moved(texture, where))
