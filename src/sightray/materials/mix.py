"""Two materials at one place: dusty glass, worn gilding, a leaf that shines and lets light through."""

from __future__ import annotations

from typing import Any

from sightray._jit import implements, kernel
from sightray.fields import child, derived_child
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
from sightray.materials.data import data, share_of
from sightray.mathlib.bands import as_light
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, is_null, table_at
from sightray.mathlib.vec import Vec3, grey, max4, normalize
from sightray.textures.base import Where


class Mix(Material):
    """A share `amount` of the surface is made of `b`, the rest of `a`: everything about them is mixed by these shares.

    A random choice decides which of the two a path follows, but values and densities are stated for both together, so
    that lights are found as well as with either. Where both have an inside, that of `a` counts. If one of them glows,
    it does so with its own spectrum; the light of two lamps is up-sampled from its colour.
    """

    a: Any = child("what it is made of where `amount` is 0", "materials")
    b: Any = child("what it is made of where `amount` is 1", "materials")
    amount: Any = data("share of `b`", default=0.5)
    _lamp: Any = derived_child("the one that glows, if only one does", lambda m: lone_lamp(m.a, m.b))

    @property
    def cutout(self) -> bool:
        return self.a.cutout or self.b.cutout

    @property
    def bumpy(self) -> bool:
        return self.a.bumpy or self.b.bumpy

    @property
    def oriented(self) -> bool:
        return self.a.oriented or self.b.oriented

    @property
    def clear(self) -> bool:
        return self.a.clear and self.b.clear

    @property
    def translucent(self) -> bool:
        return self.a.translucent or self.b.translucent

    @property
    def filled(self) -> bool:
        return self.a.filled or self.b.filled

    @property
    def thin(self) -> bool:
        return self.a.thin or self.b.thin

    @property
    def glow(self) -> float:
        t = self.amount[0] if isinstance(self.amount, tuple) else 0.5
        return (1.0 - t) * self.a.glow + t * self.b.glow


def lone_lamp(a: Any, b: Any) -> Any:
    """The one of two materials that glows; None if both do, or neither."""
    if (a.glow > 0.0) == (b.glow > 0.0):
        return None
    return a if a.glow > 0.0 else b


A, B, AMOUNT, LAMP = Mix.offsets()


@implements(local, Mix)
def local_of_mix(material: Table, where: Where, cos_view: f64) -> Local:
    """Sums of shares; the highlight has the form, and the refraction the index, of the one that shows more of it."""
    t = share_of(table_at(material, AMOUNT), where)
    a = local(table_at(material, A), where, cos_view)
    b = local(table_at(material, B), where, cos_view)
    glossier = max4(a.specular) * (1.0 - t) >= max4(b.specular) * t
    clearer = max4(a.transmission) * (1.0 - t) >= max4(b.transmission) * t
    return Local(
        blend(a.color, b.color, t),
        blend(a.emission, b.emission, t),
        blend(a.ambient, b.ambient, t),
        blend(a.diffuse, b.diffuse, t),
        blend(a.specular, b.specular, t),
        a.shininess if glossier else b.shininess,
        a.highlight if glossier else b.highlight,
        blend(a.mirror, b.mirror, t),
        blend(a.transmission, b.transmission, t),
        a.eta if clearer else b.eta,
        a.absorption if clearer else b.absorption,
    )


@kernel
def blend(a: Vec3, b: Vec3, t: f64) -> Vec3:
    return a * (1.0 - t) + b * t


@implements(sample_bsdf, Mix)
def sample_mix(material: Table, where: Where, wo: Vec3, u: f64, v: f64, choice: f64) -> BsdfSample:
    t = share_of(table_at(material, AMOUNT), where)
    if choice < t:
        chosen = sample_bsdf(table_at(material, B), where, wo, u, v, choice / t)
    else:
        chosen = sample_bsdf(table_at(material, A), where, wo, u, v, (choice - t) / (1.0 - t))
    if chosen.density <= 0.0:  # a mirror's only direction, which the other one cannot have chosen; or none at all
        return chosen
    both = bsdf_of_mix(material, where, wo, chosen.wi)
    if not both.density > 0.0:  # seen exactly along the surface
        return BsdfSample(wo, grey(0.0), 0.0)
    return BsdfSample(chosen.wi, both.value / both.density, both.density)


@implements(bsdf, Mix)
def bsdf_of_mix(material: Table, where: Where, wo: Vec3, wi: Vec3) -> BsdfValue:
    t = share_of(table_at(material, AMOUNT), where)
    a = bsdf(table_at(material, A), where, wo, wi)
    b = bsdf(table_at(material, B), where, wo, wi)
    return BsdfValue(blend(a.value, b.value, t), a.density * (1.0 - t) + b.density * t)


@implements(emitted, Mix)
def emitted_by_mix(material: Table, where: Where, cos_view: f64) -> Vec3:
    t = share_of(table_at(material, AMOUNT), where)
    return blend(
        emitted(table_at(material, A), where, cos_view), emitted(table_at(material, B), where, cos_view), t
    )  # fmt: skip


@implements(glow_in_lanes, Mix)
def glow_of_mix(material: Table, bands: Table, rgb: Vec3) -> Vec3:
    lamp = table_at(material, LAMP)
    return as_light(bands, rgb) if is_null(lamp) else glow_in_lanes(lamp, bands, rgb)


@implements(interior, Mix)
def interior_of_mix(material: Table) -> Table:
    inside = interior(table_at(material, A))
    return interior(table_at(material, B)) if is_null(inside) else inside


@implements(opacity, Mix)
def opacity_of_mix(material: Table, where: Where) -> f64:
    t = share_of(table_at(material, AMOUNT), where)
    return opacity(table_at(material, A), where) * (1.0 - t) + opacity(table_at(material, B), where) * t


@implements(bent_normal, Mix)
def bent_normal_of_mix(material: Table, where: Where, way: Way) -> Vec3:
    t = share_of(table_at(material, AMOUNT), where)
    a = bent_normal(table_at(material, A), where, way)
    b = bent_normal(table_at(material, B), where, way)
    return normalize(blend(a, b, t) + Vec3(0.0, 0.0, 1e-9))
