"""Real roots of polynomials, bracketed by the roots of their derivatives.

Between two neighbouring roots of its derivative a polynomial rises or falls all the way, so that it has one root there
if its sign changes, and none if not. Starting from the derivative of degree one, each degree's roots bracket the next
(the idea is old; C. Yuksel, "High-Performance Polynomial Root Finding for Graphics", 2022, shows its merit for rays).
No root formula, no complex numbers, and a missed double root of a derivative does no harm: the sign still decides.
"""

from __future__ import annotations

from sightray._jit import kernel
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, advance, f64_at, f64_put, scratch

MAX_DEGREE = 7
_ROW = MAX_DEGREE + 1


@kernel
def polynomial(c: Table, degree: i64, t: f64) -> f64:
    """c[0] + c[1] t + ... + c[degree] t^degree, by Horner's rule."""
    total = f64_at(c, degree)
    for i in range(degree - 1, -1, -1):
        total = total * t + f64_at(c, i)
    return total


@kernel
def bracketed_root(c: Table, slope: Table, degree: i64, a: f64, b: f64, rising: bool, tolerance: f64) -> f64:
    """The root in [a, b] of a polynomial that is monotone there: Newton's steps, or halving where they leave it."""
    t = 0.5 * (a + b)
    for _ in range(100):
        f = polynomial(c, degree, t)
        if (f < 0.0) == rising:
            a = t
        else:
            b = t
        s = polynomial(slope, degree - 1, t)
        better = t - f / s if s != 0.0 else a
        if not a < better < b:
            better = 0.5 * (a + b)
        if abs(better - t) <= tolerance:
            return better
        t = better
    return t


@kernel
def roots_within(c: Table, degree: i64, lower: f64, upper: f64, roots: Table) -> i64:
    """Write the roots in [lower, upper] where the sign changes to `roots`, ascending; the result is their number."""
    rows = scratch(64)  # row j: the derivative of degree j
    for i in range(degree + 1):
        f64_put(rows, degree * _ROW + i, f64_at(c, i))
    for j in range(degree - 1, -1, -1):
        for i in range(j + 1):
            f64_put(rows, j * _ROW + i, (i + 1) * f64_at(rows, (j + 1) * _ROW + i + 1))

    # Turn the roots of each derivative into those of the next, in place: root i is read before it is overwritten.
    # Near a turning point a polynomial is flat: half the digits of its place give all those of its height.
    size, count = abs(lower) + abs(upper), 0
    for j in range(1, degree + 1):
        tolerance = (1e-16 if j == degree else 1e-9) * size
        f, slope = advance(rows, j * _ROW), advance(rows, (j - 1) * _ROW)
        found, left, below_left = 0, lower, polynomial(f, j, lower) < 0.0
        for i in range(count + 1):
            right = f64_at(roots, i) if i < count else upper
            below_right = polynomial(f, j, right) < 0.0
            if below_left != below_right:
                f64_put(roots, found, bracketed_root(f, slope, j, left, right, below_left, tolerance))
                found += 1
            left, below_left = right, below_right
        count = found
    return count
