"""Ever smaller versions of a picture, each texel the mean of what it covers.

Reference: L. Williams, "Pyramidal parametrics", SIGGRAPH 1983.
"""

from __future__ import annotations

import numpy as np


def pyramid(picture: np.ndarray, most: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Levels of a picture, (h, w, channels): half as large each time, rounded up, down to one texel.

    Returns
    -------
    sizes : (n, 3) int64, columns, rows and first texel of each level; the first level is the picture itself
    texels : (m, channels) float32, those of the other levels, in which the first texels are counted
    """
    sizes, levels, level, first = [(picture.shape[1], picture.shape[0], 0)], [], picture.astype(np.float64), 0
    while max(level.shape[:2]) > 1 and (most is None or len(sizes) < most):
        level = _halved(_halved(level, 0), 1)
        sizes.append((level.shape[1], level.shape[0], first))
        levels.append(level.reshape(-1, picture.shape[2]))
        first += len(levels[-1])
    texels = np.concatenate(levels) if levels else np.zeros((1, picture.shape[2]))
    return np.array(sizes, np.int64), np.ascontiguousarray(texels, np.float32)


def _halved(a: np.ndarray, axis: int) -> np.ndarray:
    """Means over equal parts of an axis, half as many, rounded up: of an odd number, parts share a value between them."""
    n = a.shape[axis]
    m = (n + 1) // 2
    # The integral up to each part's end, of a function that is constant over each value.
    total = np.concatenate([np.zeros_like(a.take([0], axis)), np.cumsum(a, axis)], axis)
    ends = np.arange(m + 1) * (n / m)
    whole = np.minimum(np.floor(ends).astype(np.int64), n - 1)
    rest = np.expand_dims(ends - whole, tuple(range(1, a.ndim - axis)))
    integral = total.take(whole, axis) + rest * a.take(whole, axis)
    return np.diff(integral, axis=axis) * (m / n)
