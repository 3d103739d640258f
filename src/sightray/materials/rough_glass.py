"""Frosted, ground or etched glass."""

from __future__ import annotations

from typing import Any

from sightray._jit import implements, kernel
from sightray.fields import Color, child, choice, color, derived_array, derived_child, derived_number, derived_vector
from sightray.materials.base import (
    BsdfSample,
    BsdfValue,
    Local,
    Material,
    Sample8,
    Value8,
    bsdf,
    bsdf_eight,
    interior,
    local,
    sample_bsdf,
    sample_eight,
)
from sightray.materials.body import check_body, medium_inside, stain
from sightray.materials.by_wavelength import hero_share
from sightray.materials.data import data, share8_of, share_of
from sightray.materials.dielectric import Boundary, boundary_of, pass_boundary, sample_boundary
from sightray.materials.eight_boundaries import Boundary8, back8, by_facet8, pass_boundary8
from sightray.materials.eight_facets import facets8, facing8, sample_facet8, upward8
from sightray.materials.eight_missing import sample_spread8, share_at8, tables8
from sightray.materials.energy import SMOOTH, missing_of_glass, passing
from sightray.materials.glass import sample_smooth, sample_smooth8, shares_of_lanes
from sightray.materials.gloss import glossy, softened
from sightray.materials.index import disperses, index, index_at, indices_at, nominal
from sightray.materials.microfacet import BECKMANN, DISTRIBUTIONS, facets, is_smooth
from sightray.mathlib.bands import as_reflectance, hero_only, ones
from sightray.mathlib.eight_paths import fresnel8, gather8v, grey8
from sightray.mathlib.eights import (
    F64x8,
    I64x8,
    Vec3x8,
    abs8d,
    dot8,
    gather8d,
    gather8i,
    mask8,
    not8,
    select8d,
    select8i,
    select8v,
    splat8d,
)
from sightray.mathlib.frame import fresnel
from sightray.mathlib.lanes import Mask8, movemask8
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, i64_at, table_at, vec3_at
from sightray.mathlib.vec import Vec3, dot, grey, normalize
from sightray.textures.base import Where


class RoughGlass(Material):
    """Glass whose surface is made of facets: it reflects and refracts light into lobes, wider the rougher it is.

    Facets are those of `microfacet.py` with alpha = roughness², and each divides light as `Glass` does (B. Walter and
    others, EGSR 2007). What one bounce between them loses is given back (`dielectric.py`), so that glass without
    absorption loses nothing at any roughness. Radiance is not scaled by the square of the index on the way in and out,
    as in `Glass`. At `roughness` 0 it is `Glass`. Shapes must be closed.

    In spectral mode a named glass parts colours: what is refracted has one wavelength.
    """

    ior: Any = index("refractive index inside over the one outside", default=1.5, above=0)
    roughness: Any = data("perceived roughness, 0 to 1", default=0.3)
    absorption: Color = color("absorption coefficient of the inside", default=0.0, unit="1/m")
    tint: Color = color("factor on light that passes the surface, once per passage", default=1.0, at_most=1.0)
    interior: Any = child("the medium inside; None for a clear or absorbing one", "media", default=None, optional=True,
                          packed=False)  # fmt: skip
    distribution: str = choice("distribution of the facets", DISTRIBUTIONS, default="ggx")
    _inside: Any = derived_child("the medium inside, if there is one", medium_inside)
    _stain: Any = derived_vector("its absorption as Whitted's model sees it", stain)
    _missing_outside: Any = derived_array("energy that single bounces lose, seen from outside", lambda g: g.missing(
        1.0 / nominal(g.ior)))  # fmt: skip
    _missing_inside: Any = derived_array("the same from inside", lambda g: g.missing(nominal(g.ior)))
    _enters: Any = derived_number("share of light from all sides that enters",
                                  lambda g: passing(nominal(g.ior))[0])  # fmt: skip
    _leaves: Any = derived_number("and that leaves", lambda g: passing(nominal(g.ior))[1])

    @property
    def translucent(self) -> bool:
        return True

    @property
    def filled(self) -> bool:
        return medium_inside(self) is not None

    def check(self) -> None:
        """Refuse absorption beside a medium."""
        check_body(self)

    def missing(self, eta: float) -> Any:
        """The table of energy.py for one side."""
        return missing_of_glass(DISTRIBUTIONS.index(self.distribution), eta)


