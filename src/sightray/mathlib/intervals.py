"""Interval arithmetic with derivatives: bounds on a function and on its slope over a whole stretch of a ray.

A **span** is a `Vec3` whose lanes x and y bound a value from below and above, and z and w its derivative by the ray
parameter. Each rule returns bounds that contain every value that its arguments allow; results are widened by more than
their rounding error, so that what they exclude is excluded in truth. ``HUGE`` stands for "without bound": it is
small enough for products to stay finite, so no infinity or NaN ever appears.

References: R. Moore, "Interval Analysis" (1966); D. Mitchell, "Robust ray intersection with interval arithmetic" (1990).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.vec import Vec3, grey, vabs, vmax, vmin

HUGE = 1e150
_EPSILON = 2.0**-51  # four rounding errors of an operation, two of a function


class Interval(NamedTuple):
    """All numbers between two bounds."""

    lower: f64
    upper: f64


@kernel
def whole() -> Vec3:
    """Nothing is known."""
    return Vec3(-HUGE, HUGE, -HUGE, HUGE)


@kernel
def outward(a: Vec3, operations: f64) -> Vec3:
    """Widen by the rounding error of so many operations, and cut at `HUGE`."""
    e = _EPSILON * operations
    return vmax(vmin(a + vabs(a) * Vec3(-e, e, -e, e), grey(HUGE)), grey(-HUGE))


@kernel
def times(a: f64, b: f64, c: f64, d: f64) -> Interval:
    """[a, b] times [c, d]."""
    p, q, r, s = a * c, a * d, b * c, b * d
    return Interval(min(p, q, r, s), max(p, q, r, s))


@kernel
def chain(lower: f64, upper: f64, g_lower: f64, g_upper: f64, a: Vec3) -> Vec3:
    """Chain rule: the span of g(a), given the bounds of g and of its derivative over `a`."""
    slope = times(max(g_lower, -HUGE), min(g_upper, HUGE), a.z, a.w)
    return outward(Vec3(lower, upper, slope.lower, slope.upper), 1.0)


@kernel
def negate(a: Vec3) -> Vec3:
    return Vec3(-a.y, -a.x, -a.w, -a.z)


@kernel
def multiply(a: Vec3, b: Vec3) -> Vec3:
    value = times(a.x, a.y, b.x, b.y)
    p, q = times(a.x, a.y, b.z, b.w), times(b.x, b.y, a.z, a.w)
    return outward(Vec3(value.lower, value.upper, p.lower + q.lower, p.upper + q.upper), 1.0)


@kernel
def reciprocal_of(a: Vec3) -> Vec3:
    if a.x <= 0.0 <= a.y:
        return whole()
    lower, upper = max(1.0 / a.y, -HUGE), min(1.0 / a.x, HUGE)
    p, q = lower * lower, upper * upper
    return chain(lower, upper, -max(p, q), -min(p, q), a)


@kernel
def whole_power(x: f64, n: i64) -> f64:
    """x to the n-th for n >= 0, cut at `HUGE`."""
    result = 1.0
    for _ in range(n):
        result = min(max(result * x, -HUGE), HUGE)
    return result


@kernel
def power_range(lower: f64, upper: f64, n: i64) -> Interval:
    """Bounds of the n-th power of an interval, n >= 0."""
    p, q = whole_power(lower, n), whole_power(upper, n)
    if n % 2 == 0 and n > 0 and lower < 0.0:
        return Interval(0.0 if upper > 0.0 else q, max(p, q))
    return Interval(p, q)


@kernel
def power_of(a: Vec3, n: i64) -> Vec3:
    value, slope = power_range(a.x, a.y, n), power_range(a.x, a.y, n - 1)
    p = times(min(n * slope.lower, HUGE), min(n * slope.upper, HUGE), a.z, a.w)
    return outward(Vec3(value.lower, value.upper, p.lower, p.upper), 1.0 + n)


@kernel
def sine_range(lower: f64, upper: f64) -> Interval:
    """Bounds of the sine of an interval."""
    if not (upper - lower < 6.0 and lower > -1e9 and upper < 1e9):
        return Interval(-1.0, 1.0)
    p, q, turn, quarter = math.sin(lower), math.sin(upper), 2.0 * math.pi, 0.5 * math.pi
    crest = math.floor((upper - quarter) / turn) > math.floor((lower - quarter) / turn)
    trough = math.floor((upper + quarter) / turn) > math.floor((lower + quarter) / turn)
    return Interval(-1.0 if trough else min(p, q), 1.0 if crest else max(p, q))


@kernel
def sine_of(a: Vec3) -> Vec3:
    quarter = 0.5 * math.pi
    value, slope = sine_range(a.x, a.y), sine_range(a.x + quarter, a.y + quarter)
    return chain(value.lower - 1e-16, value.upper + 1e-16, slope.lower - 1e-15, slope.upper + 1e-15, a)


@kernel
def tangent_of(a: Vec3) -> Vec3:
    if not (a.x > -1e9 and a.y < 1e9) or math.floor(a.x / math.pi + 0.5) != math.floor(a.y / math.pi + 0.5):
        return whole()
    lower, upper = math.tan(a.x), math.tan(a.y)
    if lower > upper:  # a pole, hidden by rounding
        return whole()
    square = power_range(lower, upper, 2)
    return chain(lower, upper, 1.0 + square.lower, 1.0 + square.upper, a)


@kernel
def exponential_of(a: Vec3) -> Vec3:
    lower, upper = math.exp(min(a.x, 345.0)), math.exp(min(a.y, 345.0))
    if a.y > 345.0:
        upper = HUGE
    return chain(lower, upper, lower, upper, a)


@kernel
def logarithm_of(a: Vec3) -> Vec3:
    """Natural logarithm of the part of `a` above zero."""
    upper = math.log(max(a.y, 1e-300))
    if a.x < 1e-300:
        return Vec3(-HUGE, upper + 1e-13, -HUGE, HUGE)
    return chain(math.log(a.x) - 1e-16, upper + 1e-16, 1.0 / a.y, min(1.0 / a.x, HUGE), a)


@kernel
def root_of(a: Vec3) -> Vec3:
    """Square root of the part of `a` that is not negative."""
    upper = math.sqrt(max(a.y, 0.0))
    if a.x < 1e-300:
        return outward(Vec3(0.0, upper, -HUGE, HUGE), 1.0)
    lower = math.sqrt(a.x)
    return chain(lower, upper, 0.5 / upper, 0.5 / lower, a)


@kernel
def absolute_of(a: Vec3) -> Vec3:
    if a.x >= 0.0:
        return a
    if a.y <= 0.0:
        return negate(a)
    return Vec3(0.0, max(-a.x, a.y), min(a.z, -a.w), max(a.w, -a.z))


@kernel
def larger_of(a: Vec3, b: Vec3) -> Vec3:
    if a.x >= b.y:
        return a
    if b.x >= a.y:
        return b
    return Vec3(max(a.x, b.x), max(a.y, b.y), min(a.z, b.z), max(a.w, b.w))


@kernel
def hyperbolic_tangent_of(a: Vec3) -> Vec3:
    lower, upper = math.tanh(a.x), math.tanh(a.y)
    square = power_range(lower, upper, 2)
    return chain(lower, upper, max(0.0, 1.0 - square.upper - 1e-15), 1.0 - square.lower + 1e-15, a)


@kernel
def arctangent_of(a: Vec3) -> Vec3:
    square = power_range(a.x, a.y, 2)
    return chain(math.atan(a.x), math.atan(a.y), 1.0 / (1.0 + square.upper), 1.0 / (1.0 + square.lower), a)


@kernel
def angle_of(y: Vec3, x: Vec3) -> Vec3:
    """The angle of (x, y) from the x axis in (-π, π]; unknown where it jumps, across the negative x axis."""
    if x.x > 0.0:
        return arctangent_of(multiply(y, reciprocal_of(x)))
    if y.x <= 0.0 <= y.y:
        return whole()
    quarter = 0.5 * math.pi if y.x > 0.0 else -0.5 * math.pi
    around = negate(arctangent_of(multiply(x, reciprocal_of(y))))
    return outward(around + Vec3(quarter, quarter, 0.0, 0.0), 1.0)
