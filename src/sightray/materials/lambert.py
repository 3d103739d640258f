"""Ideal diffuse reflection."""

from __future__ import annotations

import math
from typing import Any

from sightray._jit import implements
from sightray.fields import Color, color
from sightray.materials.base import (
    PHONG,
    BsdfSample,
    BsdfValue,
    Local,
    Material,
    Sample8,
    Value8,
    bsdf,
    bsdf_eight,
    emitted,
    local,
    sample_bsdf,
    sample_eight,
)  # fmt: skip
from sightray.mathlib.eight_paths import cosine_hemisphere8
from sightray.mathlib.eights import F64x8, I64x8, Vec3x8, abs8d, select8d, sign8d, splat8d
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, table_at, vec3_at
from sightray.mathlib.vec import Vec3, grey
from sightray.mathlib.warp import cosine_hemisphere
from sightray.textures.base import Where, constant8, textured, value_at
from sightray.textures.constant import COLOR


class Lambert(Material):
    """Reflects a share `albedo` of the light, equally bright from all sides: f = albedo / pi (J. H. Lambert, 1760)."""

    chooses = False
    albedo: Any = textured("share of light that is reflected", default=0.5, at_most=1.0)
    emission: Color = color("radiance that the surface gives off by itself", default=0.0, unit="W/(m² sr)")

    @property
    def glow(self) -> float:
        return sum(self.emission) / 3


ALBEDO, EMISSION = Lambert.offsets()


@implements(local, Lambert)
def local_of_lambert(material: Table, where: Where, cos_view: f64) -> Local:
    albedo = value_at(table_at(material, ALBEDO), where)
    zero = grey(0.0)
    return Local(
        albedo, vec3_at(material, EMISSION), albedo, albedo * (1.0 / math.pi), zero, 0.0, PHONG, zero, zero, 1.0, zero
    )  # fmt: skip


@implements(sample_bsdf, Lambert)
def sample_lambert(material: Table, where: Where, wo: Vec3, u: f64, v: f64, choice: f64) -> BsdfSample:
    wi = cosine_hemisphere(u, v)
    density = wi.z / math.pi
    if wo.z < 0.0:
        wi = -wi
    return BsdfSample(wi, value_at(table_at(material, ALBEDO), where), density)


@implements(bsdf, Lambert)
def bsdf_of_lambert(material: Table, where: Where, wo: Vec3, wi: Vec3) -> BsdfValue:
    if wo.z * wi.z <= 0.0:
        return BsdfValue(grey(0.0), 0.0)
    density = abs(wi.z) / math.pi
    return BsdfValue(value_at(table_at(material, ALBEDO), where) * density, density)


@implements(emitted, Lambert)
def emitted_by_lambert(material: Table, where: Where, cos_view: f64) -> Vec3:
    return vec3_at(material, EMISSION)


@implements(sample_eight, Lambert)
def sample_lambert_eight(material: Table, rows: I64x8, wo: Vec3x8, u: F64x8, v: F64x8, choice: F64x8) -> Sample8:
    wi = cosine_hemisphere8(u, v)
    return Sample8(wi * sign8d(wo.z), constant8(material, rows, ALBEDO, COLOR), wi.z * (1.0 / math.pi))


@implements(bsdf_eight, Lambert)
def bsdf_of_lambert_eight(material: Table, rows: I64x8, wo: Vec3x8, wi: Vec3x8) -> Value8:
    density = select8d(wo.z * wi.z > 0.0, abs8d(wi.z) * (1.0 / math.pi), splat8d(0.0))
    return Value8(constant8(material, rows, ALBEDO, COLOR) * density, density)
