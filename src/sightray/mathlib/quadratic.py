"""Quadratic equations without loss of digits."""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.mathlib.scalars import f64

_SPLIT = 134217729.0  # 2^27 + 1: cuts a double into two halves of 26 bits


class Roots(NamedTuple):
    """Two real roots in ascending order; equal if there is one, NaN if there is none."""

    near: f64
    far: f64


@kernel(exact=True)
def product_error(x: f64, y: f64, product: f64) -> f64:
    """What rounding took from ``product = x * y``, exactly (T. Dekker, "A floating-point technique ...", 1971)."""
    x_high = _SPLIT * x - (_SPLIT * x - x)
    y_high = _SPLIT * y - (_SPLIT * y - y)
    x_low, y_low = x - x_high, y - y_high
    return ((x_high * y_high - product) + x_high * y_low + x_low * y_high) + x_low * y_low


@kernel(exact=True)
def discriminant(a: f64, b: f64, c: f64) -> f64:
    """b² - a c to nearly the last bit, even where the two terms cancel (W. Kahan, 2004)."""
    p, q = b * b, a * c
    if 3.0 * abs(p - q) >= p + abs(q):
        return p - q
    return (p - q) + (product_error(b, b, p) - product_error(a, c, q))


@kernel
def quadratic(a: f64, b: f64, c: f64) -> Roots:
    """Real roots of a t² + 2 b t + c = 0; like numbers are never subtracted, and a may be zero."""
    disc = discriminant(a, b, c)
    if not disc >= 0.0:
        return Roots(math.nan, math.nan)
    q = -(b + math.copysign(math.sqrt(disc), b))
    if q == 0.0:  # b = 0 and a c = 0: a double root at zero, or no equation at all
        root = 0.0 if a != 0.0 else math.nan
        return Roots(root, root)
    t0 = c / q
    t1 = q / a if a != 0.0 else t0
    return Roots(min(t0, t1), max(t0, t1))
