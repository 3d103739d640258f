"""Choosing slopes of a Beckmann surface among those that are seen."""

from __future__ import annotations

import math

from sightray._jit import kernel
from sightray.mathlib.scalars import f64
from sightray.mathlib.vec import Vec3

STEPS = 24  # halvings in the worst case; three or four steps of Newton's method are usual
CLOSE = 1e-12  # to the end of the interval, and of the result


@kernel
def inverse_erf(y: f64) -> f64:
    """The x whose error function is y, for -1 < y < 1: a first guess (S. Winitzki, 2008), two steps of Halley's."""
    y = min(1.0 - 1e-15, max(-1.0 + 1e-15, y))
    log = math.log(1.0 - y * y)
    half = 2.0 / (math.pi * 0.147) + 0.5 * log
    x = math.copysign(math.sqrt(math.sqrt(half * half - log / 0.147) - half), y)
    for _ in range(2):
        error = math.copysign(1.0, y) * (1.0 - abs(y) - math.erfc(abs(x)))
        step = 0.5 * math.sqrt(math.pi) * error * math.exp(x * x)
        x -= step / (1.0 + x * step)
    return x


@kernel
def sample_visible_slope(w: Vec3, u: f64, v: f64) -> Vec3:
    """A facet (not of unit length) of a surface of roughness 1 among those that the unit vector w sees.

    Of the two slopes, the one across the view has a normal distribution. The one along it, s, has the density
    (cos - s sin) exp(-s²) for s <= cot, whose integral

        F(s) = sqrt(pi)/2 cos (1 + erf s) + sin/2 exp(-s²)

    is nearly straight over b = erf s, so that Newton's method in b, kept within an interval, inverts it in few steps
    (after W. Jakob, "An improved visible normal sampling routine for the Beckmann distribution", 2014).
    """
    sine = math.sqrt(w.x * w.x + w.y * w.y)
    across = inverse_erf(2.0 * v - 1.0)
    if sine < 1e-6:  # seen from straight above all slopes are alike
        return Vec3(-inverse_erf(2.0 * u - 1.0), -across, 1.0)
    half_pi = 0.5 * math.sqrt(math.pi)
    cot = w.z / sine
    low, high = -1.0, math.erf(cot)
    goal = u * (half_pi * w.z * (1.0 + high) + 0.5 * sine * math.exp(-cot * cot))
    b = low + (high - low) * u
    s = inverse_erf(b)
    for _ in range(STEPS):
        error = half_pi * w.z * (1.0 + b) + 0.5 * sine * math.exp(-s * s) - goal
        if abs(error) < CLOSE * goal or high - low < CLOSE:
            break
        if error > 0.0:
            high = b
        else:
            low = b
        slope = half_pi * (w.z - s * sine)
        b = b - error / slope if slope > 0.0 else low
        if not low < b < high:
            b = 0.5 * (low + high)
        s = inverse_erf(b)

    # Turn the slopes, which were taken along the view, back to the axes.
    c, d = w.x / sine, w.y / sine
    return Vec3(-(s * c - across * d), -(s * d + across * c), 1.0)
