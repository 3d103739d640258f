"""Ever smaller versions of a picture, each texel the mean of what it covers.

Reference: L. Williams, "Pyramidal parametrics", SIGGRAPH 1983.
"""

from __future__ import annotations

import numpy as np

FEW, MANY = 8, 32  # parts of the sides of a triangle over which a mean is taken: of small ones, of large ones


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


def means_over(picture: np.ndarray, corners: np.ndarray, wrap: str) -> np.ndarray:
    """About the mean of a picture, (h, w, 1), over each of n triangles, (n, 3, 2) in u and v: (n,) float64.

    Each is asked at some points, on the level whose texels are about as large as their distances, so that a small bright
    spot is not missed.
    """
    edges = (corners - np.roll(corners, 1, axis=1)) * picture.shape[1::-1]
    longest = np.linalg.norm(edges, axis=2).max(axis=1)  # in texels
    found = np.zeros(len(corners))
    for parts, chosen in ((FEW, longest <= FEW), (MANY, longest > FEW)):
        if chosen.any():
            found[chosen] = _means_at(picture, corners[chosen], longest[chosen], wrap, parts)
    return found


def _means_at(picture: np.ndarray, corners: np.ndarray, longest: np.ndarray, wrap: str, parts: int) -> np.ndarray:
    """The same from the middles of the parts whose sides are a `parts`-th of the triangle's."""
    sizes, smaller = pyramid(picture)
    texels = np.concatenate([picture.reshape(-1), smaller[:, 0]])
    firsts = sizes[:, 2] + np.where(np.arange(len(sizes)) > 0, picture.size, 0)
    level = np.clip(np.ceil(np.log2(np.maximum(longest / parts, 1.0))).astype(int), 0, len(sizes) - 1)

    i, j = (np.array(part) for part in zip(*[(i, j) for i in range(parts) for j in range(parts - i)], strict=True))
    weights = np.stack([i + 1 / 3, j + 1 / 3, parts - i - j - 2 / 3], axis=1) / parts
    uv = np.einsum("kc,ncx->nkx", weights, corners)
    wide, high = (sizes[level, axis][:, None] for axis in (0, 1))
    column, row = (wrapped_to(np.floor(uv[..., axis] * size), size, wrap) for axis, size in ((0, wide), (1, high)))
    return np.asarray(texels[firsts[level][:, None] + (high - 1 - row) * wide + column].mean(axis=1), np.float64)


def wrapped_to(i: np.ndarray, n: np.ndarray, wrap: str) -> np.ndarray:
    """Whole numbers brought into 0 ... n - 1, as `Bitmap` wraps them."""
    if wrap == "repeat":
        i = i % n
    elif wrap == "mirror":
        i = i % (2 * n)
        i = np.where(i >= n, 2 * n - 1 - i, i)
    return np.asarray(np.clip(i, 0, n - 1), np.int64)


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
