"""The tables of energy.py as `missing` reads them, for eight paths at once.

A table is known by how many words it is from the material that is asked to it.
"""

from __future__ import annotations

import math

from sightray._jit import kernel
from sightray.materials.energy import COSINES, ROUGHNESSES, SMOOTH
from sightray.materials.missing import PLANE
from sightray.mathlib.eight_functions import circle8
from sightray.mathlib.eight_paths import cosine_hemisphere8, fresnel8
from sightray.mathlib.eights import (
    F64x8,
    I64x8,
    Vec3x8,
    abs8d,
    floor8d,
    floor8i,
    gather8d,
    gather8i,
    select8d,
    select8i,
    select8v,
    splat8d,
    splat8i,
    sqrt8d,
    vmax8d,
    vmin8d,
)
from sightray.mathlib.lanes import Mask8, movemask8
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, words_to


@kernel
def tables8(material: Table, rows: I64x8, word: i64) -> I64x8:
    """Where the tables are that the materials have in `word`."""
    return (gather8i(material, rows + word) >> 3) + words_to(material, 0)


@kernel
def tables8_or(material: Table, rows: I64x8, word: i64, other: I64x8) -> I64x8:
    """The same, or `other` for materials without such a table."""
    address = gather8i(material, rows + word)
    return select8i(address == 0, other, (address >> 3) + words_to(material, 0))


@kernel
def share_at8(material: Table, table: I64x8, roughness: F64x8, w: Vec3x8) -> F64x8:
    """`missing.share_at`."""
    azimuths, bend = gather8d(material, table), vmax8d(splat8d(SMOOTH), roughness * roughness)
    several = azimuths > 1.0
    if movemask8(several) == 0:
        return in_plane8(material, table + 1, roughness, bend, w.z)
    zero, flat = splat8d(0.0), w.x * w.x + w.y * w.y
    at = vmax8d(select8d(flat > 0.0, w.x * w.x / flat * (azimuths - 1.0), zero), zero)
    a = floor8d(vmin8d(at, vmax8d(azimuths - 2.0, zero)))
    t, start = at - a, table + floor8i(a) * PLANE + 1
    below = in_plane8(material, start, roughness, bend, w.z)
    above = in_plane8(material, start + select8i(several, splat8i(PLANE), splat8i(0)), roughness, bend, w.z)
    return below * (1.0 - t) + above * t


@kernel
def in_plane8(material: Table, start: I64x8, roughness: F64x8, bend: F64x8, cosine: F64x8) -> F64x8:
    """`missing.in_plane`."""
    z = vmin8d(abs8d(cosine), splat8d(1.0))  # also where there is no direction
    x, y = z * (1.0 + bend) / (z + bend) * (COSINES - 1.0), roughness * (ROUGHNESSES - 1.0)
    k, r = floor8d(vmin8d(x, splat8d(COSINES - 2.0))), floor8d(vmin8d(y, splat8d(ROUGHNESSES - 2.0)))
    s, t = x - k, y - r
    at = start + floor8i(r) * COSINES + floor8i(k)
    low = gather8d(material, at) * (1.0 - s) + gather8d(material, at + 1) * s
    high = gather8d(material, at + COSINES) * (1.0 - s) + gather8d(material, at + (COSINES + 1)) * s
    return low * (1.0 - t) + high * t


@kernel
def varnish_share8(material: Table, table: I64x8, roughness: F64x8, eta: F64x8, w: Vec3x8) -> F64x8:
    """`missing.varnish_share`."""
    return vmin8d(splat8d(1.0), fresnel8(w.z, eta) * share_at8(material, table, roughness, w))


@kernel
def mean_share8(material: Table, table: I64x8, roughness: F64x8) -> F64x8:
    """`missing.mean_share`."""
    y = roughness * (ROUGHNESSES - 1.0)
    r = floor8d(vmin8d(y, splat8d(ROUGHNESSES - 2.0)))
    at = table + floor8i(gather8d(material, table)) * PLANE + floor8i(r) + 1
    return gather8d(material, at) * (1.0 - (y - r)) + gather8d(material, at + 1) * (y - r)


@kernel
def sample_spread8(roughness: F64x8, u: F64x8, v: F64x8, matte: Mask8) -> Vec3x8:
    """`missing.sample_spread`; those in `matte` choose by the cosine alone."""
    by_cosine = matte | (u < 0.5)
    turned = cosine_hemisphere8(select8d(matte, u, 2.0 * u), v)
    alpha, s = vmax8d(splat8d(SMOOTH), roughness * roughness), 2.0 * u - 1.0
    z = alpha * s / (1.0 + alpha - s)
    sine = sqrt8d(vmax8d(splat8d(0.0), 1.0 - z * z))
    cosine_around, sine_around = circle8(v)
    return select8v(by_cosine, turned, Vec3x8(sine * cosine_around, sine * sine_around, z))


@kernel
def spread_density8(roughness: F64x8, cosine: F64x8) -> F64x8:
    """`missing.spread_density`."""
    alpha = vmax8d(splat8d(SMOOTH), roughness * roughness)
    by_ratio = alpha * (1.0 + alpha) / ((cosine + alpha) * (cosine + alpha))
    return cosine * (0.5 / math.pi) + by_ratio * (0.25 / math.pi)


@kernel
def spread_over8(material: Table, table: I64x8, roughness: F64x8, light: F64x8, w: Vec3x8) -> F64x8:
    """`dielectric.spread_over`."""
    mean = mean_share8(material, table, roughness)
    spread = light * share_at8(material, table, roughness, w) * w.z / (mean * math.pi)
    return select8d(mean > 0.0, spread, splat8d(0.0))
