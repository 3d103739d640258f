"""Polygons cut into triangles."""

from __future__ import annotations

import numpy as np

from sightray.errors import UnsupportedError

MAX_CORNERS = 2_000  # of a concave polygon: cutting ears takes time by the square of their number
TRIES = 20  # looks for an ear, per corner


def triangulate(corners: np.ndarray) -> np.ndarray:
    """Triangles of a simple plane polygon as indices into its corners: (n - 2, 3) int, same winding.

    Convex polygons become a fan. Others lose one ear at a time: a convex corner whose triangle holds no other corner
    (G. Meisters, "Polygons have ears", American Mathematical Monthly 82, 1975). What is left of an outline that crosses
    itself, where no ear can be found, becomes a fan too.

    Parameters
    ----------
    corners : (n, 3) float, in order, n >= 3.

    Raises
    ------
    UnsupportedError
        More than `MAX_CORNERS` corners in a concave outline.

    Examples
    --------
    >>> triangulate(np.array([[0, 0, 0], [2, 0, 0], [0.5, 0.5, 0], [0, 2, 0]])).tolist()  # an arrow head
    [[0, 1, 2], [0, 2, 3]]
    """
    n = len(corners)
    fan = np.stack([np.zeros(n - 2, np.int64), np.arange(1, n - 1), np.arange(2, n)], axis=1)
    if n == 3:
        return fan

    # Project along the largest axis of Newell's normal, so that the outline runs counter-clockwise.
    with np.errstate(over="ignore", invalid="ignore"):
        after = np.roll(corners, -1, axis=0)
        normal = np.cross(corners - corners[0], after - corners[0]).sum(axis=0)
        axis = int(np.argmax(np.abs(normal)))
        p = corners[:, [(axis + 1) % 3, (axis + 2) % 3]] * (1.0 if normal[axis] > 0 else np.array([-1.0, 1.0]))
        if (_turn(np.roll(p, 1, axis=0), p, np.roll(p, -1, axis=0)) >= 0).all():
            return fan
        if n > MAX_CORNERS:
            raise UnsupportedError(f"a concave polygon of {n} corners; allowed: {MAX_CORNERS}")
        return _cut_ears(p)


def _turn(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Twice the signed area of the triangle a b c; positive counter-clockwise."""
    return (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (c[..., 0] - a[..., 0])


def _cut_ears(p: np.ndarray) -> np.ndarray:
    """Ears of a counter-clockwise outline in the plane, (n, 2)."""
    left = list(range(len(p)))
    triangles: list[tuple[int, int, int]] = []
    at = skipped = tried = 0
    # A simple outline always has an ear, and rarely takes more than a few looks to find one; one that crosses itself
    # would take a look at all corners again and again.
    while len(left) > 3 and skipped <= len(left) and tried < TRIES * len(p):
        i, j, k = (left[(at + step) % len(left)] for step in (-1, 0, 1))
        tried += 1
        if _is_ear(p, i, j, k, left):
            triangles.append((i, j, k))
            del left[at]
            at, skipped = max(at - 1, 0), 0
        else:
            at, skipped = at + 1, skipped + 1
        at %= len(left)
    triangles += [(left[0], left[i], left[i + 1]) for i in range(1, len(left) - 1)]
    return np.array(triangles)


def _is_ear(p: np.ndarray, i: int, j: int, k: int, left: list[int]) -> bool:
    if not _turn(p[i], p[j], p[k]) > 0:
        return False
    others = p[[m for m in left if m not in (i, j, k)]]
    # A corner at the place of one of the ear's own does not count: outlines with holes visit a bridge twice.
    same = (others == p[i]).all(axis=1) | (others == p[j]).all(axis=1) | (others == p[k]).all(axis=1)
    inside = (_turn(p[i], p[j], others) >= 0) & (_turn(p[j], p[k], others) >= 0) & (_turn(p[k], p[i], others) >= 0)
    return not (inside & ~same).any()


def split_polygons(vertices: np.ndarray, counts: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Triangles of many polygons, in their order: (m, 3) int, indices into `corners`.

    Quadrilaterals are split along the diagonal that lies inside; all of them at once, since most files hold few others.

    Parameters
    ----------
    vertices : (n, 3) float.
    counts : (f,) int, corners of each polygon, each at least 3.
    corners : (sum of counts,) int, indices into `vertices`, polygon after polygon.

    Examples
    --------
    >>> square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> split_polygons(square, np.array([3, 4]), np.array([0, 1, 2, 0, 1, 2, 3])).tolist()
    [[0, 1, 2], [3, 4, 5], [3, 5, 6]]
    """
    first = np.cumsum(counts) - counts  # of each polygon, in `corners`
    at = np.cumsum(counts - 2) - (counts - 2)  # of each polygon, among the triangles
    triangles = np.empty((int((counts - 2).sum()), 3), np.int64)

    three = counts == 3
    triangles[at[three]] = first[three, None] + np.arange(3)

    four = np.flatnonzero(counts == 4)
    if len(four):
        a, b, c, d = (vertices[corners[first[four] + step]] for step in range(4))
        with np.errstate(over="ignore", invalid="ignore"):
            folded = (np.cross(b - a, c - a) * np.cross(c - a, d - a)).sum(axis=1) < 0  # the diagonal a c lies outside
        shift = np.where(folded, 1, 0)[:, None]
        triangles[at[four]] = first[four, None] + (np.array([0, 1, 2]) + shift) % 4
        triangles[at[four] + 1] = first[four, None] + (np.array([0, 2, 3]) + shift) % 4

    for polygon in np.flatnonzero(counts > 4):
        begin, n = first[polygon], counts[polygon]
        triangles[at[polygon] : at[polygon] + n - 2] = begin + triangulate(vertices[corners[begin : begin + n]])
    return triangles
