"""The rough boundary of two clear media: reflection and refraction by facets, and light that bounces between them.

For facets m with the index n_o on the viewer's side and n_i behind (B. Walter, S. Marschner, H. Li, K. Torrance,
"Microfacet models for refraction through rough surfaces", EGSR 2007, equations 20 and 21; D, G as in microfacet.py)

    reflected   f |cos wi| = F D G / (4 |cos wo|),                                 m along wo + wi
    refracted   f |cos wi| = (1 - F) D G |wo.m| |wi.m| n_i² / (|cos wo| (n_o wo.m + n_i wi.m)²),   along n_o wo + n_i wi

Radiance is not scaled by the square of the index on passing, as in `Glass`, so that the second one has n_i² where
radiance proper has n_o², and n_o² f(wo, wi) = n_i² f(wi, wo) is what reciprocity means here.

Of the light of side a the share M_a(cos) is lost by following one bounce only (energy.py). It comes back spread evenly:
with r_a the share of it that ends on its own side, and M_a without an angle the mean over the hemisphere,

    f = r_a M_a(wo) M_a(wi) / (pi M_a)  on that side,    (1 - r_a) M_a(wo) M_b(wi) / (pi M_b)  on the other.

That is reciprocal if (1 - r_a) n_a² M_a = (1 - r_b) n_b² M_b, and Fresnel's mean reflectances, for which
(1 - F_a) n_a² = (1 - F_b) n_b², say about how large r is. So the smaller of the (1 - F) n² M is taken for both sides.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.materials.microfacet import Facets, facet_density, sample_facet, seen_from_both, upward, visible_density
from sightray.materials.missing import mean_share, sample_spread, share_at, spread_density
from sightray.mathlib.frame import fresnel, refract
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table
from sightray.mathlib.vec import Vec3, dot, grey, length


class Boundary(NamedTuple):
    """A rough boundary as one viewer sees it, from the upper side."""

    shape: Facets
    roughness: f64
    eta: f64  # index on the viewer's side over the one behind
    here: Table  # what is missing on the viewer's side
    there: Table  # and behind
    back: f64  # share of the missing light that comes back to the viewer's side


class Passage(NamedTuple):
    """What becomes of light between two directions: values times the cosine, for colourless facets."""

    facet: f64  # reflected by a facet that reflects everything
    share: f64  # Fresnel's share of it
    spread: f64  # reflected or passed after many bounces
    refracted: f64  # by one facet
    density: f64  # with which the pair is chosen


@kernel
def boundary_of(shape: Facets, roughness: f64, eta: f64, here: Table, there: Table, passed: f64) -> Boundary:
    """The boundary; `passed`: 1 minus the mean of Fresnel's share on the viewer's side."""
    mine, other = mean_share(here, roughness) * eta * eta, mean_share(there, roughness)
    # (1 - F) n² is the same on both sides, so the smaller product is that of the smaller mean.
    least = passed * eta * eta * min(mean_share(here, roughness), other)
    back = 1.0 - least / mine if mine > 0.0 else 0.0
    return Boundary(shape, roughness, eta, here, there, back)


@kernel
def sample_boundary(b: Boundary, o: Vec3, u: f64, v: f64, choice: f64) -> Vec3:
    """Choose where light comes from; the zero vector if it cannot come from where the facets say."""
    lost = share_at(b.here, b.roughness, o)
    if choice < lost:
        i = sample_spread(b.roughness, u, v)
        return i if choice < lost * b.back else Vec3(i.x, i.y, -i.z)
    m = sample_facet(b.shape, o, u, v)
    cosine = dot(o, m)
    if choice - lost < (1.0 - lost) * fresnel(cosine, b.eta):
        i = m * (2.0 * cosine) - o
        return i if i.z > 0.0 else grey(0.0)
    i = refract(-o, m, b.eta)
    return i if i.z < 0.0 else grey(0.0)


@kernel
def pass_boundary(b: Boundary, o: Vec3, i: Vec3) -> Passage:
    """Values and density of a pair of directions; o.z > 0, and the sign of i.z says on which side the light is."""
    lost, down = share_at(b.here, b.roughness, o), upward(i)
    if i.z > 0.0:
        h = o + i
        m = h / length(h)
        cosine = dot(o, m)
        share = fresnel(cosine, b.eta)
        facet = facet_density(b.shape, m) * seen_from_both(b.shape, o, i) / (4.0 * o.z)
        density = (1.0 - lost) * share * visible_density(b.shape, o, m) / (4.0 * cosine)
        spread = spread_over(b.here, b.roughness, lost * b.back, i)
        return Passage(facet, share, spread, 0.0, density + lost * b.back * spread_density(b.roughness, i.z))

    on = lost * (1.0 - b.back)
    spread = spread_over(b.there, b.roughness, on, down)
    density = on * spread_density(b.roughness, down.z)
    h = o * -b.eta - i
    size = length(h)
    m = h * (math.copysign(1.0, h.z) / size) if size > 0.0 else Vec3(0.0, 0.0, 1.0)
    cos_o, cos_i = dot(o, m), dot(i, m)
    if cos_o <= 0.0 or cos_i >= 0.0 or size <= 0.0:
        return Passage(0.0, 0.0, spread, 0.0, density)
    # The solid angle of facets per solid angle of directions.
    turn = -cos_i / ((b.eta * cos_o + cos_i) * (b.eta * cos_o + cos_i))
    once = (1.0 - fresnel(cos_o, b.eta)) * turn
    refracted = once * facet_density(b.shape, m) * seen_from_both(b.shape, o, down) * cos_o / o.z
    return Passage(0.0, 0.0, spread, refracted, density + (1.0 - lost) * once * visible_density(b.shape, o, m))


@kernel
def spread_over(table: Table, roughness: f64, light: f64, w: Vec3) -> f64:
    """Light spread over the side of a table, as much in each direction as is missing there; times the cosine."""
    mean = mean_share(table, roughness)
    return light * share_at(table, roughness, w) * w.z / (math.pi * mean) if mean > 0.0 else 0.0
