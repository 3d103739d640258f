"""Rays as shapes see them: which ones can hit at all, and which of two roots counts."""

from __future__ import annotations

import math

from sightray._jit import kernel
from sightray.mathlib.scalars import f64
from sightray.mathlib.vec import Vec3, dot


@kernel
def is_ray(o: Vec3, d: Vec3) -> bool:
    """Whether origin and direction are finite numbers and the direction has a length."""
    dd = dot(d, d)
    return dd > 0.0 and dd + dot(o, o) < math.inf


@kernel
def nearest_parameter(o: Vec3, d: Vec3, center: Vec3) -> f64:
    """The t at which o + t d passes nearest to `center`.

    Shapes solve from there, not from the eye: coefficients then have the shape's size, and a far eye costs no digits.
    """
    return dot(center - o, d) / dot(d, d)


@kernel
def first_within(near: f64, far: f64, t_min: f64, t_max: f64) -> f64:
    """The first of two ascending roots in (t_min, t_max), or infinity; roots that are not there are NaN."""
    if t_min < near < t_max:
        return near
    if t_min < far < t_max:
        return far
    return math.inf
