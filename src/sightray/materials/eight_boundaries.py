"""The rough boundaries of clear media of `dielectric`, for eight paths at once.

A thin sheet is one, too: light that passes it goes on into the mirrored lobe.
"""

from __future__ import annotations

from typing import NamedTuple

from sightray._jit import kernel
from sightray.materials.eight_facets import Facets8, Facing8, facet_density8
from sightray.materials.eight_missing import mean_share8, spread_density8, spread_over8
from sightray.mathlib.eight_paths import fresnel8, grey8, normalize8
from sightray.mathlib.eights import (
    F64x8,
    I64x8,
    Vec3x8,
    dot8,
    not8,
    select8d,
    select8i,
    select8v,
    sign8d,
    splat8d,
    sqrt8d,
    vmax8d,
    vmin8d,
)
from sightray.mathlib.lanes import Mask8, movemask8
from sightray.mathlib.table import Table


class Boundary8(NamedTuple):
    """`dielectric.Boundary` for eight paths."""

    shape: Facets8
    roughness: F64x8
    eta: F64x8
    here: I64x8  # tables, see eight_missing.py
    there: I64x8
    back: F64x8
    sheet: Mask8


class Passage8(NamedTuple):
    """What becomes of light between two directions: its value times the cosine, and the density of the choice."""

    value: F64x8
    density: F64x8


@kernel
def back8(material: Table, roughness: F64x8, eta: F64x8, here: I64x8, there: I64x8, passed: F64x8) -> F64x8:
    """Which share of the missing light comes back to the viewer's side; see `dielectric.boundary_of`."""
    mean, eta2 = mean_share8(material, here, roughness), eta * eta
    least = passed * eta2 * vmin8d(mean, mean_share8(material, there, roughness))
    return select8d(mean > 0.0, 1.0 - least / (mean * eta2), splat8d(0.0))


@kernel
def by_facet8(b: Boundary8, o: Vec3x8, m: Vec3x8, mirrors: Mask8) -> Vec3x8:
    """Where light comes from by facets; the zero vector where they say what cannot be."""
    cosine = dot8(o, m)
    mirrored = m * (2.0 * cosine) - o
    away = Vec3x8(mirrored.x, mirrored.y, -mirrored.z)
    cos_t = sqrt8d(vmax8d(splat8d(0.0), 1.0 - b.eta * b.eta * (1.0 - cosine * cosine)))
    bent = normalize8(m * (b.eta * cosine - cos_t) - o * b.eta)
    passed = select8v(b.sheet, away, bent)
    possible = ((mirrors | b.sheet) & (mirrored.z > 0.0)) | (not8(mirrors | b.sheet) & (bent.z < 0.0))
    return select8v(possible, select8v(mirrors, mirrored, passed), grey8(0.0))


@kernel
def pass_boundary8(material: Table, b: Boundary8, lost: F64x8, facing: Facing8, o: Vec3x8, i: Vec3x8) -> Passage8:
    """`dielectric.pass_boundary` and `layers.pass_sheet`; `facing` is about `o` and `i` mirrored upwards."""
    above = i.z > 0.0
    up = Vec3x8(i.x, i.y, select8d(above, i.z, -i.z))
    share = fresnel8(facing.cosine, b.eta)
    part = select8d(above, share, 1.0 - share)
    value, density = part * facing.once, (1.0 - lost) * part * facing.density
    bent = not8(above | b.sheet)
    if movemask8(bent) != 0:
        through = refracted8(b, facing, o, i)
        value = select8d(bent, through.value, value)
        density = select8d(bent, (1.0 - lost) * through.density, density)
    many = lost * select8d(above, b.back, 1.0 - b.back)
    spread = spread_over8(material, select8i(above, b.here, b.there), b.roughness, many, up)
    return Passage8(value + spread, density + many * spread_density8(b.roughness, up.z))


@kernel
def refracted8(b: Boundary8, facing: Facing8, o: Vec3x8, i: Vec3x8) -> Passage8:
    """Light that single facets refract."""
    h = -(o * b.eta) - i
    size2 = dot8(h, h)
    m = h * (sign8d(h.z) / sqrt8d(size2))
    cos_o, cos_i, zero = dot8(o, m), dot8(i, m), splat8d(0.0)
    turn = -(cos_i / ((b.eta * cos_o + cos_i) * (b.eta * cos_o + cos_i)))
    once = (1.0 - fresnel8(cos_o, b.eta)) * turn * facet_density8(b.shape, m) * cos_o / o.z
    possible = (cos_o > 0.0) & (cos_i < 0.0) & (size2 > 0.0)
    return Passage8(select8d(possible, once / facing.after, zero), select8d(possible, once / facing.before, zero))
