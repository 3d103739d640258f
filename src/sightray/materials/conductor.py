"""Metals by their measured refractive indices, polished or rough."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import implements, kernel
from sightray.errors import SceneError
from sightray.fields import choice, derived_array, derived_vector, number, other
from sightray.materials.base import (
    BsdfSample,
    BsdfValue,
    Local,
    Material,
    Sample8,
    Value8,
    bsdf,
    bsdf_eight,
    local,
    sample_bsdf,
    sample_eight,
)  # fmt: skip
from sightray.materials.by_wavelength import at_bands
from sightray.materials.data import data, share8_of, share_of
from sightray.materials.eight_facets import Facets8, facets8, facing8, sample_facet8, upward8
from sightray.materials.eight_missing import mean_share8, sample_spread8, share_at8, spread_density8, tables8
from sightray.materials.energy import SMOOTH, missing_of_mirrors
from sightray.materials.gloss import glossy, softened
from sightray.materials.metal import fresnel_colours8, fresnel_lanes, mean_reflectance
from sightray.materials.microfacet import (
    BECKMANN,
    DISTRIBUTIONS,
    Facets,
    facet_density,
    facets,
    is_smooth,
    sample_facet,
    seen_from_both,
    upward,
    visible_density,
)
from sightray.materials.missing import mean_share, sample_spread, share_at, spread_density
from sightray.mathlib.bands import as_reflectance
from sightray.mathlib.eight_paths import gather8v, grey8, plus8, quotient8
from sightray.mathlib.eights import (
    F64x8,
    I64x8,
    Vec3x8,
    abs8d,
    dot8,
    gather8d,
    gather8i,
    not8,
    select8d,
    select8v,
    sign8d,
    splat8d,
)
from sightray.mathlib.lanes import movemask8
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, i64_at, is_null, table_at, vec3_at
from sightray.mathlib.vec import Vec3, dot, grey, normalize
from sightray.spectra import WAVELENGTHS, ComplexIndex, complex_index
from sightray.textures.base import Where


def _metal(value: Any) -> Any:
    """A metal's name, an index of one's own, or None."""
    if isinstance(value, str):
        complex_index(value)
    elif value is not None and not isinstance(value, ComplexIndex):
        raise SceneError(f"got {value!r:.60}; allowed: the name of a metal such as 'Au', a ComplexIndex, or None")
    return value


def _three(value: Any) -> tuple[float, float, float] | None:
    """Three numbers of at least 0, or one for all three, or None."""
    if value is None:
        return None
    try:
        r, g, b = np.broadcast_to(np.asarray(value, dtype=np.float64), 3).tolist()
    except (TypeError, ValueError):
        r = g = b = math.nan
    if not (all(map(math.isfinite, (r, g, b))) and min(r, g, b) >= 0):
        raise SceneError(f"got {value!r:.60}; allowed: three finite numbers of at least 0, or one for all, or None")
    return r, g, b


class Conductor(Material):
    """A metal: it reflects by Fresnel's equations with its complex refractive index, eta + i k, and lets nothing in.

    `metal` names a measured one (``"Au" "Ag" "Cu" "Al"`` and others, see `spectra.metal_names`); or `eta` and `k` state
    the index for red, green and blue. With RGB colours a measured metal has one index per channel, chosen such that its
    colour is right head-on; spectral paths use the measured values at their wavelengths.

    At `roughness` 0 it is a mirror. Else its surface is made of facets (`microfacet.py`), with alpha = roughness², and
    what they reflect into one another comes back as in C. Kulla, A. Conty, "Revisiting physically based shading at
    Imageworks" (SIGGRAPH 2017 course): a metal that reflects everything loses nothing at any roughness. `anisotropy`
    above 0 is metal that was brushed across the direction of u: its highlights are long along u. It is the same from
    both sides.
    """

    metal: Any = other("name of a measured metal, or a ComplexIndex", _metal, default=None)
    eta: Any = other("real part of the refractive index", _three, default=None, plain=lambda v: v and list(v))
    k: Any = other("its imaginary part", _three, default=None, plain=lambda v: v and list(v))
    roughness: Any = data("perceived roughness, 0 to 1", default=0.0)
    anisotropy: float = number("how much the roughness depends on the direction", default=0.0, at_least=-1, at_most=1)
    distribution: str = choice("distribution of the facets", DISTRIBUTIONS, default="ggx")
    _n: Any = derived_vector("n of red, green and blue", lambda c: c.rgb()[0])
    _k: Any = derived_vector("k of red, green and blue", lambda c: c.rgb()[1])
    _mean: Any = derived_vector("reflectance of light from all sides", lambda c: mean_reflectance(*c.rgb()))
    _spectrum: Any = derived_array("n, k and mean reflectance by wavelength", lambda c: c.by_wavelength())
    _missing: Any = derived_array("energy that single reflections lose", lambda c: missing_of_mirrors(
        DISTRIBUTIONS.index(c.distribution), c.anisotropy))  # fmt: skip

    def check(self) -> None:
        """Fill in gold where nothing is stated; refuse an index that is stated twice or by half."""
        if (self.eta is None) != (self.k is None):
            missing = "k" if self.k is None else "eta"
            raise SceneError(f"Conductor.{missing}: missing; eta and k are stated together, or neither")
        if self.metal is not None and self.eta is not None:
            raise SceneError("Conductor.metal: stated beside eta and k; allowed: one of the two")
        if self.eta is None and self.metal is None:
            object.__setattr__(self, "metal", "Au")

    @property
    def oriented(self) -> bool:
        return self.anisotropy != 0

    def rgb(self) -> tuple[Any, Any]:
        """n and k of red, green and blue, three numbers each."""
        return (self.eta, self.k) if self.metal is None else self._index().rgb()

    def by_wavelength(self) -> np.ndarray | None:
        """(471, 3) float: n, k and the mean reflectance; None where only colours are known."""
        if self.metal is None:
            return None
        n, k = self._index().n.at(WAVELENGTHS), self._index().k.at(WAVELENGTHS)
        return np.ascontiguousarray(np.stack([n, k, mean_reflectance(n, k)], axis=1))

    def _index(self) -> ComplexIndex:
        return self.metal if isinstance(self.metal, ComplexIndex) else complex_index(self.metal)


ROUGHNESS, ANISOTROPY, DISTRIBUTION, N, K, MEAN, SPECTRUM, MISSING = Conductor.offsets()
COLUMNS, COLUMN_N, COLUMN_K, COLUMN_MEAN = 3, 0, 1, 2


@kernel
def reflectance(material: Table, bands: Table, cosine: f64) -> Vec3:
    """Fresnel's share in the path's lanes."""
    if is_null(bands):
        return fresnel_lanes(cosine, vec3_at(material, N), vec3_at(material, K))
    table = table_at(material, SPECTRUM)
    if is_null(table):
        n, k = as_reflectance(bands, vec3_at(material, N)), as_reflectance(bands, vec3_at(material, K))
        return fresnel_lanes(cosine, n, k)
    return fresnel_lanes(
        cosine, at_bands(table, COLUMNS, COLUMN_N, bands), at_bands(table, COLUMNS, COLUMN_K, bands)
    )  # fmt: skip


@kernel
def mean_of_lanes(material: Table, bands: Table) -> Vec3:
    """The reflectance of light from all sides in the path's lanes."""
    table = table_at(material, SPECTRUM)
    if is_null(bands) or is_null(table):
        return as_reflectance(bands, vec3_at(material, MEAN))
    return at_bands(table, COLUMNS, COLUMN_MEAN, bands)


