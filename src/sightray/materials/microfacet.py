"""Rough surfaces as a landscape of tiny mirrors: the distributions of GGX and Beckmann.

A facet with the unit normal m has the density D(m); a share 1 / (1 + L(w)) of the facets that face a direction w is not
hidden by others (L is Smith's auxiliary function), and 1 / (1 + L(wo) + L(wi)) is seen from both (heights that are
correlated). With `x` and `y` the roughness alpha along and across the tangent,

    GGX       D = 1 / (pi x y ((m.x/x)² + (m.y/y)² + m.z²)²),    L = (sqrt(1 + a²) - 1) / 2
    Beckmann  D = exp(-((m.x/x)² + (m.y/y)²) / m.z²) / (pi x y m.z⁴),
              L = exp(-1/a²) a / (2 sqrt(pi)) - erfc(1/a) / 2,    a² = ((x w.x)² + (y w.y)²) / w.z²

Facets are chosen among those that the viewer sees, with the density D(m) max(0, wo.m) / ((1 + L(wo)) wo.z), so that a
sample's weight is never more than the Fresnel term. All directions here are on the upper side, z > 0.

References
----------
B. Walter, S. Marschner, H. Li, K. Torrance, "Microfacet models for refraction through rough surfaces", EGSR 2007.
E. Heitz, "Understanding the masking-shadowing function in microfacet-based BRDFs", JCGT 3(2), 2014.
E. Heitz, "Sampling the GGX distribution of visible normals", JCGT 7(4), 2018.
J. Dupuy, A. Benyoub, "Sampling visible GGX normals with spherical caps", HPG 2023.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.materials.beckmann import sample_visible_slope
from sightray.materials.energy import SMOOTH
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.vec import Vec3, dot, normalize
from sightray.mathlib.warp import circle

DISTRIBUTIONS = ("ggx", "beckmann")  # at the indices GGX and BECKMANN
GGX, BECKMANN = 0, 1
MOST_UNEVEN = 0.9  # an anisotropy of 1 leaves the square root of a tenth of the roughness along the tangent


class Facets(NamedTuple):
    """How the facets of a surface are distributed."""

    kind: i64  # GGX or BECKMANN
    x: f64  # alpha along the tangent
    y: f64  # alpha across it


@kernel
def facets(kind: i64, roughness: f64, anisotropy: f64) -> Facets:
    """Facets of a perceived roughness, 0 to 1: alpha is its square (B. Burley, SIGGRAPH 2012 course).

    `anisotropy`, -1 to 1, makes the surface smoother across the tangent and rougher along it, or the other way round.
    """
    alpha = max(roughness * roughness, SMOOTH)
    if anisotropy == 0.0:
        return Facets(kind, alpha, alpha)
    aspect = math.sqrt(1.0 - MOST_UNEVEN * abs(anisotropy))
    if anisotropy < 0.0:
        aspect = 1.0 / aspect
    return Facets(kind, min(1.0, alpha / aspect), min(1.0, max(SMOOTH, alpha * aspect)))


@kernel
def is_smooth(roughness: f64) -> bool:
    """Whether a surface is so smooth that it is a mirror."""
    return roughness * roughness <= SMOOTH


@kernel
def facet_density(facets: Facets, m: Vec3) -> f64:
    """D(m), per solid angle; the projections m.z of all facets fill the surface."""
    x, y = m.x / facets.x, m.y / facets.y
    if facets.kind == GGX:
        base = x * x + y * y + m.z * m.z
        return 1.0 / (math.pi * facets.x * facets.y * base * base)
    if m.z <= 0.0:
        return 0.0
    z2 = m.z * m.z
    return math.exp(-(x * x + y * y) / z2) / (math.pi * facets.x * facets.y * z2 * z2)


@kernel
def hidden(facets: Facets, w: Vec3) -> f64:
    """Smith's L(w): hidden facets per seen one."""
    x, y = w.x * facets.x, w.y * facets.y
    a2 = (x * x + y * y) / (w.z * w.z)
    if facets.kind == GGX:
        return 0.5 * (math.sqrt(1.0 + a2) - 1.0)
    if a2 < 0.01:  # exp(-100): nothing
        return 0.0
    a = math.sqrt(a2)
    return max(0.0, 0.5 * (math.exp(-1.0 / a2) * a / math.sqrt(math.pi) - math.erfc(1.0 / a)))


@kernel
def seen_from_both(facets: Facets, wo: Vec3, wi: Vec3) -> f64:
    """Share of facets that is hidden neither from wo nor from wi."""
    return 1.0 / (1.0 + hidden(facets, wo) + hidden(facets, wi))


@kernel
def visible_density(facets: Facets, wo: Vec3, m: Vec3) -> f64:
    """Density of the facets that are seen from wo, per solid angle of m: with which `sample_facet` chooses."""
    return max(0.0, dot(wo, m)) * facet_density(facets, m) / ((1.0 + hidden(facets, wo)) * wo.z)


@kernel
def sample_facet(facets: Facets, wo: Vec3, u: f64, v: f64) -> Vec3:
    """Choose a facet among those that wo sees."""
    # Stretch the surface until its roughness is 1.
    stretched = normalize(Vec3(wo.x * facets.x, wo.y * facets.y, wo.z))
    if facets.kind == GGX:
        # What is seen of a hemisphere, mirrored, is a cap of the sphere.
        z = (1.0 - u) * (1.0 + stretched.z) - stretched.z
        sine, around = math.sqrt(max(0.0, 1.0 - z * z)), circle(v)
        m = Vec3(sine * around.x, sine * around.y, z) + stretched
    else:
        m = sample_visible_slope(stretched, u, v)
    return normalize(Vec3(m.x * facets.x, m.y * facets.y, max(m.z, 1e-12)))


@kernel
def upward(w: Vec3) -> Vec3:
    """A direction mirrored to the upper side of the surface."""
    return Vec3(w.x, w.y, abs(w.z))
