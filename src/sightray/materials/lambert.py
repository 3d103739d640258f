"""Ideal diffuse reflection."""

from __future__ import annotations

import math
from typing import Any

from sightray._jit import implements
from sightray.fields import Color, color
from sightray.materials.base import PHONG, Local, Material, local
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, table_at, vec3_at
from sightray.mathlib.vec import grey
from sightray.textures.base import Where, texture_value, textured


class Lambert(Material):
    """Reflects a share `albedo` of the light, equally bright from all sides: f = albedo / pi (J. H. Lambert, 1760)."""

    albedo: Any = textured("share of light that is reflected", default=0.5, at_most=1.0)
    emission: Color = color("radiance that the surface gives off by itself", default=0.0, unit="W/(m² sr)")


ALBEDO, EMISSION = Lambert.offsets()


@implements(local, Lambert)
def local_of_lambert(material: Table, where: Where, cos_view: f64) -> Local:
    albedo = texture_value(table_at(material, ALBEDO), where)
    zero = grey(0.0)
    return Local(
        albedo, vec3_at(material, EMISSION), albedo, albedo * (1.0 / math.pi), zero, 0.0, PHONG, zero, zero, 1.0, zero
    )  # fmt: skip