@kernel
def facets_of(material: Table, roughness: f64) -> Facets:
    return facets(i64_at(material, DISTRIBUTION), roughness, f64_at(material, ANISOTROPY))


@implements(sample_bsdf, Conductor)
def sample_conductor(material: Table, where: Where, wo: Vec3, u: f64, v: f64, choice: f64) -> BsdfSample:
    roughness = share_of(table_at(material, ROUGHNESS), where)
    if is_smooth(roughness):
        mirrored = Vec3(-wo.x, -wo.y, wo.z)
        return BsdfSample(mirrored, reflectance(material, where.bands, abs(wo.z)), 0.0)

    # Reflect once, or as often as light does that single reflections lose.
    o = upward(wo)
    if choice < share_at(table_at(material, MISSING), roughness, o):
        wi = sample_spread(roughness, u, v)
    else:
        m = sample_facet(facets_of(material, roughness), o, u, v)
        wi = m * (2.0 * dot(o, m)) - o
        if wi.z <= 0.0:
            return BsdfSample(wo, grey(0.0), 0.0)
    wi = wi if wo.z > 0.0 else Vec3(wi.x, wi.y, -wi.z)
    found = bsdf_of_conductor(material, where, wo, wi)
    if not found.density > 0.0:  # seen exactly along the surface
        return BsdfSample(wo, grey(0.0), 0.0)
    return BsdfSample(wi, found.value / found.density, found.density)


@implements(bsdf, Conductor)
def bsdf_of_conductor(material: Table, where: Where, wo: Vec3, wi: Vec3) -> BsdfValue:
    roughness = share_of(table_at(material, ROUGHNESS), where)
    if wo.z * wi.z <= 0.0 or is_smooth(roughness):
        return BsdfValue(grey(0.0), 0.0)
    o, i = upward(wo), upward(wi)
    shape, table = facets_of(material, roughness), table_at(material, MISSING)

    # Light that one facet reflects.
    m = normalize(o + i)
    cosine = dot(o, m)
    once = facet_density(shape, m) * seen_from_both(shape, o, i) / (4.0 * o.z)
    value = reflectance(material, where.bands, cosine) * once
    density = visible_density(shape, o, m) / (4.0 * cosine)

    # Light that goes from facet to facet: each time the metal takes its part.
    lost, mean = share_at(table, roughness, o), mean_share(table, roughness)
    if mean > 0.0:
        f = mean_of_lanes(material, where.bands)
        colour = f * f * (1.0 - mean) / (1.0 - f * mean)
        value += colour * (lost * share_at(table, roughness, i) / (math.pi * mean) * i.z)
    return BsdfValue(value, (1.0 - lost) * density + lost * spread_density(roughness, i.z))