(
    IOR, ROUGHNESS, ABSORPTION, TINT, DISTRIBUTION, INSIDE, STAIN, MISSING_OUTSIDE, MISSING_INSIDE, ENTERS, LEAVES,
) = RoughGlass.offsets()  # fmt: skip
CLOSE_TO_ONE = 1e-6  # an index so close to 1 bends nothing


@kernel
def bends_nothing(material: Table, roughness: f64) -> bool:
    """Whether the boundary is smooth, or none."""
    return is_smooth(roughness) or abs(f64_at(material, IOR) - 1.0) < CLOSE_TO_ONE


@kernel
def boundary_seen(material: Table, bands: Table, roughness: f64, outside: bool) -> Boundary:
    """The boundary from the viewer's side."""
    ior = index_at(material, IOR, bands)
    shape = facets(i64_at(material, DISTRIBUTION), roughness, 0.0)
    out, within = table_at(material, MISSING_OUTSIDE), table_at(material, MISSING_INSIDE)
    if outside:
        return boundary_of(shape, roughness, 1.0 / ior, out, within, f64_at(material, ENTERS))
    return boundary_of(shape, roughness, ior, within, out, f64_at(material, LEAVES))


@implements(sample_bsdf, RoughGlass)
def sample_rough_glass(material: Table, where: Where, wo: Vec3, u: f64, v: f64, choice: f64) -> BsdfSample:
    roughness = share_of(table_at(material, ROUGHNESS), where)
    if bends_nothing(material, roughness):
        return sample_smooth(
            material, IOR, as_reflectance(where.bands, vec3_at(material, TINT)), where.bands, wo, choice
        )
    side = 1.0 if wo.z > 0.0 else -1.0
    boundary = boundary_seen(material, where.bands, roughness, wo.z > 0.0)
    i = sample_boundary(boundary, Vec3(wo.x, wo.y, wo.z * side), u, v, choice)
    if i.z == 0.0:
        return BsdfSample(wo, grey(0.0), 0.0)
    wi = Vec3(i.x, i.y, i.z * side)
    found = bsdf_of_rough_glass(material, where, wo, wi)
    if not found.density > 0.0:  # seen exactly along the surface
        return BsdfSample(wo, grey(0.0), 0.0)
    if i.z < 0.0 and disperses(material, IOR, where.bands):
        hero_only(where.bands)
    return BsdfSample(wi, found.value / found.density, found.density)


@implements(bsdf, RoughGlass)
def bsdf_of_rough_glass(material: Table, where: Where, wo: Vec3, wi: Vec3) -> BsdfValue:
    bands, roughness = where.bands, share_of(table_at(material, ROUGHNESS), where)
    if bends_nothing(material, roughness) or wo.z == 0.0 or wi.z == 0.0:
        return BsdfValue(grey(0.0), 0.0)
    side = 1.0 if wo.z > 0.0 else -1.0
    boundary = boundary_seen(material, bands, roughness, wo.z > 0.0)
    o, i = Vec3(wo.x, wo.y, wo.z * side), Vec3(wi.x, wi.y, wi.z * side)
    passage = pass_boundary(boundary, o, i)
    dispersed = disperses(material, IOR, bands)
    if i.z < 0.0:
        tint = as_reflectance(bands, vec3_at(material, TINT))
        if dispersed:
            tint = tint * hero_share(bands)
        return BsdfValue(tint * (passage.refracted + passage.spread), passage.density)
    shares = grey(passage.share)
    if dispersed:
        shares = shares_of_lanes(indices_at(material, IOR, bands), dot(o, normalize(o + i)), wo.z > 0.0)
    return BsdfValue((shares * passage.facet + passage.spread) * ones(bands), passage.density)


@implements(local, RoughGlass)
def local_of_rough_glass(material: Table, where: Where, cos_view: f64) -> Local:
    zero, tint = grey(0.0), vec3_at(material, TINT)
    roughness = share_of(table_at(material, ROUGHNESS), where)
    ior = f64_at(material, IOR)
    eta = ior if cos_view < 0.0 else 1.0 / ior
    alpha = roughness * roughness
    share = fresnel(softened(cos_view, alpha), eta)
    absorption = vec3_at(material, STAIN) if cos_view < 0.0 else zero
    return glossy(tint, zero, zero, grey(share), tint * (1.0 - share), alpha, eta, absorption)


@implements(interior, RoughGlass)
def interior_of_rough_glass(material: Table) -> Table:
    return table_at(material, INSIDE)


# ---------------------------------------------------------------------------------------------------- for eight paths


