"""Rough matte surfaces: plaster, clay, the full moon."""

from __future__ import annotations

import math
from typing import Any

from sightray._jit import implements, kernel
from sightray.fields import Color, color, derived_number, number
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
from sightray.materials.eight_facets import upward8
from sightray.materials.microfacet import upward
from sightray.mathlib.eight_functions import atan2_8
from sightray.mathlib.eight_paths import cosine_hemisphere8, grey8, plus8, quotient8
from sightray.mathlib.eights import (
    F64x8,
    I64x8,
    Vec3x8,
    dot8,
    gather8d,
    select8d,
    select8v,
    splat8d,
    sqrt8d,
    vmax8d,
    vmin8d,
)
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, table_at, vec3_at
from sightray.mathlib.vec import Vec3, dot, grey
from sightray.mathlib.warp import cosine_hemisphere
from sightray.textures.base import Where, constant8, textured, value_at
from sightray.textures.constant import COLOR

WIDEST = 2.0 / 3.0 - 28.0 / (15.0 * math.pi)  # what roughness adds to the mean reflectance


def _roughness(sigma: float) -> float:
    """The ratio B / A of the two constants of Oren and Nayar, for slopes that vary by `sigma` degrees."""
    s2 = math.radians(sigma) ** 2
    return 0.45 * s2 / (s2 + 0.09) / (1.0 - 0.5 * s2 / (s2 + 0.33))


class OrenNayar(Material):
    """A matte surface of V-shaped grooves, flatter in its shading than `Lambert`: its edges are as bright as its middle.

    `sigma` is the standard deviation of the grooves' slope angle; 0 is Lambert. The form is the one of Fujii, with
    r = B / A in Oren and Nayar's terms, s = wi.wo - cos i cos o, and t = max(cos i, cos o) where s > 0, else 1:

        f = albedo / pi (1 + r s / t) / (1 + (1/2 - 2 / (3 pi)) r)

    It has neither the dark ring nor the break in slope of the usual fit. Light that it loses between the grooves is
    added as in A. Portsmouth, P. Kutz, S. Hill, "EON: a practical energy-preserving rough diffuse BRDF" (JCGT 14(1),
    2025): with E the share of light that leaves, and its mean over the hemisphere,

        f += albedo² E / (pi (1 - albedo (1 - E))) (1 - E(cos o)) (1 - E(cos i)) / (1 - E)

    so an albedo of 1 reflects everything at any roughness, and colours become deeper with it.

    References: M. Oren, S. Nayar, "Generalization of Lambert's reflectance model", SIGGRAPH 1994; Y. Fujii, "A tiny
    improvement of Oren-Nayar reflectance model", 2012.
    """

    chooses = False
    albedo: Any = textured("share of light that is reflected", default=0.5, at_most=1.0)
    sigma: float = number("standard deviation of slopes", default=20.0, unit="degrees", at_least=0, at_most=90)
    emission: Color = color("radiance that the surface gives off by itself", default=0.0, unit="W/(m² sr)")
    _r: Any = derived_number("B / A of Oren and Nayar", lambda m: _roughness(m.sigma))

    @property
    def glow(self) -> float:
        return sum(self.emission) / 3


ALBEDO, SIGMA, EMISSION, R = OrenNayar.offsets()


@kernel
def leaves_once(r: f64, cosine: f64) -> f64:
    """E: the share of light of one direction that leaves a white surface after one reflection, in all directions."""
    a = 1.0 / (1.0 + (0.5 - 2.0 / (3.0 * math.pi)) * r)
    sine = math.sqrt(max(0.0, 1.0 - cosine * cosine))
    angle = math.acos(min(1.0, max(0.0, cosine)))
    tangent_part = 0.0  # tan (1 - sin³), finite along the surface
    if cosine > 1e-6:
        tangent_part = sine / cosine * (1.0 - sine * sine * sine)
    g = sine * (angle - sine * cosine) + 2.0 / 3.0 * (tangent_part - sine)
    return a * (1.0 + r * g / math.pi)


