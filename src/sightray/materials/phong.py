"""The classic plastic: ambient, diffuse, highlight, and a mirror on top."""

from __future__ import annotations

from typing import Any

from sightray._jit import implements
from sightray.fields import Color, choice, color, number
from sightray.materials.base import Local, Material, local
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, i64_at, table_at, vec3_at
from sightray.mathlib.vec import grey
from sightray.textures.base import Where, texture_value, textured

HIGHLIGHTS = ("phong", "blinn")  # at the indices PHONG and BLINN of the contract, because kernels see the index


class Phong(Material):
    """Colours of classic computer graphics, which are not normalised: `diffuse` multiplies irradiance itself.

    A light that brings irradiance L from direction l shows as

        L * (diffuse * max(n.l, 0) + specular * max(cos a, 0)^shininess)

    with a the angle between the viewer and the mirrored light (``"phong"``), or between the normal and the half
    vector of viewer and light (``"blinn"``). So ``diffuse=0.5`` is as bright as a Lambertian albedo of 0.5 pi: nothing
    keeps the sum below 1, and colours may exceed it. `mirror` multiplies what a ray finds in the mirrored direction.

    References
    ----------
    B. T. Phong, "Illumination for computer generated pictures", CACM 18(6), 1975.
    J. F. Blinn, "Models of light reflection for computer synthesized pictures", SIGGRAPH 1977.
    """

    diffuse: Any = textured("colour of the diffuse part", default=0.5)
    specular: Any = textured("colour of the highlight", default=0.5)
    ambient: Any = textured("colour under ambient light", default=0.2)
    shininess: float = number("exponent of the highlight: large for a small one", default=32.0, at_least=0)
    emission: Color = color("radiance that the surface gives off by itself", default=0.0, unit="W/(m² sr)")
    mirror: Any = textured("colour of the mirror reflection", default=0.0)
    highlight: str = choice("how the highlight is measured", HIGHLIGHTS, default="phong")


DIFFUSE, SPECULAR, AMBIENT, SHININESS, EMISSION, MIRROR, HIGHLIGHT = Phong.offsets()


@implements(local, Phong)
def local_of_phong(material: Table, where: Where, cos_view: f64) -> Local:
    diffuse = texture_value(table_at(material, DIFFUSE), where)
    return Local(
        diffuse,
        vec3_at(material, EMISSION),
        texture_value(table_at(material, AMBIENT), where),
        diffuse,
        texture_value(table_at(material, SPECULAR), where),
        f64_at(material, SHININESS),
        i64_at(material, HIGHLIGHT),
        texture_value(table_at(material, MIRROR), where),
        grey(0.0), 1.0, grey(0.0),
    )  # fmt: skip
