"""Slabs: the part of a ray between two parallel planes (T. Kay and J. Kajiya, "Ray tracing complex scenes", 1986)."""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.mathlib.scalars import f64
from sightray.mathlib.vec import Vec3


class Span(NamedTuple):
    """An interval of ray parameters; empty where near > far."""

    near: f64
    far: f64


@kernel
def slab(lower: f64, upper: f64, o: f64, d: f64) -> Span:
    """Where lower <= o + t d <= upper, along one axis; NaN gives nothing."""
    if d == 0.0:
        return Span(-math.inf, math.inf) if lower <= o <= upper else Span(math.inf, -math.inf)
    t0, t1 = (lower - o) / d, (upper - o) / d
    if t0 <= t1:
        return Span(t0, t1)
    if t1 <= t0:
        return Span(t1, t0)
    return Span(math.inf, -math.inf)


@kernel
def box_span(lower: Vec3, upper: Vec3, o: Vec3, d: Vec3) -> Span:
    """Where the ray is in an axis-aligned box."""
    x = slab(lower.x, upper.x, o.x, d.x)
    y = slab(lower.y, upper.y, o.y, d.y)
    z = slab(lower.z, upper.z, o.z, d.z)
    return Span(max(x.near, y.near, z.near), min(x.far, y.far, z.far))
