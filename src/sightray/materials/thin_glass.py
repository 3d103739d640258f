"""A pane of glass whose thickness does not matter: windows, bubbles of soap without their colours."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import implements, kernel
from sightray.fields import Color, color, derived_vector, number
from sightray.materials.base import PHONG, BsdfSample, Local, Material, Sample8, local, sample_bsdf, sample_eight
from sightray.mathlib.bands import as_reflectance, ones
from sightray.mathlib.eight_functions import exp8
from sightray.mathlib.eight_paths import brightest8, gather8v, plus8, quotient8
from sightray.mathlib.eights import (
    F64x8,
    I64x8,
    Vec3x8,
    abs8d,
    gather8d,
    select8v,
    splat8d,
    sqrt8d,
    vmax8d,
    vmin8d,
)
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, vec3_at
from sightray.mathlib.vec import Vec3, grey, max4, vexp
from sightray.textures.base import Where

DARKEST = 1e-30  # what a tint of 0 lets through
MOST = 1.0 - 1e-9  # that one face reflects: along the pane the series would never end


class ThinGlass(Material):
    """Lets light straight on and mirrors a part of it: both faces of a pane, with all reflections between them.

    One face reflects R, by Fresnel's equations for each of the two polarisations, and a passage between the faces
    leaves the share a. The sums over all ways in and out are geometric series:

        reflected R + (1 - R)² a² R / (1 - a² R²),    passed (1 - R)² a / (1 - a² R²)

    which for a clear pane are 2 R / (1 + R) and the rest. `tint` is a for light that falls straight in; aslant the way
    is longer and a = tint^(1 / cos t), with t the angle inside. It needs no closed shape: a rectangle is a window.

    Reference: M. Born and E. Wolf, Principles of Optics, section 7.6, without interference.
    """

    ior: float = number("refractive index of the pane over the one around it", default=1.5, at_least=1)
    tint: Color = color("share of light that one passage through the pane leaves", default=1.0, at_most=1.0)
    _log_tint: Any = derived_vector("its logarithm", lambda g: np.log(np.maximum(g.tint, DARKEST)))

    @property
    def thin(self) -> bool:
        return True


IOR, TINT, LOG_TINT = ThinGlass.offsets()


@kernel
def passage(material: Table, bands: Table, cos_t: f64) -> Vec3:
    """The share a of light that one passage leaves, for the angle inside."""
    return as_reflectance(bands, vexp(vec3_at(material, LOG_TINT) / cos_t) * Vec3(1.0, 1.0, 1.0, 0.0))


@kernel
def both_faces(share: f64, a: Vec3) -> Vec3:
    """The light that a pane reflects, for one polarisation of which one face reflects `share`."""
    passes = (1.0 - share) * (1.0 - share)
    return share + passes * a * a * share / (1.0 - a * a * (share * share))


@kernel
def through(share: f64, a: Vec3) -> Vec3:
    """The light that a pane lets through, for that polarisation."""
    return (1.0 - share) * (1.0 - share) * a / (1.0 - a * a * (share * share))


@kernel
def polarised(cos_i: f64, ior: f64) -> Vec3:
    """What one face reflects of light that swings across and in the plane of incidence, and the cosine inside."""
    cos_t = math.sqrt(1.0 - max(0.0, 1.0 - cos_i * cos_i) / (ior * ior))
    r_s, r_p = (cos_i - ior * cos_t) / (cos_i + ior * cos_t), (ior * cos_i - cos_t) / (ior * cos_i + cos_t)
    return Vec3(min(MOST, r_s * r_s), min(MOST, r_p * r_p), cos_t)


@kernel
def pane(material: Table, bands: Table, cosine: f64) -> tuple[Vec3, Vec3]:
    """The shares of light that are reflected and let through."""
    face = polarised(max(cosine, 1e-9), f64_at(material, IOR))
    a = passage(material, bands, max(face.z, 1e-9))
    back = (both_faces(face.x, a) + both_faces(face.y, a)) * 0.5
    on = (through(face.x, a) + through(face.y, a)) * 0.5
    return back * ones(bands), on


@implements(sample_bsdf, ThinGlass)
def sample_thin_glass(material: Table, where: Where, wo: Vec3, u: f64, v: f64, choice: f64) -> BsdfSample:
    back, on = pane(material, where.bands, abs(wo.z))
    odds = max4(back) / (max4(back) + max4(on))
    if choice < odds:
        return BsdfSample(Vec3(-wo.x, -wo.y, wo.z), back / odds, 0.0)
    return BsdfSample(-wo, on / (1.0 - odds), 0.0)


@implements(local, ThinGlass)
def local_of_thin_glass(material: Table, where: Where, cos_view: f64) -> Local:
    zero = grey(0.0)
    back, on = pane(material, where.bands, abs(cos_view))
    return Local(on, zero, zero, zero, zero, 0.0, PHONG, back, on, 1.0, zero)


# ---------------------------------------------------------------------------------------------------- for eight paths


@kernel
def ways8(share: F64x8, a: Vec3x8) -> tuple[Vec3x8, Vec3x8]:
    """`both_faces` and `through` for eight paths."""
    passed = quotient8(a * ((1.0 - share) * (1.0 - share)), plus8(-(a * a * (share * share)), splat8d(1.0)))
    return plus8(passed * a * share, share), passed


@implements(sample_eight, ThinGlass)
def sample_thin_glass_eight(material: Table, rows: I64x8, wo: Vec3x8, u: F64x8, v: F64x8, choice: F64x8) -> Sample8:
    ior, cos_i, most = gather8d(material, rows + IOR), vmax8d(abs8d(wo.z), splat8d(1e-9)), splat8d(MOST)
    cos_t = sqrt8d(1.0 - vmax8d(splat8d(0.0), 1.0 - cos_i * cos_i) / (ior * ior))
    r_s, r_p = (cos_i - ior * cos_t) / (cos_i + ior * cos_t), (ior * cos_i - cos_t) / (ior * cos_i + cos_t)
    longer = gather8v(material, rows + LOG_TINT) * (1.0 / vmax8d(cos_t, splat8d(1e-9)))
    a = Vec3x8(exp8(longer.x), exp8(longer.y), exp8(longer.z))
    back_s, on_s = ways8(vmin8d(r_s * r_s, most), a)
    back_p, on_p = ways8(vmin8d(r_p * r_p, most), a)
    back, on = (back_s + back_p) * 0.5, (on_s + on_p) * 0.5
    odds = brightest8(back) / (brightest8(back) + brightest8(on))
    mirrored = choice < odds
    return Sample8(
        select8v(mirrored, Vec3x8(-wo.x, -wo.y, wo.z), -wo),
        select8v(mirrored, back * (1.0 / odds), on * (1.0 / (1.0 - odds))), splat8d(0.0),
    )  # fmt: skip
