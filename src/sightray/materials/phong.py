"""The classic plastic: ambient, diffuse, highlight, and a mirror on top."""

from __future__ import annotations

import math
from typing import Any

from sightray._jit import implements, kernel
from sightray.fields import Color, choice, color, number
from sightray.materials.base import BsdfSample, BsdfValue, Local, Material, bsdf, emitted, local, sample_bsdf
from sightray.mathlib.frame import perpendicular
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, i64_at, table_at, vec3_at
from sightray.mathlib.vec import Vec3, cross, dot, grey, max4
from sightray.mathlib.warp import cosine_hemisphere, power_cosine
from sightray.textures.base import Where, textured, value_at

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
