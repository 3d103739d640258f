"""Perlin's gradient noise, and sums of it. What `Noise`, `Wood` and `Marble` are made of.

Noise is 0 at the points of a lattice and has a gradient there, drawn from the twelve directions to the middles of a
cube's edges; in between it is blended by 6t⁵ - 15t⁴ + 10t³, whose second derivative is continuous. Here a hash of the
lattice point draws the gradient, where the paper has a table.

References: K. Perlin, "An image synthesizer", SIGGRAPH 1985; "Improving noise", SIGGRAPH 2002.
"""

from __future__ import annotations

import numpy as np

from sightray._jit import kernel
from sightray.mathlib.rng import stream
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.vec import Vec3

FARTHEST = 1e9  # lattice cells; beyond, noise is 0
NEXT = 1_000_003  # between the seeds of octaves, so that patterns of neighbouring seeds share none
FOLDED_MEAN = 0.2201  # of the absolute value of noise


@kernel
def fade(t: f64) -> f64:
    """From 0 to 1, level at both ends with its first and second derivative."""
    return t * t * t * (t * (t * 6.0 - 15.0) + 10.0)


@kernel
def slope(key: i64, k: i64, x: f64, y: f64, z: f64) -> f64:
    """Product of a lattice point's gradient and the way from there; `key` names its x and y, `k` is its z."""
    direction = ((stream(key, k) >> 33) & 0x7FFFFFFF) % 12
    across = direction >> 2  # the axis that the gradient stands across
    a = x if across > 0 else y
    b = y if across == 2 else z
    return (a if direction & 1 == 0 else -a) + (b if direction & 2 == 0 else -b)


@kernel
def noise(p: Vec3, seed: i64) -> f64:
    """Noise with cells of size 1: -1 to 1, in places 4 % more; mean 0."""
    if not (abs(p.x) < FARTHEST and abs(p.y) < FARTHEST and abs(p.z) < FARTHEST):
        return 0.0
    fx, fy, fz = np.floor(p.x), np.floor(p.y), np.floor(p.z)
    i, j, k = int(fx), int(fy), int(fz)
    x, y, z = p.x - fx, p.y - fy, p.z - fz
    near, far = stream(seed, i), stream(seed, i + 1)
    k00, k01, k10, k11 = stream(near, j), stream(near, j + 1), stream(far, j), stream(far, j + 1)
    u, v, w = fade(x), fade(y), fade(z)
    low0 = slope(k00, k, x, y, z) * (1.0 - u) + slope(k10, k, x - 1.0, y, z) * u
    low1 = slope(k01, k, x, y - 1.0, z) * (1.0 - u) + slope(k11, k, x - 1.0, y - 1.0, z) * u
    z -= 1.0
    high0 = slope(k00, k + 1, x, y, z) * (1.0 - u) + slope(k10, k + 1, x - 1.0, y, z) * u
    high1 = slope(k01, k + 1, x, y - 1.0, z) * (1.0 - u) + slope(k11, k + 1, x - 1.0, y - 1.0, z) * u
    return (low0 * (1.0 - v) + low1 * v) * (1.0 - w) + (high0 * (1.0 - v) + high1 * v) * w


@kernel
def visible_at(width: f64) -> f64:
    """How much is left of a pattern under a footprint of some width, in cells: all of one half, nothing of one."""
    return min(max(2.0 - 2.0 * width, 0.0), 1.0)


@kernel
def octaves_of(p: Vec3, seed: i64, octaves: i64, gain: f64, width: f64, folded: bool) -> f64:
    """Noise, with each octave twice as fine and `gain` times as strong: fractal Brownian motion, -1 to 1.

    With `folded` absolute values are summed: turbulence, 0 to 1. Octaves finer than a footprint of some `width` fade
    away to their mean.
    """
    total, weight, strength = 0.0, 0.0, 1.0
    for octave in range(octaves):
        visible = visible_at(width)
        n = noise(p, seed + octave * NEXT) if visible > 0.0 else 0.0
        if folded:
            n = abs(n) * visible + FOLDED_MEAN * (1.0 - visible)
        else:
            n *= visible
        total += strength * n
        weight += strength
        strength *= gain
        p, width = p * 2.0, width * 2.0
    return total / weight
