"""Fresnel's equations for conductors, whose refractive index n + i k is complex."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sightray._jit import kernel
from sightray.mathlib.eights import F64x8, Vec3x8, select8d, splat8d, sqrt8d, vmax8d
from sightray.mathlib.scalars import f64
from sightray.mathlib.vec import Vec3


@kernel
def fresnel_metal(cosine: f64, n: f64, k: f64) -> f64:
    """Share of unpolarised light that a smooth conductor reflects; n and k are relative to what is before it.

    With a² - b² = n² - k² - sin² and 2 a b = 2 n k (M. Born, E. Wolf, Principles of Optics, section 14.2):

        R_s = (a² + b² - 2 a cos + cos²) / (a² + b² + 2 a cos + cos²)
        R_p = R_s (cos² (a² + b²) - 2 a cos sin² + sin⁴) / (cos² (a² + b²) + 2 a cos sin² + sin⁴)
    """
    cos2 = cosine * cosine
    sin2 = max(0.0, 1.0 - cos2)
    difference = n * n - k * k - sin2
    norm = math.sqrt(difference * difference + 4.0 * n * n * k * k)  # a² + b²
    twice = 2.0 * cosine * math.sqrt(max(0.0, 0.5 * (norm + difference)))  # 2 a cos
    r_s = (norm - twice + cos2) / (norm + twice + cos2)
    along, bent = cos2 * norm + sin2 * sin2, twice * sin2
    r_p = r_s * (along - bent) / (along + bent) if along + bent > 0.0 else r_s
    return 0.5 * (r_s + r_p)


@kernel
def fresnel_lanes(cosine: f64, n: Vec3, k: Vec3) -> Vec3:
    """`fresnel_metal` for each lane of colour."""
    return Vec3(
        fresnel_metal(cosine, n.x, k.x), fresnel_metal(cosine, n.y, k.y), fresnel_metal(cosine, n.z, k.z),
        fresnel_metal(cosine, n.w, k.w),
    )  # fmt: skip


@kernel
def fresnel_metal8(cosine: F64x8, n: F64x8, k: F64x8) -> F64x8:
    """`fresnel_metal` for eight paths."""
    zero, cos2 = splat8d(0.0), cosine * cosine
    sin2 = vmax8d(zero, 1.0 - cos2)
    difference = n * n - k * k - sin2
    norm = sqrt8d(difference * difference + 4.0 * n * n * k * k)
    twice = 2.0 * cosine * sqrt8d(vmax8d(zero, 0.5 * (norm + difference)))
    r_s = (norm - twice + cos2) / (norm + twice + cos2)
    along, bent = cos2 * norm + sin2 * sin2, twice * sin2
    r_p = select8d(along + bent > 0.0, r_s * (along - bent) / (along + bent), r_s)
    return 0.5 * (r_s + r_p)


@kernel
def fresnel_colours8(cosine: F64x8, n: Vec3x8, k: Vec3x8) -> Vec3x8:
    """The same for red, green and blue."""
    return Vec3x8(fresnel_metal8(cosine, n.x, k.x), fresnel_metal8(cosine, n.y, k.y), fresnel_metal8(cosine, n.z, k.z))


def mean_reflectance(n: ArrayLike, k: ArrayLike) -> NDArray[np.float64]:
    """What a conductor reflects of light that comes evenly from all sides: 2 times the integral of R cos d cos."""
    n, k = np.asarray(n, dtype=np.float64)[..., np.newaxis], np.asarray(k, dtype=np.float64)[..., np.newaxis]
    cosine = (np.arange(64) + 0.5) / 64
    cos2, sin2 = cosine**2, 1.0 - cosine**2
    root = np.sqrt((n + 1j * k) ** 2 - sin2)  # a + i b
    norm, twice = np.abs(root) ** 2, 2.0 * root.real * cosine
    r_s = (norm - twice + cos2) / (norm + twice + cos2)
    r_p = r_s * (cos2 * norm - twice * sin2 + sin2**2) / (cos2 * norm + twice * sin2 + sin2**2)
    return np.asarray((0.5 * (r_s + r_p) * cosine).mean(axis=-1) * 2.0)
