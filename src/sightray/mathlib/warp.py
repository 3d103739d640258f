"""Warps: from the unit square to directions, and the densities that follow."""

from __future__ import annotations

import math

from sightray._jit import kernel
from sightray.mathlib.scalars import f64
from sightray.mathlib.vec import Vec3


@kernel
def concentric(x: f64, y: f64) -> Vec3:
    """The point of the unit disk for a point of the unit square: squares become circles, areas shrink by pi/4.

    P. Shirley, K. Chiu, "A low distortion map between disk and square", Journal of Graphics Tools 2(3), 1997.
    """
    a, b = 2.0 * x - 1.0, 2.0 * y - 1.0
    if abs(a) > abs(b):
        q = b / a
        return Vec3(a * cosine_of_octant(q), a * sine_of_octant(q), 0.0)
    if b == 0.0:
        return Vec3(0.0, 0.0, 0.0)
    q = a / b
    return Vec3(b * sine_of_octant(q), b * cosine_of_octant(q), 0.0)


@kernel
def sine_of_octant(q: f64) -> f64:
    """sin(pi/4 q) for q in [-1, 1] to 4e-14, by Taylor's series: the range is too small for a call of the library."""
    x = 0.25 * math.pi * q
    y = x * x
    return x * (1.0 + y * (-1 / 6 + y * (1 / 120 + y * (-1 / 5040 + y * (1 / 362880 + y * (-1 / 39916800
                + y * (1 / 6227020800)))))))  # fmt: skip


@kernel
def cosine_of_octant(q: f64) -> f64:
    """cos(pi/4 q) for q in [-1, 1] to 4e-14."""
    x = 0.25 * math.pi * q
    y = x * x
    return 1.0 + y * (-1 / 2 + y * (1 / 24 + y * (-1 / 720 + y * (1 / 40320 + y * (-1 / 3628800
                + y * (1 / 479001600 + y * (-1 / 87178291200)))))))  # fmt: skip


@kernel
def cosine_hemisphere(u: f64, v: f64) -> Vec3:
    """A direction about +z with density cos / pi (N. Malley, 1988: a disk lifted to the sphere)."""
    p = concentric(u, v)
    return Vec3(p.x, p.y, math.sqrt(max(0.0, 1.0 - p.x * p.x - p.y * p.y)))


@kernel
def power_cosine(exponent: f64, u: f64, v: f64) -> Vec3:
    """A direction about +z with density (n + 1) / (2 pi) cos^n."""
    cosine, phi = u ** (1.0 / (exponent + 1.0)), 2.0 * math.pi * v
    sine = math.sqrt(max(0.0, 1.0 - cosine * cosine))
    return Vec3(sine * math.cos(phi), sine * math.sin(phi), cosine)
