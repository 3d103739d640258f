"""Warps: from the unit square to directions, and the densities that follow."""

from __future__ import annotations

import math

from sightray._jit import kernel
from sightray.mathlib.scalars import f64
from sightray.mathlib.vec import Vec3


@kernel
def cosine_hemisphere(u: f64, v: f64) -> Vec3:
    """A direction about +z with density cos / pi (N. Malley, 1988: a disk lifted to the sphere)."""
    r, phi = math.sqrt(u), 2.0 * math.pi * v
    return Vec3(r * math.cos(phi), r * math.sin(phi), math.sqrt(max(0.0, 1.0 - u)))


@kernel
def power_cosine(exponent: f64, u: f64, v: f64) -> Vec3:
    """A direction about +z with density (n + 1) / (2 pi) cos^n."""
    cosine, phi = u ** (1.0 / (exponent + 1.0)), 2.0 * math.pi * v
    sine = math.sqrt(max(0.0, 1.0 - cosine * cosine))
    return Vec3(sine * math.cos(phi), sine * math.sin(phi), cosine)
