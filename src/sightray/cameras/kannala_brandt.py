"""Lens distortion by J. Kannala and S. Brandt, for fisheye lenses: both ways, in kernels and for arrays.

A point at the angle theta from the line of sight is seen, in units of the focal length, at the radius

    r = theta (1 + k1 theta² + k2 theta⁴ + k3 theta⁶ + k4 theta⁸).

It is a lens up to the angle at which r stops growing, or 180 degrees.

Reference: J. Kannala, S. Brandt, "A generic camera model and calibration method for conventional, wide-angle, and
fish-eye lenses", IEEE PAMI 28(8), 2006, equation 6.
"""

from __future__ import annotations

import math

import numpy as np

from sightray._jit import kernel
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at

STEPS = 60  # of Newton's method, at most; it takes about five
REACH = 8  # where the widest angle stands after the first of a lens' numbers, which begin with k1 ... k4
PRECISION = 1e-16


def reach(lens: np.ndarray) -> float:
    """Up to which angle the radius grows, rad."""
    slope = np.polynomial.Polynomial([1.0, *np.array([3.0, 5.0, 7.0, 9.0]) * lens[:4]])  # in theta²
    roots = slope.trim().roots()
    real = roots[(np.abs(roots.imag) <= 1e-9 * np.abs(roots)) & (roots.real > 0)].real
    return min(math.pi, math.sqrt(real.min(initial=math.inf)))


def radius(lens: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Where an angle is seen; NaN beyond the lens' reach."""
    s, (k1, k2, k3, k4) = theta * theta, lens[:4]
    return np.where(theta <= reach(lens), theta * (1 + s * (k1 + s * (k2 + s * (k3 + s * k4)))), np.nan)


def angle(lens: np.ndarray, r: np.ndarray) -> np.ndarray:
    """The angle that is seen at a radius, NaN beyond the rim: bisection, then Newton's method."""
    end = reach(lens)
    low, high = np.zeros_like(r), np.full_like(r, end)
    for _ in range(40):
        middle = 0.5 * (low + high)
        beyond = radius(lens, middle) > r
        low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
    theta, (k1, k2, k3, k4) = 0.5 * (low + high), lens[:4]
    for _ in range(5):
        s = theta * theta
        slope = 1 + s * (3 * k1 + s * (5 * k2 + s * (7 * k3 + s * 9 * k4)))
        step = (theta * (1 + s * (k1 + s * (k2 + s * (k3 + s * k4)))) - r) / slope
        theta = np.clip(np.where(np.isfinite(step), theta - step, theta), 0.0, end)
    return np.where(r <= radius(lens, np.array(end)), theta, np.nan)


@kernel
def angle_before(camera: Table, at: i64, r: f64) -> f64:
    """The angle that is seen at a radius, NaN beyond the rim: Newton's method between brackets."""
    k1, k2, k3, k4 = f64_at(camera, at), f64_at(camera, at + 1), f64_at(camera, at + 2), f64_at(camera, at + 3)
    low, high = 0.0, f64_at(camera, at + REACH)
    s = high * high
    if r > high * (1.0 + s * (k1 + s * (k2 + s * (k3 + s * k4)))):
        return math.nan
    theta = min(r, high)
    for _ in range(STEPS):
        s = theta * theta
        excess = theta * (1.0 + s * (k1 + s * (k2 + s * (k3 + s * k4)))) - r
        if excess > 0.0:
            high = theta
        else:
            low = theta
        step = excess / (1.0 + s * (3.0 * k1 + s * (5.0 * k2 + s * (7.0 * k3 + s * 9.0 * k4))))
        if not low <= theta - step <= high:  # also where the slope is zero
            step = theta - 0.5 * (low + high)
        theta -= step
        if abs(step) <= PRECISION * theta:
            break
    return theta
