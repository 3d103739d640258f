"""Frosted, ground or etched glass."""

from __future__ import annotations

from typing import Any

from sightray._jit import implements, kernel
from sightray.fields import Color, child, choice, color, derived_array, derived_child, derived_number, derived_vector
from sightray.materials.base import BsdfSample, BsdfValue, Local, Material, bsdf, interior, local, sample_bsdf
from sightray.materials.body import check_body, medium_inside, stain
from sightray.materials.by_wavelength import hero_share
from sightray.materials.data import data, share_of
from sightray.materials.dielectric import Boundary, boundary_of, pass_boundary, sample_boundary
from sightray.materials.energy import missing_of_glass, passing
from sightray.materials.glass import sample_smooth, shares_of_lanes
from sightray.materials.gloss import glossy, softened
from sightray.materials.index import disperses, index, index_at, indices_at, nominal
from sightray.materials.microfacet import DISTRIBUTIONS, facets, is_smooth
from sightray.mathlib.bands import as_reflectance, hero_only, ones
from sightray.mathlib.frame import fresnel
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
