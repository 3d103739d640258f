"""The rough material of the lecture's assignments: a matte part and a GGX reflection."""

from __future__ import annotations

import math
from typing import Any

from sightray._jit import implements, kernel
from sightray.fields import Color, color, number
from sightray.materials.base import BsdfSample, BsdfValue, Local, Material, bsdf, emitted, local, sample_bsdf
from sightray.materials.gloss import glossy
from sightray.materials.microfacet import GGX, Facets, facet_density, hidden, sample_facet, visible_density
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, table_at, vec3_at
from sightray.mathlib.vec import Vec3, dot, grey, mean4, normalize
from sightray.mathlib.warp import cosine_hemisphere
from sightray.textures.base import Where, textured, value_at

LEAST_GLOSS = 0.25  # share of samples that go to the reflection, however dark it is


class CourseGgx(Material):
    """A sum of two parts, as lecture notes state it, with h the half vector of wi and wo:

        f = diffuse / pi + F(wi.h) D(h) G(wi) G(wo) / (4 |cos wi| |cos wo|)

    D is the GGX distribution of facets with the width `roughness` (alpha itself), G Smith's share of facets that are
    not hidden, each direction for itself, and F = specular + (1 - specular) (1 - wi.h)⁵ (C. Schlick, "An inexpensive
    BRDF model for physically-based rendering", EGSR 1994; B. Walter and others, EGSR 2007). Nothing keeps the sum of
    the parts below 1. For materials to work with see `Principled` and `Conductor`.
    """

    diffuse: Any = textured("colour of the matte part", default=0.5)
    specular: Any = textured("reflectance of the facets, seen straight on", default=0.04, at_most=1.0)
    roughness: float = number("width of the distribution: alpha", default=0.1, above=0, at_most=1)
    emission: Color = color("radiance that the surface gives off by itself", default=0.0, unit="W/(m² sr)")

    @property
    def glow(self) -> float:
        return sum(self.emission) / 3


DIFFUSE, SPECULAR, ROUGHNESS, EMISSION = CourseGgx.offsets()


@kernel
def share_of_gloss(diffuse: Vec3, specular: Vec3) -> f64:
    """Share of samples that go to the reflection."""
    total = mean4(diffuse) + mean4(specular)
    return max(LEAST_GLOSS, mean4(specular) / total) if total > 0.0 else 1.0


@implements(local, CourseGgx)
def local_of_course_ggx(material: Table, where: Where, cos_view: f64) -> Local:
    diffuse, specular = value_at(table_at(material, DIFFUSE), where), value_at(table_at(material, SPECULAR), where)
    alpha, zero = f64_at(material, ROUGHNESS), grey(0.0)
    return glossy(diffuse, vec3_at(material, EMISSION), diffuse, specular, zero, alpha, 1.0, zero)


@implements(bsdf, CourseGgx)
def bsdf_of_course_ggx(material: Table, where: Where, wo: Vec3, wi: Vec3) -> BsdfValue:
    if wo.z * wi.z <= 0.0:
        return BsdfValue(grey(0.0), 0.0)
    o, i = Vec3(wo.x, wo.y, abs(wo.z)), Vec3(wi.x, wi.y, abs(wi.z))
    diffuse, specular = value_at(table_at(material, DIFFUSE), where), value_at(table_at(material, SPECULAR), where)
    alpha = f64_at(material, ROUGHNESS)
    facets = Facets(GGX, alpha, alpha)
    h = normalize(o + i)
    cosine = dot(o, h)
    fresnel = specular + (grey(1.0) - specular) * max(0.0, 1.0 - cosine) ** 5.0
    seen = 1.0 / ((1.0 + hidden(facets, o)) * (1.0 + hidden(facets, i)))
    value = diffuse * (i.z / math.pi) + fresnel * (facet_density(facets, h) * seen / (4.0 * o.z))
    share = share_of_gloss(diffuse, specular)
    density = share * visible_density(facets, o, h) / (4.0 * cosine) + (1.0 - share) * i.z / math.pi
    return BsdfValue(value, density)


@implements(sample_bsdf, CourseGgx)
def sample_course_ggx(material: Table, where: Where, wo: Vec3, u: f64, v: f64, choice: f64) -> BsdfSample:
    diffuse, specular = value_at(table_at(material, DIFFUSE), where), value_at(table_at(material, SPECULAR), where)
    o, alpha = Vec3(wo.x, wo.y, abs(wo.z)), f64_at(material, ROUGHNESS)
    if choice < share_of_gloss(diffuse, specular):
        h = sample_facet(Facets(GGX, alpha, alpha), o, u, v)
        i = h * (2.0 * dot(o, h)) - o
    else:
        i = cosine_hemisphere(u, v)
    wi = i if wo.z > 0.0 else Vec3(i.x, i.y, -i.z)
    found = bsdf_of_course_ggx(material, where, wo, wi)
    if i.z <= 0.0 or found.density <= 0.0:
        return BsdfSample(wi, grey(0.0), 0.0)
    return BsdfSample(wi, found.value / found.density, found.density)


@implements(emitted, CourseGgx)
def emitted_by_course_ggx(material: Table, where: Where, cos_view: f64) -> Vec3:
    return vec3_at(material, EMISSION)
