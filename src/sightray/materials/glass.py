"""A smooth, clear dielectric: glass, water, diamond, or a bubble of air in one of them."""

from __future__ import annotations

import math
from typing import Any

from sightray._jit import implements
from sightray.fields import Color, color, derived_child, number
from sightray.materials.base import PHONG, BsdfSample, Local, Material, interior, local, sample_bsdf
from sightray.mathlib.bands import as_reflectance
from sightray.mathlib.frame import fresnel, refract
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, table_at, vec3_at
from sightray.mathlib.vec import Vec3, grey
from sightray.media.homogeneous import clear_or_stained
from sightray.textures.base import Where


class Glass(Material):
    """Divides light between mirror reflection and refraction by Fresnel's equations; nothing is lost at the surface.

    With eta = n1/n2 along the ray, Snell's law sin t = eta sin i gives the angle t behind the surface, and the share

        R = (r_s² + r_p²) / 2,  r_s = (eta cos i - cos t) / (eta cos i + cos t),
                                r_p = (cos i - eta cos t) / (cos i + eta cos t)

    goes to `mirror`, ``tint * (1 - R)`` to `transmission`. Beyond the critical angle, sin i > 1/eta, R is 1. Along a
    way of length d inside, light is weakened to ``exp(-absorption * d)`` (P. Bouguer, 1729; A. Beer, 1852).
    `ior` is relative to what surrounds the shape, so 1/1.333 is a bubble of air in water. Shapes must be closed.

    References: A. Fresnel, "Mémoire sur la loi des modifications...", 1823; M. Born and E. Wolf, Principles of Optics,
    section 1.5.
    """

    ior: float = number("refractive index inside over the one outside", default=1.5, above=0)
    absorption: Color = color("absorption coefficient of the inside", default=0.0, unit="1/m")
    tint: Color = color("factor on light that passes the surface, once per passage", default=1.0, at_most=1.0)
    _inside: Any = derived_child("the medium inside, if it absorbs", lambda g: clear_or_stained(g.absorption))


IOR, ABSORPTION, TINT, INSIDE = Glass.offsets()


@implements(local, Glass)
def local_of_glass(material: Table, where: Where, cos_view: f64) -> Local:
    zero = grey(0.0)
    absorption = zero
    eta = 1.0 / f64_at(material, IOR)
    if cos_view < 0.0:  # the viewer is inside, and so was the ray until here
        eta = f64_at(material, IOR)
        absorption = vec3_at(material, ABSORPTION)
    reflected = fresnel(abs(cos_view), eta)
    tint = vec3_at(material, TINT)
    passed = tint * (1.0 - reflected)
    return Local(tint, zero, zero, zero, zero, 0.0, PHONG, grey(reflected), passed, eta, absorption)


@implements(sample_bsdf, Glass)
def sample_glass(material: Table, where: Where, wo: Vec3, u: f64, v: f64, choice: f64) -> BsdfSample:
    """Reflect with the probability R, else refract; radiance is not scaled by eta² (that cancels on the way out)."""
    eta = 1.0 / f64_at(material, IOR) if wo.z > 0.0 else f64_at(material, IOR)
    if choice < fresnel(abs(wo.z), eta):
        return BsdfSample(Vec3(-wo.x, -wo.y, wo.z), grey(1.0), 0.0)
    facing = Vec3(0.0, 0.0, math.copysign(1.0, wo.z))
    return BsdfSample(refract(-wo, facing, eta), as_reflectance(where.bands, vec3_at(material, TINT)), 0.0)


@implements(interior, Glass)
def interior_of_glass(material: Table) -> Table:
    return table_at(material, INSIDE)
