"""A smooth, clear dielectric: glass, water, diamond, or a bubble of air in one of them."""

from __future__ import annotations

import math
from typing import Any

from sightray._jit import implements, kernel
from sightray.fields import Color, child, color, derived_child, derived_vector
from sightray.materials.base import (
    PHONG,
    BsdfSample,
    Local,
    Material,
    Sample8,
    interior,
    local,
    sample_bsdf,
    sample_eight,
)
from sightray.materials.body import check_body, medium_inside, stain
from sightray.materials.by_wavelength import hero_alone
from sightray.materials.index import disperses, index, index_at, indices_at
from sightray.mathlib.bands import as_reflectance, hero_only
from sightray.mathlib.eight_paths import fresnel8, gather8v, grey8, refract8
from sightray.mathlib.eights import F64x8, I64x8, Vec3x8, abs8d, gather8d, select8d, select8v, splat8d
from sightray.mathlib.frame import fresnel, refract
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, table_at, vec3_at
from sightray.mathlib.vec import Vec3, grey, mean4
from sightray.textures.base import Where


class Glass(Material):
    """Divides light between mirror reflection and refraction by Fresnel's equations; nothing is lost at the surface.

    With eta = n1/n2 along the ray, Snell's law sin t = eta sin i gives the angle t behind the surface, and the share

        R = (r_s² + r_p²) / 2,  r_s = (eta cos i - cos t) / (eta cos i + cos t),
                                r_p = (cos i - eta cos t) / (cos i + eta cos t)

    goes to `mirror`, ``tint * (1 - R)`` to `transmission`. Beyond the critical angle, sin i > 1/eta, R is 1. Along a
    way of length d inside, light is weakened to ``exp(-absorption * d)`` (P. Bouguer, 1729; A. Beer, 1852), or does
    what the medium `interior` says. `ior` is relative to what surrounds the shape, so 1/1.333 is a bubble of air in
    water. Shapes must be closed.

    `ior` may name a measured glass (``"N-BK7" "N-SF10" "diamond" "water"``, see `spectra.index_names`). With RGB
    colours its index at 587.56 nm counts; in spectral mode each wavelength has its own, and a path that is refracted
    goes on with one wavelength: prisms part white light.

    References: A. Fresnel, "Mémoire sur la loi des modifications...", 1823; M. Born and E. Wolf, Principles of Optics,
    section 1.5.
    """

    ior: Any = index("refractive index inside over the one outside", default=1.5, above=0)
    absorption: Color = color("absorption coefficient of the inside", default=0.0, unit="1/m")
    tint: Color = color("factor on light that passes the surface, once per passage", default=1.0, at_most=1.0)
    interior: Any = child("the medium inside; None for a clear or absorbing one", "media", default=None, optional=True,
                          packed=False)  # fmt: skip
    _inside: Any = derived_child("the medium inside, if there is one", medium_inside)
    _stain: Any = derived_vector("its absorption as Whitted's model sees it", stain)

    @property
    def filled(self) -> bool:
        return medium_inside(self) is not None

    def check(self) -> None:
        """Refuse absorption beside a medium."""
        check_body(self)


IOR, ABSORPTION, TINT, INSIDE, STAIN = Glass.offsets()


@implements(local, Glass)
def local_of_glass(material: Table, where: Where, cos_view: f64) -> Local:
    zero = grey(0.0)
    absorption = zero
    eta = 1.0 / f64_at(material, IOR)
    if cos_view < 0.0:  # the viewer is inside, and so was the ray until here
        eta = f64_at(material, IOR)
        absorption = vec3_at(material, STAIN)
    reflected = fresnel(abs(cos_view), eta)
    tint = vec3_at(material, TINT)
    passed = tint * (1.0 - reflected)
    return Local(tint, zero, zero, zero, zero, 0.0, PHONG, grey(reflected), passed, eta, absorption)


@implements(sample_bsdf, Glass)
def sample_glass(material: Table, where: Where, wo: Vec3, u: f64, v: f64, choice: f64) -> BsdfSample:
    return sample_smooth(material, IOR, as_reflectance(where.bands, vec3_at(material, TINT)), where.bands, wo, choice)


@kernel
def sample_smooth(material: Table, ior_word: i64, tint: Vec3, bands: Table, wo: Vec3, choice: f64) -> BsdfSample:
    """Reflect with the probability R, else refract; radiance is not scaled by eta² (that cancels on the way out)."""
    ior = index_at(material, ior_word, bands)
    eta = 1.0 / ior if wo.z > 0.0 else ior
    cosine = abs(wo.z)
    shares = grey(fresnel(cosine, eta))
    odds = shares.x
    dispersed = disperses(material, ior_word, bands)
    if dispersed and not hero_alone(bands):
        shares = shares_of_lanes(indices_at(material, ior_word, bands), cosine, wo.z > 0.0)
        odds = mean4(shares)
    if choice < odds:
        return BsdfSample(Vec3(-wo.x, -wo.y, wo.z), shares / odds, 0.0)
    facing = Vec3(0.0, 0.0, math.copysign(1.0, wo.z))
    weight = tint
    if dispersed:
        weight = tint * hero_only(bands) * ((1.0 - shares.x) / (1.0 - odds))
    return BsdfSample(refract(-wo, facing, eta), weight, 0.0)


@kernel
def shares_of_lanes(ior: Vec3, cosine: f64, outside: bool) -> Vec3:
    """The share of light that is reflected, for an index in each lane."""
    eta = 1.0 / ior if outside else ior
    return Vec3(
        fresnel(cosine, eta.x), fresnel(cosine, eta.y), fresnel(cosine, eta.z), fresnel(cosine, eta.w)
    )  # fmt: skip


@implements(sample_eight, Glass)
def sample_glass_eight(material: Table, rows: I64x8, wo: Vec3x8, u: F64x8, v: F64x8, choice: F64x8) -> Sample8:
    return sample_smooth8(gather8d(material, rows + IOR), gather8v(material, rows + TINT), wo, choice)


@kernel
def sample_smooth8(ior: F64x8, tint: Vec3x8, wo: Vec3x8, choice: F64x8) -> Sample8:
    """`sample_smooth` for eight paths."""
    eta = select8d(wo.z > 0.0, 1.0 / ior, ior)
    mirrored = choice < fresnel8(abs8d(wo.z), eta)
    wi = select8v(mirrored, Vec3x8(-wo.x, -wo.y, wo.z), refract8(wo, eta))
    return Sample8(wi, select8v(mirrored, grey8(1.0), tint), splat8d(0.0))


@implements(interior, Glass)
def interior_of_glass(material: Table) -> Table:
    return table_at(material, INSIDE)
