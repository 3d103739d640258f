"""The classic plastic: ambient, diffuse, highlight, and a mirror on top."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from sightray._jit import implements, kernel
from sightray.fields import Color, choice, color, number
from sightray.materials.base import (
    BsdfSample,
    BsdfValue,
    Local,
    Material,
    Sample8,
    Value8,
    bsdf,
    bsdf_eight,
    emitted,
    local,
    sample_bsdf,
    sample_eight,
)
from sightray.mathlib.eight_functions import circle8, pow8
from sightray.mathlib.eight_paths import brightest8, cosine_hemisphere8, frame_about8, grey8, out_of8
from sightray.mathlib.eights import (
    F64x8,
    I64x8,
    Vec3x8,
    abs8d,
    dot8,
    gather8d,
    not8,
    select8d,
    select8v,
    splat8d,
    sqrt8d,
    vmax8d,
)
from sightray.mathlib.frame import perpendicular
from sightray.mathlib.lanes import movemask8
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, i64_at, table_at, vec3_at
from sightray.mathlib.vec import Vec3, cross, dot, grey, max4
from sightray.mathlib.warp import cosine_hemisphere, power_cosine
from sightray.textures.base import Where, constant8, textured, value_at
from sightray.textures.constant import COLOR

HIGHLIGHTS = ("phong", "blinn")  # at the indices PHONG and BLINN of the contract, because kernels see the index


class Phong(Material):
    """Colours of classic computer graphics, which are not normalised: `diffuse` multiplies irradiance itself.

    A light that brings irradiance L from direction l shows as

        L * (diffuse * max(n.l, 0) + specular * max(cos a, 0)^shininess)

    with a the angle between the viewer and the mirrored light (``"phong"``), or between the normal and the half
    vector of viewer and light (``"blinn"``). So ``diffuse=0.5`` is as bright as a Lambertian albedo of 0.5 pi: nothing
    keeps the sum below 1, and colours may exceed it. `mirror` multiplies what a ray finds in the mirrored direction.

    Path tracing takes the normalised model instead, which reflects no more than ``diffuse + specular + mirror``:
    f = diffuse / pi + specular (n + 2) / (2 pi) max(r.wi, 0)^n, r the mirrored viewer (E. Lafortune, Y. Willems, 1994),
    and the mirror.

    References
    ----------
    B. T. Phong, "Illumination for computer generated pictures", CACM 18(6), 1975.
    J. F. Blinn, "Models of light reflection for computer synthesized pictures", SIGGRAPH 1977.
    """

    diffuse: Any = textured("colour of the diffuse part", default=0.5)
    specular: Any = textured("colour of the highlight", default=0.5)
    ambient: Any = textured("colour under ambient light", default=0.2)
    shininess: float = number("exponent of the highlight: large for a small one", default=32.0, at_least=0)
    emission: Color = color("radiance that the surface gives off by itself", default=0.0, unit="W/(m² sr)")
    mirror: Any = textured("colour of the mirror reflection", default=0.0)
    highlight: str = choice("how the highlight is measured", HIGHLIGHTS, default="phong")

    @property
    def glow(self) -> float:
        return sum(self.emission) / 3


DIFFUSE, SPECULAR, AMBIENT, SHININESS, EMISSION, MIRROR, HIGHLIGHT = Phong.offsets()


@implements(local, Phong)
def local_of_phong(material: Table, where: Where, cos_view: f64) -> Local:
    diffuse = value_at(table_at(material, DIFFUSE), where)
    return Local(
        diffuse,
        vec3_at(material, EMISSION),
        value_at(table_at(material, AMBIENT), where),
        diffuse,
        value_at(table_at(material, SPECULAR), where),
        f64_at(material, SHININESS),
        i64_at(material, HIGHLIGHT),
        value_at(table_at(material, MIRROR), where),
        grey(0.0), 1.0, grey(0.0),
    )  # fmt: skip


@kernel
def parts(material: Table, where: Where) -> Vec3:
    """With which probability the diffuse part, the highlight and the mirror are sampled: by their largest channels."""
    shares = Vec3(
        max4(value_at(table_at(material, DIFFUSE), where)),
        max4(value_at(table_at(material, SPECULAR), where)),
        max4(value_at(table_at(material, MIRROR), where)),
    )
    total = shares.x + shares.y + shares.z
    return shares / total if total > 0.0 else Vec3(1.0, 0.0, 0.0)


@implements(bsdf, Phong)
def bsdf_of_phong(material: Table, where: Where, wo: Vec3, wi: Vec3) -> BsdfValue:
    if wo.z * wi.z <= 0.0:
        return BsdfValue(grey(0.0), 0.0)
    n, share = f64_at(material, SHININESS), parts(material, where)
    lobe = max(0.0, dot(Vec3(-wo.x, -wo.y, wo.z), wi)) ** n / (2.0 * math.pi)
    f = value_at(table_at(material, DIFFUSE), where) * (1.0 / math.pi)
    f += value_at(table_at(material, SPECULAR), where) * ((n + 2.0) * lobe)
    density = share.x * abs(wi.z) / math.pi + share.y * (n + 1.0) * lobe
    return BsdfValue(f * abs(wi.z), density)


@implements(sample_bsdf, Phong)
def sample_phong(material: Table, where: Where, wo: Vec3, u: f64, v: f64, choice: f64) -> BsdfSample:
    share = parts(material, where)
    mirrored = Vec3(-wo.x, -wo.y, wo.z)
    if choice < share.z:
        return BsdfSample(mirrored, value_at(table_at(material, MIRROR), where) / share.z, 0.0)
    if choice < share.z + share.x:
        wi = cosine_hemisphere(u, v)
        wi = wi if wo.z > 0.0 else -wi
    else:
        across = perpendicular(mirrored)
        local_wi = power_cosine(f64_at(material, SHININESS), u, v)
        wi = across * local_wi.x + cross(mirrored, across) * local_wi.y + mirrored * local_wi.z
    found = bsdf_of_phong(material, where, wo, wi)
    if found.density <= 0.0:
        return BsdfSample(wi, grey(0.0), 0.0)
    return BsdfSample(wi, found.value / found.density, found.density)


@implements(emitted, Phong)
def emitted_by_phong(material: Table, where: Where, cos_view: f64) -> Vec3:
    return vec3_at(material, EMISSION)


class Parts8(NamedTuple):
    """Colours, and `parts`, of eight materials."""

    diffuse: Vec3x8
    specular: Vec3x8
    mirror: Vec3x8
    share: Vec3x8


@kernel
def parts8(material: Table, rows: I64x8) -> Parts8:
    """What eight materials are made of."""
    diffuse, specular, mirror = (
        constant8(material, rows, DIFFUSE, COLOR),
        constant8(material, rows, SPECULAR, COLOR),
        constant8(material, rows, MIRROR, COLOR),
    )
    share = Vec3x8(brightest8(diffuse), brightest8(specular), brightest8(mirror))
    total = share.x + share.y + share.z
    alone = Vec3x8(splat8d(1.0), splat8d(0.0), splat8d(0.0))
    return Parts8(diffuse, specular, mirror, select8v(total > 0.0, share * (1.0 / total), alone))


@kernel
def value8(parts: Parts8, exponent: F64x8, wo: Vec3x8, wi: Vec3x8) -> Value8:
    """`bsdf` of eight materials."""
    there, cosine = wo.z * wi.z > 0.0, abs8d(wi.z)
    f, density = parts.diffuse * (1.0 / math.pi), parts.share.x * cosine * (1.0 / math.pi)
    if movemask8(parts.share.y > 0.0) != 0:
        along = vmax8d(splat8d(0.0), dot8(Vec3x8(-wo.x, -wo.y, wo.z), wi))
        lobe = pow8(along, exponent) * (0.5 / math.pi)
        f = f + parts.specular * ((exponent + 2.0) * lobe)
        density = density + parts.share.y * (exponent + 1.0) * lobe
    return Value8(select8v(there, f * cosine, grey8(0.0)), select8d(there, density, splat8d(0.0)))


@implements(bsdf_eight, Phong)
def bsdf_of_phong_eight(material: Table, rows: I64x8, wo: Vec3x8, wi: Vec3x8) -> Value8:
    return value8(parts8(material, rows), gather8d(material, rows + SHININESS), wo, wi)


@kernel
def highlight8(exponent: F64x8, axis: Vec3x8, u: F64x8, v: F64x8) -> Vec3x8:
    """Directions about an axis, as `warp.power_cosine` has them about z."""
    cosine = pow8(u, 1.0 / (exponent + 1.0))
    sine = sqrt8d(vmax8d(splat8d(0.0), 1.0 - cosine * cosine))
    cosine_around, sine_around = circle8(v)
    return out_of8(frame_about8(axis), Vec3x8(sine * cosine_around, sine * sine_around, cosine))


@implements(sample_eight, Phong)
def sample_phong_eight(material: Table, rows: I64x8, wo: Vec3x8, u: F64x8, v: F64x8, choice: F64x8) -> Sample8:
    parts, exponent = parts8(material, rows), gather8d(material, rows + SHININESS)
    mirrored, share = Vec3x8(-wo.x, -wo.y, wo.z), parts.share
    mirrors = choice < share.z
    matte = not8(mirrors) & (choice < share.z + share.x)
    wi = cosine_hemisphere8(u, v)
    wi = select8v(wo.z > 0.0, wi, -wi)
    if movemask8(mirrors | matte) != 255:
        wi = select8v(matte, wi, highlight8(exponent, mirrored, u, v))
    found = value8(parts, exponent, wo, wi)
    weight = select8v(found.density > 0.0, found.value * (1.0 / found.density), grey8(0.0))
    return Sample8(
        select8v(mirrors, mirrored, wi), select8v(mirrors, parts.mirror * (1.0 / share.z), weight),
        select8d(mirrors, splat8d(0.0), found.density),
    )  # fmt: skip
