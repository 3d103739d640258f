"""The layers of `Principled`: their values, and how directions are chosen among them.

Directions are on the viewer's side where z > 0. Reflectances of facets are Schlick's for metal, white at the edge (C.
Schlick, 1994), and Fresnel's for dielectrics. Below a varnish that reflects E of the light, the matte part is
``base (1 - E(o)) (1 - E(i)) / (pi (1 - E))``, with the mean of E over the hemisphere, so that a white base reflects all.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.materials.base import BsdfValue
from sightray.materials.by_wavelength import hero_share
from sightray.materials.dielectric import Boundary, Passage, pass_boundary, sample_boundary, spread_over
from sightray.materials.glass import shares_of_lanes
from sightray.materials.microfacet import (
    GGX,
    Facets,
    facet_density,
    facets,
    sample_facet,
    seen_from_both,
    upward,
    visible_density,
)
from sightray.materials.missing import mean_share, sample_spread, share_at, spread_density, varnish_share
from sightray.materials.sheen import sheen_share, sheen_value
from sightray.mathlib.bands import ones
from sightray.mathlib.frame import fresnel
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table
from sightray.mathlib.vec import Vec3, dot, grey, max4, normalize
from sightray.mathlib.warp import cosine_hemisphere

COAT_INDEX = 1.5  # of the clear coat


class Layers(NamedTuple):
    """A surface at one place, as seen from one side."""

    base: Vec3
    metal: f64  # shares of the base, which add up to 1
    opaque: f64
    clear: f64
    specular: f64
    eta: f64  # outside over inside
    boundary: Boundary  # of what is clear; its facets are those of the whole base
    iors: Vec3  # the same index, inside over outside or the other way round, for each lane of colour
    parted: bool  # whether they differ
    thin: bool
    mean: f64  # of Fresnel's share, over all sides
    coat: f64
    coat_roughness: f64
    sheen: Vec3
    sheen_roughness: f64
    metal_table: Table  # see energy.py and sheen.py; the last two are null where there is no such layer
    varnish_table: Table
    coat_table: Table
    sheen_table: Table


class Odds(NamedTuple):
    """With which probabilities a direction is chosen by which part."""

    coat: f64
    gloss: f64  # a facet of metal or varnish
    bounces: f64  # many facets of metal
    matte: f64  # and sheen
    clear: f64


@kernel
def odds_of(x: Layers, o: Vec3) -> Odds:
    """About as much as each part reflects of white light from all sides."""
    r = x.boundary.roughness
    coat = x.coat * varnish_share(x.coat_table, x.coat_roughness, 1.0 / COAT_INDEX, o) if x.coat > 0.0 else 0.0
    fibres = max4(x.sheen)
    if fibres > 0.0:
        fibres = fibres * sheen_share(x.sheen_table, x.sheen_roughness, o)
    lost = share_at(x.metal_table, r, o)
    metal = x.metal * max4(schlick(x.base, o.z))
    varnish = x.specular * varnish_share(x.varnish_table, r, x.eta, o)
    below = (1.0 - coat) * (1.0 - fibres)
    gloss = below * (metal * (1.0 - lost) + x.opaque * varnish)
    matte = below * x.opaque * (1.0 - varnish) * max4(x.base) + (1.0 - coat) * fibres
    total = coat + gloss + below * (metal * lost + x.clear) + matte
    if total <= 0.0:
        return Odds(0.0, 0.0, 0.0, 1.0, 0.0)
    return Odds(coat / total, gloss / total, below * metal * lost / total, matte / total, below * x.clear / total)


@kernel
def sample_layers(x: Layers, o: Vec3, u: f64, v: f64, choice: f64) -> Vec3:
    """Choose where light comes from; the zero vector if it cannot come from where a facet says."""
    odds = odds_of(x, o)
    if choice < odds.clear:
        if x.thin:
            return sample_sheet(x, o, u, v, choice / odds.clear)
        return sample_boundary(x.boundary, o, u, v, choice / odds.clear)
    choice -= odds.clear
    if choice < odds.matte:
        return cosine_hemisphere(u, v)
    choice -= odds.matte
    if choice < odds.bounces:
        return sample_spread(x.boundary.roughness, u, v)
    if choice - odds.bounces < odds.gloss:
        return mirrored_by_facet(x.boundary.shape, o, u, v)
    return mirrored_by_facet(facets(GGX, x.coat_roughness, 0.0), o, u, v)


@kernel
def mirrored_by_facet(shape: Facets, o: Vec3, u: f64, v: f64) -> Vec3:
    """Where a facet that is seen mirrors the viewer to; the zero vector if that is below."""
    m = sample_facet(shape, o, u, v)
    i = m * (2.0 * dot(o, m)) - o
    return i if i.z > 0.0 else grey(0.0)


@kernel
def layers_value(x: Layers, bands: Table, o: Vec3, i: Vec3) -> BsdfValue:
    """Value and density of all layers together."""
    odds = odds_of(x, o)
    value, density = base_value(x, bands, o, i, odds)
    up = upward(i)
    fibres = max4(x.sheen)
    if fibres > 0.0:
        shares = max(
            sheen_share(x.sheen_table, x.sheen_roughness, o), sheen_share(x.sheen_table, x.sheen_roughness, up)
        )
        value = value * (1.0 - fibres * shares)
        if i.z > 0.0:
            value += x.sheen * sheen_value(x.sheen_table, x.sheen_roughness, o, i)
    if x.coat > 0.0:
        shares = max(
            varnish_share(x.coat_table, x.coat_roughness, 1.0 / COAT_INDEX, o),
            varnish_share(x.coat_table, x.coat_roughness, 1.0 / COAT_INDEX, up),
        )
        value = value * (1.0 - x.coat * shares)
        if i.z > 0.0:
            shape, m = facets(GGX, x.coat_roughness, 0.0), normalize(o + i)
            share = x.coat * fresnel(dot(o, m), 1.0 / COAT_INDEX)
            value += ones(bands) * (share * facet_density(shape, m) * seen_from_both(shape, o, i) / (4.0 * o.z))
            density += odds.coat * visible_density(shape, o, m) / (4.0 * dot(o, m))
    return BsdfValue(value, density)


@kernel
def base_value(x: Layers, bands: Table, o: Vec3, i: Vec3, odds: Odds) -> tuple[Vec3, f64]:
    """Value of what is below sheen and coat, and density without the coat's part."""
    value, density = grey(0.0), 0.0
    if x.clear > 0.0:
        passage = pass_sheet(x, o, i) if x.thin else pass_boundary(x.boundary, o, i)
        density += odds.clear * passage.density
        if i.z < 0.0:
            lanes = hero_share(bands) if x.parted else ones(bands)
            value += x.base * lanes * (x.clear * (passage.refracted + passage.spread))
        else:
            shares = shares_of_lanes(x.iors, dot(o, normalize(o + i)), True) if x.parted else grey(passage.share)
            value += ones(bands) * (shares * passage.facet + passage.spread) * x.clear
    if i.z < 0.0:
        return value, density

    # Metal: one reflection, and many.
    r, shape = x.boundary.roughness, x.boundary.shape
    m = normalize(o + i)
    cosine = dot(o, m)
    once = facet_density(shape, m) * seen_from_both(shape, o, i) / (4.0 * o.z)
    if x.metal > 0.0:
        mean, lost = mean_share(x.metal_table, r), share_at(x.metal_table, r, o)
        f = x.base + (1.0 - x.base) * (1.0 / 21.0)  # the mean of Schlick's reflectance
        many = f * f * (1.0 - mean) / (1.0 - f * mean) * spread_over(x.metal_table, r, lost, i)
        value += (schlick(x.base, cosine) * once + many) * ones(bands) * x.metal
        density += odds.bounces * spread_density(r, i.z)

    # Varnish, and what is matte below.
    if x.opaque > 0.0:
        s = x.specular
        reflected = (1.0 - s * varnish_share(x.varnish_table, r, x.eta, o)) * (
            1.0 - s * varnish_share(x.varnish_table, r, x.eta, i)
        )
        matte = x.base * (reflected / (1.0 - s * mean_share(x.varnish_table, r)) * i.z / math.pi)
        value += (matte + ones(bands) * (s * fresnel(cosine, x.eta) * once)) * x.opaque
    density += odds.matte * i.z / math.pi + odds.gloss * visible_density(shape, o, m) / (4.0 * cosine)
    return value, density


