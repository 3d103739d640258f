"""Pictures projected along the three axes: for shapes without texture coordinates worth the name."""

from __future__ import annotations

import math
from typing import Any

from sightray._jit import implements, kernel
from sightray.fields import number
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, is_null, table_at
from sightray.mathlib.vec import Vec3, vabs
from sightray.textures.base import Texture, Where, reach, texture_spectrum, texture_value, textured


class Triplanar(Texture):
    """Projects textures along x, y and z of the shape's space and blends them by where the surface faces.

    The weight of each is the component of the unit normal to the power of `sharpness`, so that a slope shows a mixture.
    Pictures stand upright (+y up) on the four sides, with -z up on floors and ceilings, and are mirrored on none;
    `scale` of them fit into a metre. `y` and `z` are the same as `x` unless given.

    Reference: R. Geiss, "Generating complex procedural terrains using the GPU", GPU Gems 3, 2007, section 1.5.
    """

    x: Any = textured("seen along x")
    y: Any = textured("seen along y; None: the same as x", default=None, optional=True)
    z: Any = textured("seen along z; None: the same as x", default=None, optional=True)
    scale: float = number("units of u and v per metre", default=1.0, above=0)
    sharpness: float = number("exponent of the weights; high: hard seams", default=4.0, above=0)


X, Y, Z, SCALE, SHARPNESS = Triplanar.offsets()


@kernel
def weights(texture: Table, n: Vec3) -> Vec3:
    """Shares of the three projections; they add up to 1."""
    a, k = vabs(n), f64_at(texture, SHARPNESS)
    most = max(a.x, a.y, a.z)
    w = Vec3((a.x / most) ** k, (a.y / most) ** k, (a.z / most) ** k)
    return w / (w.x + w.y + w.z)


@kernel
def projected(where: Where, u: f64, v: f64, facing: f64, scale: f64) -> Where:
    """A place on one projection, seen from the side that the surface faces, with its footprint there at most."""
    u, v = math.copysign(scale, facing) * u, scale * v
    return Where(u, v, where.p, where.normal, scale * reach(where), where.bands)


@kernel
def along_x(texture: Table, where: Where) -> Where:
    return projected(where, -where.p.z, where.p.y, where.normal.x, f64_at(texture, SCALE))


@kernel
def along_y(texture: Table, where: Where) -> Where:
    return projected(where, where.p.x, -where.p.z, where.normal.y, f64_at(texture, SCALE))


@kernel
def along_z(texture: Table, where: Where) -> Where:
    return projected(where, where.p.x, where.p.y, where.normal.z, f64_at(texture, SCALE))


@kernel
def picture(texture: Table, word: int) -> Table:
    """The texture of a projection, or that of x."""
    found = table_at(texture, word)
    return table_at(texture, X) if is_null(found) else found


@implements(texture_value, Triplanar)
def value_of_triplanar(texture: Table, where: Where) -> Vec3:
    w, color = weights(texture, where.normal), Vec3(0.0, 0.0, 0.0)
    if w.x > 0.0:
        color += texture_value(picture(texture, X), along_x(texture, where)) * w.x
    if w.y > 0.0:
        color += texture_value(picture(texture, Y), along_y(texture, where)) * w.y
    if w.z > 0.0:
        color += texture_value(picture(texture, Z), along_z(texture, where)) * w.z
    return color


@implements(texture_spectrum, Triplanar)
def spectrum_of_triplanar(texture: Table, where: Where) -> Vec3:
    w, color = weights(texture, where.normal), Vec3(0.0, 0.0, 0.0)
    if w.x > 0.0:
        color += texture_spectrum(picture(texture, X), along_x(texture, where)) * w.x
    if w.y > 0.0:
        color += texture_spectrum(picture(texture, Y), along_y(texture, where)) * w.y
    if w.z > 0.0:
        color += texture_spectrum(picture(texture, Z), along_z(texture, where)) * w.z
    return color
