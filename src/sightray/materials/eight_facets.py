"""The facets of `microfacet`, for eight paths at once."""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.materials.beckmann import sample_visible_slope
from sightray.materials.energy import SMOOTH
from sightray.materials.microfacet import BECKMANN, MOST_UNEVEN, Facets, hidden
from sightray.mathlib.eight_functions import circle8, exp8
from sightray.mathlib.eight_paths import lane_at, load8v, normalize8, put_lane, store8v
from sightray.mathlib.eights import (
    F64x8,
    Vec3x8,
    abs8d,
    dot8,
    load8d,
    mask8,
    select8d,
    splat8d,
    sqrt8d,
    store8d,
    vmax8d,
    vmin8d,
)
from sightray.mathlib.lanes import lowest_bit, movemask8
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import f64_at, f64_put, scratch


class Facets8(NamedTuple):
    """`Facets` for eight paths."""

    beckmann: i64  # a bit for each that has this distribution; the others have that of GGX
    x: F64x8
    y: F64x8


@kernel
def facets8(beckmann: i64, roughness: F64x8, anisotropy: F64x8) -> Facets8:
    """`microfacet.facets`."""
    alpha = vmax8d(roughness * roughness, splat8d(SMOOTH))
    if movemask8(abs8d(anisotropy) > 0.0) == 0:
        return Facets8(beckmann, alpha, alpha)
    aspect = sqrt8d(1.0 - MOST_UNEVEN * abs8d(anisotropy))
    aspect = select8d(anisotropy < 0.0, 1.0 / aspect, aspect)
    one = splat8d(1.0)
    return Facets8(beckmann, vmin8d(one, alpha / aspect), vmin8d(one, vmax8d(splat8d(SMOOTH), alpha * aspect)))


@kernel
def facet_density8(facets: Facets8, m: Vec3x8) -> F64x8:
    """`microfacet.facet_density`."""
    x, y, z2 = m.x / facets.x, m.y / facets.y, m.z * m.z
    slope2, area = x * x + y * y, facets.x * facets.y * math.pi
    base = slope2 + z2
    density = 1.0 / (area * base * base)
    if facets.beckmann != 0:
        other = select8d(m.z > 0.0, exp8(-(slope2 / z2)) / (area * z2 * z2), splat8d(0.0))
        density = select8d(mask8(facets.beckmann), other, density)
    return density


@kernel
def hidden8(facets: Facets8, w: Vec3x8) -> F64x8:
    """`microfacet.hidden`."""
    x, y = w.x * facets.x, w.y * facets.y
    found = 0.5 * (sqrt8d(1.0 + (x * x + y * y) / (w.z * w.z)) - 1.0)
    return found if facets.beckmann == 0 else hidden_one_by_one(facets, w, found)


@kernel
def hidden_one_by_one(facets: Facets8, w: Vec3x8, known: F64x8) -> F64x8:
    """The lanes of Beckmann's distribution, which takes the error function."""
    words, bits = scratch(48), facets.beckmann & movemask8(w.z > 0.0)
    store8v(words, 0, w)
    store8d(words, 24, facets.x)
    store8d(words, 32, facets.y)
    store8d(words, 40, known)
    while bits != 0:
        k = lowest_bit(bits)
        bits &= bits - 1
        shape = Facets(BECKMANN, f64_at(words, 24 + k), f64_at(words, 32 + k))
        f64_put(words, 40 + k, hidden(shape, lane_at(words, k)))
    return load8d(words, 40)


@kernel
def sample_facet8(facets: Facets8, wo: Vec3x8, u: F64x8, v: F64x8) -> Vec3x8:
    """`microfacet.sample_facet`."""
    stretched = normalize8(Vec3x8(wo.x * facets.x, wo.y * facets.y, wo.z))
    z = (1.0 - u) * (1.0 + stretched.z) - stretched.z
    sine = sqrt8d(vmax8d(splat8d(0.0), 1.0 - z * z))
    cosine_around, sine_around = circle8(v)
    m = Vec3x8(sine * cosine_around, sine * sine_around, z) + stretched
    if facets.beckmann != 0:
        m = slopes_one_by_one(facets.beckmann, stretched, u, v, m)
    return normalize8(Vec3x8(m.x * facets.x, m.y * facets.y, vmax8d(m.z, splat8d(1e-12))))


@kernel
def slopes_one_by_one(bits: i64, stretched: Vec3x8, u: F64x8, v: F64x8, known: Vec3x8) -> Vec3x8:
    """The lanes in `bits`, by `sample_visible_slope`; what is known of the others is kept."""
    words = scratch(64)
    store8v(words, 0, stretched)
    store8d(words, 24, u)
    store8d(words, 32, v)
    store8v(words, 40, known)
    while bits != 0:
        k = lowest_bit(bits)
        bits &= bits - 1
        slope = sample_visible_slope(lane_at(words, k), f64_at(words, 24 + k), f64_at(words, 32 + k))
        put_lane(words, 40 + k, slope)
    return load8v(words, 40)


@kernel
def upward8(w: Vec3x8) -> Vec3x8:
    """`microfacet.upward`."""
    return Vec3x8(w.x, w.y, abs8d(w.z))


class Facing8(NamedTuple):
    """What facets do with light between two directions above the surface."""

    cosine: F64x8  # between either direction and the facets that mirror one into the other
    once: F64x8  # f times the cosine of facets that reflect everything
    density: F64x8  # with which `sample_facet` chooses the one direction from the other
    before: F64x8  # 1 and the facets that are hidden from the viewer, per seen one
    after: F64x8  # and those hidden from the light


@kernel
def facing8(facets: Facets8, o: Vec3x8, i: Vec3x8) -> Facing8:
    """Light between the viewer `o` and `i`, both with z > 0."""
    m = normalize8(o + i)
    cosine, before = dot8(o, m), 1.0 + hidden8(facets, o)
    after = before + hidden8(facets, i)
    part = facet_density8(facets, m) / (4.0 * o.z)
    seen = select8d(cosine > 0.0, part, splat8d(0.0))
    return Facing8(cosine, part / after, seen / before, before, after)
