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
    """sin(pi/4 q) for q in [-1, 1] to 2e-16, by Taylor's series: the range is too small for a call of the library."""
    x = 0.25 * math.pi * q
    y = x * x
    return x * (1.0 + y * (-1 / 6 + y * (1 / 120 + y * (-1 / 5040 + y * (1 / 362880 + y * (-1 / 39916800
                + y * (1 / 6227020800 + y * (-1 / 1307674368000))))))))  # fmt: skip


@kernel
def cosine_of_octant(q: f64) -> f64:
    """cos(pi/4 q) for q in [-1, 1] to 2e-16."""
    x = 0.25 * math.pi * q
    y = x * x
    return 1.0 + y * (-1 / 2 + y * (1 / 24 + y * (-1 / 720 + y * (1 / 40320 + y * (-1 / 3628800
                + y * (1 / 479001600 + y * (-1 / 87178291200 + y * (1 / 20922789888000))))))))  # fmt: skip


@kernel
def circle(turns: f64) -> Vec3:
    """The point (cos, sin, 0) of the unit circle for an angle in turns, to 3e-16."""
    quarters = math.floor(4.0 * turns + 0.5)
    q = 2.0 * (4.0 * turns - quarters)
    c, s = cosine_of_octant(q), sine_of_octant(q)
    quarter = int(quarters) & 3
    x, y = (s, c) if quarter & 1 != 0 else (c, s)
    return Vec3(-x if quarter == 1 or quarter == 2 else x, -y if quarter >= 2 else y, 0.0)


@kernel
def cosine_hemisphere(u: f64, v: f64) -> Vec3:
    """A direction about +z with density cos / pi (N. Malley, 1988: a disk lifted to the sphere)."""
    p = concentric(u, v)
    return Vec3(p.x, p.y, math.sqrt(max(0.0, 1.0 - p.x * p.x - p.y * p.y)))


@kernel
def power_cosine(exponent: f64, u: f64, v: f64) -> Vec3:
    """A direction about +z with density (n + 1) / (2 pi) cos^n."""
    cosine, around = u ** (1.0 / (exponent + 1.0)), circle(v)
    sine = math.sqrt(max(0.0, 1.0 - cosine * cosine))
    return Vec3(sine * around.x, sine * around.y, cosine)
