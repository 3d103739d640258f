"""Fine relief as a picture of normals."""

from __future__ import annotations

from typing import Any

from sightray._jit import implements, kernel
from sightray.fields import number
from sightray.materials.base import Way, bent_normal
from sightray.materials.data import data
from sightray.materials.wrapper import INNER, _Wrapper
from sightray.mathlib.table import Table, f64_at, table_at
from sightray.mathlib.vec import Vec3, cross, dot, normalize
from sightray.textures.base import Where, texture_value

LOWEST = 0.02  # z of a bent normal: what a map bends further is taken for noise
NO_TILT = 1e-12


class NormalMap(_Wrapper):
    """Bends the shading normal as a picture says: red along u, green along v (upwards), blue along the normal.

    Colours c in 0 to 1 stand for the direction 2 c - 1 in the frame of the surface, which is the convention of glTF
    and OpenGL; pictures made for DirectX have green the other way round. PNG and JPEG files are read without the sRGB
    curve, so flat is (128, 128, 255). `strength` multiplies red and green. Relief changes how light is answered, not
    where the surface is: outlines and shadows stay.

    Reference: J. Cohen, M. Olano, D. Manocha, "Appearance-preserving simplification", SIGGRAPH 1998.
    """

    map: Any = data("texture of directions")
    strength: float = number("factor on the tilt", default=1.0, at_least=0)

    @property
    def bumpy(self) -> bool:
        return True


_, MAP, STRENGTH = NormalMap.offsets()


@implements(bent_normal, NormalMap)
def bent_normal_of_map(material: Table, where: Where, way: Way) -> Vec3:
    c, s = texture_value(table_at(material, MAP), where), f64_at(material, STRENGTH)
    n = normalize(Vec3((2.0 * c.x - 1.0) * s, (2.0 * c.y - 1.0) * s, max(LOWEST, 2.0 * c.z - 1.0)))
    return on_top(n, bent_normal(table_at(material, INNER), where, way))


@kernel
def on_top(n: Vec3, base: Vec3) -> Vec3:
    """A normal that was stated about +z, about the unit vector `base` instead: turned as z is turned there."""
    axis = Vec3(-base.y, base.x, 0.0)
    if dot(axis, axis) < NO_TILT:
        return n
    # Rotate by the angle between z and base (O. Rodrigues, 1840); axis has the length of its sine.
    turned = n * base.z + cross(axis, n) + axis * (dot(axis, n) / (1.0 + base.z))
    return normalize(Vec3(turned.x, turned.y, max(LOWEST, turned.z)))