@implements(bsdf, OrenNayar)
def bsdf_of_oren_nayar(material: Table, where: Where, wo: Vec3, wi: Vec3) -> BsdfValue:
    if wo.z * wi.z <= 0.0:
        return BsdfValue(grey(0.0), 0.0)
    r, albedo = f64_at(material, R), value_at(table_at(material, ALBEDO), where)
    o, i = upward(wo), upward(wi)
    a = 1.0 / (1.0 + (0.5 - 2.0 / (3.0 * math.pi)) * r)
    s = dot(o, i) - o.z * i.z
    once = a * (1.0 + r * (s / max(o.z, i.z) if s > 0.0 else s))
    value = albedo * once

    mean = a * (1.0 + WIDEST * r)
    if mean < 1.0:
        spread = (1.0 - leaves_once(r, o.z)) * (1.0 - leaves_once(r, i.z)) / (1.0 - mean)
        value += albedo * albedo * (mean * spread) / (1.0 - albedo * (1.0 - mean))
    density = i.z / math.pi
    return BsdfValue(value * density, density)


@implements(sample_bsdf, OrenNayar)
def sample_oren_nayar(material: Table, where: Where, wo: Vec3, u: f64, v: f64, choice: f64) -> BsdfSample:
    wi = cosine_hemisphere(u, v)
    wi = wi if wo.z > 0.0 else -wi
    found = bsdf_of_oren_nayar(material, where, wo, wi)
    if found.density <= 0.0:
        return BsdfSample(wo, grey(0.0), 0.0)
    return BsdfSample(wi, found.value / found.density, found.density)


@implements(local, OrenNayar)
def local_of_oren_nayar(material: Table, where: Where, cos_view: f64) -> Local:
    """Whitted's model has no term that knows viewer and light: matte, as bright as light from all sides would show."""
    albedo = value_at(table_at(material, ALBEDO), where)
    zero = grey(0.0)
    return Local(
        albedo, vec3_at(material, EMISSION), albedo, albedo * (1.0 / math.pi), zero, 0.0, PHONG, zero, zero, 1.0, zero
    )  # fmt: skip


@implements(emitted, OrenNayar)
def emitted_by_oren_nayar(material: Table, where: Where, cos_view: f64) -> Vec3:
    return vec3_at(material, EMISSION)


@kernel
def leaves_once8(r: F64x8, cosine: F64x8) -> F64x8:
    """`leaves_once` for eight paths."""
    c = vmin8d(splat8d(1.0), vmax8d(splat8d(0.0), cosine))
    sine = sqrt8d(vmax8d(splat8d(0.0), 1.0 - c * c))
    tangent_part = select8d(c > 1e-6, sine / c * (1.0 - sine * sine * sine), splat8d(0.0))
    g = sine * (atan2_8(sine, c) - sine * c) + (tangent_part - sine) * (2.0 / 3.0)
    return (1.0 + r * g * (1.0 / math.pi)) / (1.0 + r * (0.5 - 2.0 / (3.0 * math.pi)))


@implements(bsdf_eight, OrenNayar)
def bsdf_of_oren_nayar_eight(material: Table, rows: I64x8, wo: Vec3x8, wi: Vec3x8) -> Value8:
    r, albedo = gather8d(material, rows + R), constant8(material, rows, ALBEDO, COLOR)
    o, i = upward8(wo), upward8(wi)
    a = 1.0 / (1.0 + r * (0.5 - 2.0 / (3.0 * math.pi)))
    s = dot8(o, i) - o.z * i.z
    value = albedo * (a * (1.0 + r * select8d(s > 0.0, s / vmax8d(o.z, i.z), s)))
    mean = a * (1.0 + r * WIDEST)
    spread = (1.0 - leaves_once8(r, o.z)) * (1.0 - leaves_once8(r, i.z)) / (1.0 - mean)
    many = quotient8(albedo * albedo * (mean * spread), plus8(-(albedo * (1.0 - mean)), splat8d(1.0)))
    value = select8v(mean < 1.0, value + many, value)
    density = select8d(wo.z * wi.z > 0.0, i.z * (1.0 / math.pi), splat8d(0.0))
    return Value8(select8v(density > 0.0, value * density, grey8(0.0)), density)


@implements(sample_eight, OrenNayar)
def sample_oren_nayar_eight(material: Table, rows: I64x8, wo: Vec3x8, u: F64x8, v: F64x8, choice: F64x8) -> Sample8:
    wi = cosine_hemisphere8(u, v)
    wi = select8v(wo.z > 0.0, wi, -wi)
    found = bsdf_of_oren_nayar_eight(material, rows, wo, wi)
    there = found.density > 0.0
    weight = select8v(there, found.value * (1.0 / found.density), grey8(0.0))
    return Sample8(select8v(there, wi, wo), weight, found.density)