@kernel
def schlick(base: Vec3, cosine: f64) -> Vec3:
    """A metal's reflectance by its colour head-on."""
    return base + (1.0 - base) * (1.0 - cosine) ** 5.0


@kernel
def pass_sheet(x: Layers, o: Vec3, i: Vec3) -> Passage:
    """A thin sheet: what does not reflect light passes it, into the mirrored lobe."""
    shape, r, up = x.boundary.shape, x.boundary.roughness, upward(i)
    m = normalize(o + up)
    cosine = dot(o, m)
    share = fresnel(cosine, x.eta)
    lost = share_at(x.metal_table, r, o)
    facet = facet_density(shape, m) * seen_from_both(shape, o, up) / (4.0 * o.z)
    density = (1.0 - lost) * visible_density(shape, o, m) / (4.0 * cosine)
    many = lost * spread_density(r, up.z)
    spread = spread_over(x.metal_table, r, lost, up)
    if i.z > 0.0:
        return Passage(facet, share, x.mean * spread, 0.0, share * density + x.mean * many)
    on = 1.0 - x.mean
    return Passage(0.0, 0.0, on * spread, (1.0 - share) * facet, (1.0 - share) * density + on * many)


@kernel
def sample_sheet(x: Layers, o: Vec3, u: f64, v: f64, choice: f64) -> Vec3:
    """Choose where light comes from to a thin sheet."""
    lost = share_at(x.metal_table, x.boundary.roughness, o)
    if choice < lost:
        i = sample_spread(x.boundary.roughness, u, v)
        return i if choice < lost * x.mean else Vec3(i.x, i.y, -i.z)
    m = sample_facet(x.boundary.shape, o, u, v)
    cosine = dot(o, m)
    i = m * (2.0 * cosine) - o
    if i.z <= 0.0:
        return grey(0.0)
    reflects = choice - lost < (1.0 - lost) * fresnel(cosine, x.eta)
    return i if reflects else Vec3(i.x, i.y, -i.z)
