"""Sheets that look different from the two sides: playing cards, banknotes, leaves."""

from __future__ import annotations

from typing import Any

from sightray._jit import implements, kernel
from sightray.fields import child, derived_child
from sightray.materials.base import (
    BsdfSample,
    BsdfValue,
    Local,
    bsdf,
    emitted,
    glow_in_lanes,
    local,
    sample_bsdf,
)
from sightray.materials.mix import lone_lamp
from sightray.materials.wrapper import INNER, _Wrapper
from sightray.mathlib.bands import as_light
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, is_null, table_at
from sightray.mathlib.vec import Vec3
from sightray.textures.base import Where


class TwoSided(_Wrapper):
    """Shows `material` on the outer side of a surface and `back` on the inner one; without a `back`, the same on both.

    Either side answers as it would from outside, lamps glow on both sides. It is meant for opaque materials: what lets
    light through already knows which side is which. Holes and relief are those of `material`. A lamp keeps its
    spectrum; if the sides are two different lamps, their light is up-sampled from its colour.
    """

    back: Any = child("what the inner side is made of; None for the same", "materials", default=None, optional=True)
    _lamp: Any = derived_child("what glows, if it is one material", lambda t: t.lamp())

    def lamp(self) -> Any:
        """The material that glows; None if both sides do, each in its own way."""
        return self.material if self.back is None else lone_lamp(self.material, self.back)

    @property
    def oriented(self) -> bool:
        return self.material.oriented or (self.back is not None and self.back.oriented)

    @property
    def glow(self) -> float:
        return max(self.material.glow, 0.0 if self.back is None else self.back.glow)


_, BACK, LAMP = TwoSided.offsets()


@kernel
def side_of(material: Table, z: f64) -> Table:
    """The material on the side of a direction."""
    back = table_at(material, BACK)
    return table_at(material, INNER) if z >= 0.0 or is_null(back) else back


@kernel
def turned(w: Vec3, z: f64) -> Vec3:
    """A direction as the side of a direction sees it: from outside."""
    return w if z >= 0.0 else Vec3(w.x, w.y, -w.z)


@implements(local, TwoSided)
def local_of_two_sided(material: Table, where: Where, cos_view: f64) -> Local:
    return local(side_of(material, cos_view), where, abs(cos_view))


@implements(sample_bsdf, TwoSided)
def sample_two_sided(material: Table, where: Where, wo: Vec3, u: f64, v: f64, choice: f64) -> BsdfSample:
    chosen = sample_bsdf(side_of(material, wo.z), where, turned(wo, wo.z), u, v, choice)
    return BsdfSample(turned(chosen.wi, wo.z), chosen.weight, chosen.density)


@implements(bsdf, TwoSided)
def bsdf_of_two_sided(material: Table, where: Where, wo: Vec3, wi: Vec3) -> BsdfValue:
    return bsdf(side_of(material, wo.z), where, turned(wo, wo.z), turned(wi, wo.z))


@implements(emitted, TwoSided)
def emitted_by_two_sided(material: Table, where: Where, cos_view: f64) -> Vec3:
    return emitted(side_of(material, cos_view), where, abs(cos_view))


@implements(glow_in_lanes, TwoSided)
def glow_of_either_side(material: Table, bands: Table, rgb: Vec3) -> Vec3:
    lamp = table_at(material, LAMP)
    return as_light(bands, rgb) if is_null(lamp) else glow_in_lanes(lamp, bands, rgb)