@kernel
def bends_nothing8(material: Table, rows: I64x8, roughness: F64x8) -> Mask8:
    """`bends_nothing` for eight paths."""
    return (roughness * roughness <= SMOOTH) | (abs8d(gather8d(material, rows + IOR) - 1.0) < CLOSE_TO_ONE)


@kernel
def boundary8_seen(material: Table, rows: I64x8, roughness: F64x8, outside: Mask8) -> Boundary8:
    """`boundary_seen` for eight paths."""
    beckmann, ior = gather8i(material, rows + DISTRIBUTION) == BECKMANN, gather8d(material, rows + IOR)
    shape, eta = facets8(movemask8(beckmann), roughness, splat8d(0.0)), select8d(outside, 1.0 / ior, ior)
    out, within = tables8(material, rows, MISSING_OUTSIDE), tables8(material, rows, MISSING_INSIDE)
    here, there = select8i(outside, out, within), select8i(outside, within, out)
    passed = select8d(outside, gather8d(material, rows + ENTERS), gather8d(material, rows + LEAVES))
    back = back8(material, roughness, eta, here, there, passed)
    return Boundary8(shape, roughness, eta, here, there, back, mask8(0))


@kernel
def passed8(material: Table, rows: I64x8, b: Boundary8, lost: F64x8, o: Vec3x8, i: Vec3x8) -> Value8:
    """`bsdf` of a rough boundary, on the viewer's side where z > 0."""
    passage = pass_boundary8(material, b, lost, facing8(b.shape, o, upward8(i)), o, i)
    colour = select8v(i.z > 0.0, grey8(1.0), gather8v(material, rows + TINT))
    return Value8(colour * passage.value, passage.density)


@implements(sample_eight, RoughGlass)
def sample_rough_glass_eight(
    material: Table, rows: I64x8, wo: Vec3x8, u: F64x8, v: F64x8, choice: F64x8
) -> Sample8:  # fmt: skip
    roughness, outside = share8_of(material, rows, ROUGHNESS), wo.z > 0.0
    smooth, found = bends_nothing8(material, rows, roughness), Sample8(wo, grey8(0.0), splat8d(0.0))
    if movemask8(smooth) != 0:
        found = sample_smooth8(gather8d(material, rows + IOR), gather8v(material, rows + TINT), wo, choice)
    if movemask8(not8(smooth)) == 0:
        return found
    side, b = select8d(outside, splat8d(1.0), splat8d(-1.0)), boundary8_seen(material, rows, roughness, outside)
    o = Vec3x8(wo.x, wo.y, wo.z * side)
    lost = share_at8(material, b.here, roughness, o)
    m, spread = sample_facet8(b.shape, o, u, v), choice < lost
    i = by_facet8(b, o, m, choice - lost < (1.0 - lost) * fresnel8(dot8(o, m), b.eta))
    if movemask8(spread) != 0:
        many = sample_spread8(roughness, u, v, smooth)
        up = choice < lost * b.back
        i = select8v(spread, Vec3x8(many.x, many.y, select8d(up, many.z, -many.z)), i)
    answer = passed8(material, rows, b, lost, o, i)
    possible = (abs8d(i.z) > 0.0) & (answer.density > 0.0)
    wi = select8v(possible, Vec3x8(i.x, i.y, i.z * side), wo)
    weight = select8v(possible, answer.value * (1.0 / answer.density), grey8(0.0))
    density = select8d(possible, answer.density, splat8d(0.0))
    return Sample8(
        select8v(smooth, found.wi, wi), select8v(smooth, found.weight, weight), select8d(smooth, found.density, density)
    )  # fmt: skip


@implements(bsdf_eight, RoughGlass)
def bsdf_of_rough_glass_eight(material: Table, rows: I64x8, wo: Vec3x8, wi: Vec3x8) -> Value8:
    roughness, outside = share8_of(material, rows, ROUGHNESS), wo.z > 0.0
    there = not8(bends_nothing8(material, rows, roughness)) & (abs8d(wo.z) > 0.0) & (abs8d(wi.z) > 0.0)
    none = Value8(grey8(0.0), splat8d(0.0))
    if movemask8(there) == 0:
        return none
    side, b = select8d(outside, splat8d(1.0), splat8d(-1.0)), boundary8_seen(material, rows, roughness, outside)
    o, i = Vec3x8(wo.x, wo.y, wo.z * side), Vec3x8(wi.x, wi.y, wi.z * side)
    found = passed8(material, rows, b, share_at8(material, b.here, roughness, o), o, i)
    return Value8(select8v(there, found.value, none.value), select8d(there, found.density, none.density))
