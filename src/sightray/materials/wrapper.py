"""Materials around another material: what they do not change, they hand on to it."""

from __future__ import annotations

from typing import Any

from sightray._jit import implements
from sightray.fields import child
from sightray.materials.base import (
    BsdfSample,
    BsdfValue,
    Local,
    Material,
    Way,
    bent_normal,
    bsdf,
    emitted,
    glow_in_lanes,
    interior,
    local,
    opacity,
    sample_bsdf,
)  # fmt: skip
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, table_at
from sightray.mathlib.vec import Vec3
from sightray.textures.base import Where


class _Wrapper(Material):
    """Base of materials around another one, whose row is named in their first field."""

    material: Any = child("the material that it changes", "materials")

    @property
    def cutout(self) -> bool:
        return self.material.cutout

    @property
    def bumpy(self) -> bool:
        return self.material.bumpy

    @property
    def oriented(self) -> bool:
        return self.material.oriented

    @property
    def clear(self) -> bool:
        return self.material.clear

    @property
    def translucent(self) -> bool:
        return self.material.translucent

    @property
    def filled(self) -> bool:
        return self.material.filled

    @property
    def thin(self) -> bool:
        return self.material.thin

    @property
    def glow(self) -> float:
        return self.material.glow

    @property
    def painted_glow(self) -> Any:
        return self.material.painted_glow

    @property
    def bare(self) -> Material:
        answers = type(self).kernels
        hands_on = answers[sample_bsdf] is sample_within and answers[bsdf] is bsdf_within
        return self.material.bare if hands_on else self


(INNER,) = _Wrapper.offsets()


@implements(local, _Wrapper)
def local_within(material: Table, where: Where, cos_view: f64) -> Local:
    return local(table_at(material, INNER), where, cos_view)


@implements(sample_bsdf, _Wrapper)
def sample_within(material: Table, where: Where, wo: Vec3, u: f64, v: f64, choice: f64) -> BsdfSample:
    return sample_bsdf(table_at(material, INNER), where, wo, u, v, choice)


@implements(bsdf, _Wrapper)
def bsdf_within(material: Table, where: Where, wo: Vec3, wi: Vec3) -> BsdfValue:
    return bsdf(table_at(material, INNER), where, wo, wi)


@implements(emitted, _Wrapper)
def emitted_within(material: Table, where: Where, cos_view: f64) -> Vec3:
    return emitted(table_at(material, INNER), where, cos_view)


@implements(glow_in_lanes, _Wrapper)
def glow_within(material: Table, bands: Table, rgb: Vec3) -> Vec3:
    return glow_in_lanes(table_at(material, INNER), bands, rgb)


@implements(interior, _Wrapper)
def interior_within(material: Table) -> Table:
    return interior(table_at(material, INNER))


@implements(opacity, _Wrapper)
def opacity_within(material: Table, where: Where) -> f64:
    return opacity(table_at(material, INNER), where)


@implements(bent_normal, _Wrapper)
def bent_normal_within(material: Table, where: Where, way: Way) -> Vec3:
    return bent_normal(table_at(material, INNER), where, way)
