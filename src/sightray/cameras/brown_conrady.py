"""Lens distortion by D. Brown and A. Conrady, with a rational radial part: both ways, in kernels and for arrays.

A point (x, y) = (X/Z, Y/Z) is seen, in units of the focal length, at

    x' = x c + 2 p1 x y + p2 (r² + 2 x²),
    y' = y c + p1 (r² + 2 y²) + 2 p2 x y,    c = (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶).

Far from the middle such polynomials turn back on themselves; only the part up to there is a lens. `reach` finds where it
ends: the first r² at which r c(r) stops growing.

References: A. Conrady, "Decentred lens-systems", MNRAS 79, 1919; D. Brown, "Decentering distortion of lenses",
Photogrammetric Engineering 32(3), 1966.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sightray._jit import kernel
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at

K1, K2, K3, K4, K5, K6, P1, P2, REACH = 0, 1, 2, 3, 4, 5, 6, 7, 8  # places of the numbers, also of those of a `lens`
STEPS = 40  # of Newton's method, at most; it takes about five
PRECISION = 1e-15


class Bent(NamedTuple):
    """Where a point is seen, and the derivatives of that."""

    x: f64
    y: f64
    xx: f64  # of x by x
    xy: f64  # of x by y, and of y by x: the map is the gradient of a potential
    yy: f64


class Plain(NamedTuple):
    """A point before distortion, or `ok` false if none is seen there."""

    x: f64
    y: f64
    ok: bool


def reach(lens: np.ndarray) -> float:
    """Up to which r² the radial part grows; infinite if it always does."""
    n, d = np.polynomial.Polynomial([1.0, *lens[:3]]), np.polynomial.Polynomial([1.0, *lens[3:6]])
    s = np.polynomial.Polynomial([0.0, 2.0])  # r d/dr = 2 s d/ds, s = r²
    slope = n * d + s * (n.deriv() * d - n * d.deriv())
    roots = np.concatenate([slope.trim().roots(), d.trim().roots()])
    real = roots[(np.abs(roots.imag) <= 1e-9 * np.abs(roots)) & (roots.real > 0)].real
    return float(real.min(initial=math.inf))


def distort(lens: np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x', y' and the three derivatives, (3, ...): of x' by x, of x' by y (and y' by x), of y' by y."""
    k1, k2, k3, k4, k5, k6, p1, p2 = lens[:8]
    s = x * x + y * y
    over, under = 1 + s * (k1 + s * (k2 + s * k3)), 1 + s * (k4 + s * (k5 + s * k6))
    c = over / under
    slope = 2 * ((k1 + s * (2 * k2 + 3 * s * k3)) - c * (k4 + s * (2 * k5 + 3 * s * k6))) / under
    xs, ys = x * c + 2 * p1 * x * y + p2 * (s + 2 * x * x), y * c + p1 * (s + 2 * y * y) + 2 * p2 * x * y
    xx = c + slope * x * x + 2 * p1 * y + 6 * p2 * x
    xy = slope * x * y + 2 * p1 * x + 2 * p2 * y
    yy = c + slope * y * y + 6 * p1 * y + 2 * p2 * x
    return xs, ys, np.stack([xx, xy, yy])


def undistort(lens: np.ndarray, xs: np.ndarray, ys: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The points that are seen at (xs, ys); NaN where none is."""
    limit = reach(lens)
    # Begin where the radial part alone puts the point, or at the end of the lens.
    end = min(math.sqrt(limit), 1e8)
    rs = np.hypot(xs, ys)
    low, high = np.zeros_like(rs), np.full_like(rs, end)
    for _ in range(60):
        middle = 0.5 * (low + high)
        beyond = distort(np.array([*lens[:6], 0, 0]), middle, np.zeros_like(middle))[0] > rs
        low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
    x, y = (v * high / np.where(rs > 0, rs, 1.0) for v in (xs, ys))
    for _ in range(STEPS):
        fx, fy, (xx, xy, yy) = distort(lens, x, y)
        fx, fy, det = fx - xs, fy - ys, xx * yy - xy * xy
        step = (yy * fx - xy * fy) / det, (xx * fy - xy * fx) / det
        x, y = x - step[0], y - step[1]
    fx, fy, (xx, xy, yy) = distort(lens, x, y)
    close = np.hypot(fx - xs, fy - ys) <= 1e-12 * (1 + rs)
    seen = close & (x * x + y * y <= limit) & (xx * yy > xy * xy) & (xx + yy > 0)
    return np.where(seen, x, np.nan), np.where(seen, y, np.nan)


@kernel
def bend(camera: Table, at: i64, x: f64, y: f64, tangential: bool) -> Bent:
    """Distort a point; the lens' numbers stand at word `at`."""
    k1, k2, k3 = f64_at(camera, at + K1), f64_at(camera, at + K2), f64_at(camera, at + K3)
    k4, k5, k6 = f64_at(camera, at + K4), f64_at(camera, at + K5), f64_at(camera, at + K6)
    p1, p2 = f64_at(camera, at + P1), f64_at(camera, at + P2)
    if not tangential:
        p1, p2 = 0.0, 0.0
    s = x * x + y * y
    under = 1.0 + s * (k4 + s * (k5 + s * k6))
    c = (1.0 + s * (k1 + s * (k2 + s * k3))) / under
    slope = 2.0 * ((k1 + s * (2.0 * k2 + 3.0 * s * k3)) - c * (k4 + s * (2.0 * k5 + 3.0 * s * k6))) / under
    return Bent(
        x * c + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x),
        y * c + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y,
        c + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x,
        slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y,
        c + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x,
    )


@kernel
def radius_before(camera: Table, at: i64, rs: f64) -> f64:
    """The radius that the radial part moves to `rs`, or that of the lens' rim: Newton's method between brackets."""
    low, high = 0.0, min(math.sqrt(f64_at(camera, at + REACH)), 1e8)
    r = min(rs, high)
    for _ in range(STEPS):
        b = bend(camera, at, r, 0.0, False)
        if b.x > rs:
            high = r
        else:
            low = r
        step = (b.x - rs) / b.xx
        if not low <= r - step <= high:  # also where the slope is zero
            step = r - 0.5 * (low + high)
        r -= step
        if abs(step) <= PRECISION * r:
            break
    return r


@kernel
def unbend(camera: Table, at: i64, xs: f64, ys: f64) -> Plain:
    """The point that is seen at (xs, ys): Newton's method from where the radial part alone puts it."""
    rs = math.sqrt(xs * xs + ys * ys)
    if rs == 0.0 and f64_at(camera, at + P1) == 0.0 and f64_at(camera, at + P2) == 0.0:
        return Plain(0.0, 0.0, True)
    scale = radius_before(camera, at, rs) / rs if rs > 0.0 else 0.0
    x, y = xs * scale, ys * scale
    for _ in range(STEPS):
        b = bend(camera, at, x, y, True)
        fx, fy, det = b.x - xs, b.y - ys, b.xx * b.yy - b.xy * b.xy
        dx, dy = (b.yy * fx - b.xy * fy) / det, (b.xx * fy - b.xy * fx) / det
        x, y = x - dx, y - dy
        if abs(dx) + abs(dy) <= PRECISION * (abs(x) + abs(y)):
            break
    b = bend(camera, at, x, y, True)
    close = abs(b.x - xs) + abs(b.y - ys) <= 1e-12 * (1.0 + rs)
    seen = x * x + y * y <= f64_at(camera, at + REACH)
    return Plain(x, y, close and seen and b.xx * b.yy > b.xy * b.xy and b.xx + b.yy > 0.0)
