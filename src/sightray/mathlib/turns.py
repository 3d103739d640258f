"""Angles as texture coordinates: shares of a full turn."""

from __future__ import annotations

import math

from sightray._jit import kernel
from sightray.mathlib.scalars import f64
from sightray.mathlib.vec import Vec3


@kernel
def turn(x: f64, y: f64) -> f64:
    """Angle of (x, y) counter-clockwise from the x axis, in turns: in [0, 1)."""
    share = math.atan2(y, x) / (2.0 * math.pi)
    if share < 0.0:
        share += 1.0
    return share if share < 1.0 else 0.0  # a tiny negative angle rounds up to a full turn


@kernel
def tangent_around_y(n: Vec3, q: Vec3) -> Vec3:
    """Derivative of a surface point `q` with normal `n` by its turn about the y axis, along a level way."""
    level = Vec3(n.z, 0.0, -n.x)
    turned = n.x * q.x + n.z * q.z  # the part of it that turns, times the distance from the axis
    if turned == 0.0:
        return Vec3(1.0, 0.0, 0.0) if n.x == 0.0 and n.z == 0.0 else level
    return level * (2.0 * math.pi * (q.x * q.x + q.z * q.z) / turned)
