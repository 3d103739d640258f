"""Roots of an expression along a ray, none of them missed.

Interval arithmetic bounds the function and its slope over a whole stretch of the ray. A stretch where the function
cannot be zero is dropped; one where it rises or falls throughout has at most one root, which Newton's method finds; any
other is halved.

Reference: D. Mitchell, "Robust ray intersection with interval arithmetic" (Graphics Interface, 1990).
"""

from __future__ import annotations

import math

from sightray._jit import kernel
from sightray.mathlib.interpret import bound_on_ray
from sightray.mathlib.intervals import HUGE
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, f64_put, scratch
from sightray.mathlib.vec import Vec3

MAX_STEPS = 20000  # stretches looked at before a ray is given up
_TINY, _TOUCH = 1e-13, 1e-8  # of the way through the box: where halving ends, and where a value of zero is a touch


@kernel
def middle_of(program: Table, count: i64, o: Vec3, d: Vec3, s: f64) -> f64:
    """Value of the expression at one point."""
    f = bound_on_ray(program, count, o, d, s, s)
    return 0.5 * (f.x + f.y)


@kernel
def root_in_rise(program: Table, count: i64, o: Vec3, d: Vec3, a: f64, b: f64) -> f64:
    """The root in [a, b] of an expression that is monotone there, by Newton's method kept in bounds; NaN for none."""
    rising = middle_of(program, count, o, d, a) < 0.0
    if rising == (middle_of(program, count, o, d, b) < 0.0):
        return math.nan
    tolerance = 1e-16 * (abs(a) + abs(b))
    s = 0.5 * (a + b)
    for _ in range(100):
        f = bound_on_ray(program, count, o, d, s, s)
        value, slope = 0.5 * (f.x + f.y), 0.5 * (f.z + f.w)
        if (value < 0.0) == rising:
            a = s
        else:
            b = s
        better = s - value / slope if slope != 0.0 else a
        if not a < better < b:
            better = 0.5 * (a + b)
        if abs(better - s) <= tolerance:
            return better
        s = better
    return s


@kernel
def first_root(program: Table, count: i64, o: Vec3, d: Vec3, start: f64, end: f64, t_min: f64, t_max: f64) -> f64:
    """Smallest t = start + s, t_min < t < t_max, with a root of the expression at o + s d, 0 <= s <= end, or infinity.

    Stretches are halved alike whatever t_min is: a root is the same number for all rays that continue one another.
    """
    stack = scratch(256)  # stretches still to be searched, the nearest on top
    f64_put(stack, 0, 0.0)
    f64_put(stack, 1, end)
    top = 2
    for _ in range(MAX_STEPS):
        if top == 0:
            break
        top -= 2
        a, b = f64_at(stack, top), f64_at(stack, top + 1)
        if start + b <= t_min or start + a >= t_max:
            continue
        f = bound_on_ray(program, count, o, d, a, b)
        if f.x > 0.0 or f.y < 0.0:
            continue
        if f.z > 0.0 or f.w < 0.0:
            s = root_in_rise(program, count, o, d, a, b)
            if t_min < start + s < t_max:
                return start + s
            continue

        # Bound the function once more, from its value in the middle and its slope: the better way on short stretches.
        m = 0.5 * (a + b)
        g = bound_on_ray(program, count, o, d, m, m)
        change = max(abs(f.z), abs(f.w)) * (b - a)
        if g.x > change or g.y < -change:
            continue
        if b - a <= _TINY * end or (b - a <= _TOUCH * end and g.x <= 0.0 <= g.y):
            if f.x > -HUGE and f.y < HUGE and t_min < start + m < t_max:  # a pole is no root
                return start + m
            continue
        f64_put(stack, top, m)
        f64_put(stack, top + 1, b)
        f64_put(stack, top + 2, a)
        f64_put(stack, top + 3, m)
        top += 4
    return math.inf
