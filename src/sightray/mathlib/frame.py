"""Orthonormal frames about a direction, and the two laws that bend rays: mirror reflection and Snell's refraction."""

from __future__ import annotations

import math

from sightray._jit import kernel
from sightray.mathlib.scalars import f64
from sightray.mathlib.vec import Vec3, dot, normalize


@kernel
def perpendicular(n: Vec3) -> Vec3:
    """A unit vector perpendicular to the unit vector `n`, without branches (Duff et al., JCGT 2017)."""
    sign = math.copysign(1.0, n.z)
    a = -1.0 / (sign + n.z)
    return Vec3(1.0 + sign * n.x * n.x * a, sign * n.x * n.y * a, -sign * n.x)


@kernel
def reflect(d: Vec3, n: Vec3) -> Vec3:
    """The direction `d` after a mirror with unit normal `n`; length is kept."""
    return d - n * (2.0 * dot(d, n))


@kernel
def refract(d: Vec3, n: Vec3, eta: f64) -> Vec3:
    """Unit direction of the unit direction `d` behind a surface whose unit normal `n` faces it (Snell, 1621).

    `eta` is the refractive index before the surface over the one behind it. At total internal reflection there is no
    such direction: callers ask `fresnel` first.
    """
    cos_i = -dot(d, n)
    cos_t = math.sqrt(max(0.0, 1.0 - eta * eta * (1.0 - cos_i * cos_i)))
    return normalize(d * eta + n * (eta * cos_i - cos_t))


@kernel
def fresnel(cos_i: f64, eta: f64) -> f64:
    """Share of unpolarised light that a smooth dielectric reflects (Fresnel, 1823); 1 at total internal reflection.

    `cos_i` is the cosine of incidence, in [0, 1]; `eta` the refractive index before the surface over the one behind it.
    """
    sin2_t = eta * eta * max(0.0, 1.0 - cos_i * cos_i)
    if sin2_t >= 1.0:
        return 1.0
    cos_t = math.sqrt(1.0 - sin2_t)
    r_s = (eta * cos_i - cos_t) / (eta * cos_i + cos_t)
    r_p = (cos_i - eta * cos_t) / (cos_i + eta * cos_t)
    return 0.5 * (r_s * r_s + r_p * r_p)