@implements(local, Conductor)
def local_of_conductor(material: Table, where: Where, cos_view: f64) -> Local:
    zero = grey(0.0)
    roughness = share_of(table_at(material, ROUGHNESS), where)
    alpha = roughness * roughness
    seen = reflectance(material, where.bands, softened(cos_view, alpha))
    color = reflectance(material, where.bands, 1.0)
    return glossy(color, zero, zero, seen, zero, alpha, 1.0, zero)


# ---------------------------------------------------------------------------------------------------- for eight paths


@kernel
def reflectance8(material: Table, rows: I64x8, cosine: F64x8) -> Vec3x8:
    """`reflectance` for eight paths."""
    return fresnel_colours8(cosine, gather8v(material, rows + N), gather8v(material, rows + K))


@kernel
def facets8_of(material: Table, rows: I64x8, roughness: F64x8) -> Facets8:
    """`facets_of` for eight paths."""
    beckmann = movemask8(gather8i(material, rows + DISTRIBUTION) == BECKMANN)
    return facets8(beckmann, roughness, gather8d(material, rows + ANISOTROPY))


@kernel
def reflected8(
    material: Table, rows: I64x8, roughness: F64x8, shape: Facets8, lost: F64x8, o: Vec3x8, i: Vec3x8
) -> Value8:
    """`bsdf` of rough metal, between directions above it."""
    facing, table = facing8(shape, o, i), tables8(material, rows, MISSING)
    mean, f = mean_share8(material, table, roughness), gather8v(material, rows + MEAN)
    colour = quotient8(f * f * (1.0 - mean), plus8(-(f * mean), splat8d(1.0)))
    spread = lost * share_at8(material, table, roughness, i) * i.z / (mean * math.pi)
    once = reflectance8(material, rows, facing.cosine) * facing.once
    value = select8v(mean > 0.0, once + colour * spread, once)
    return Value8(value, (1.0 - lost) * facing.density + lost * spread_density8(roughness, i.z))


@implements(sample_eight, Conductor)
def sample_conductor_eight(material: Table, rows: I64x8, wo: Vec3x8, u: F64x8, v: F64x8, choice: F64x8) -> Sample8:
    roughness, mirrored = share8_of(material, rows, ROUGHNESS), Vec3x8(-wo.x, -wo.y, wo.z)
    smooth = roughness * roughness <= SMOOTH
    found = Sample8(mirrored, grey8(0.0), splat8d(0.0))
    if movemask8(smooth) != 0:
        found = Sample8(mirrored, reflectance8(material, rows, abs8d(wo.z)), splat8d(0.0))
    if movemask8(not8(smooth)) == 0:
        return found

    # Reflect once, or as often as light does that single reflections lose.
    o, shape = upward8(wo), facets8_of(material, rows, roughness)
    lost = share_at8(material, tables8(material, rows, MISSING), roughness, o)
    many = choice < lost
    m = sample_facet8(shape, o, u, v)
    i = m * (2.0 * dot8(o, m)) - o
    if movemask8(many) != 0:
        i = select8v(many, sample_spread8(roughness, u, v, smooth), i)
    answer = reflected8(material, rows, roughness, shape, lost, o, i)
    possible = (i.z > 0.0) & (answer.density > 0.0)
    wi = select8v(possible, Vec3x8(i.x, i.y, i.z * sign8d(wo.z)), wo)
    weight = select8v(possible, answer.value * (1.0 / answer.density), grey8(0.0))
    density = select8d(possible, answer.density, splat8d(0.0))
    return Sample8(
        select8v(smooth, found.wi, wi), select8v(smooth, found.weight, weight), select8d(smooth, found.density, density)
    )  # fmt: skip


@implements(bsdf_eight, Conductor)
def bsdf_of_conductor_eight(material: Table, rows: I64x8, wo: Vec3x8, wi: Vec3x8) -> Value8:
    roughness = share8_of(material, rows, ROUGHNESS)
    there, none = (wo.z * wi.z > 0.0) & (roughness * roughness > SMOOTH), Value8(grey8(0.0), splat8d(0.0))
    if movemask8(there) == 0:
        return none
    o, shape = upward8(wo), facets8_of(material, rows, roughness)
    lost = share_at8(material, tables8(material, rows, MISSING), roughness, o)
    found = reflected8(material, rows, roughness, shape, lost, o, upward8(wi))
    return Value8(select8v(there, found.value, none.value), select8d(there, found.density, none.density))
