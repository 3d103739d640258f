"""How a body lies when it is put down: rolling from any attitude until it rests on a face of its convex hull."""

from __future__ import annotations

import math

import numpy as np

from sightray.mathlib.transform import Transform

MAX_ROLLS = 200
LEVEL = 1e-12  # of the body's size: what counts as touching the ground


def resting(points: np.ndarray, center: np.ndarray, start: np.ndarray) -> np.ndarray:
    """The rotation, (3, 3), in which a body lies on level ground, y up.

    Parameters
    ----------
    points : (n, 3), of which the body is the convex hull.
    center : (3,), its centre of mass.
    start : (3, 3), the attitude in which it is let go, rolling without a slip or swing.

    The body tips over the lowest point, then over edges, each time to the side on which its centre is, until the centre is
    above the triangle on which it stands. Each roll brings the centre lower, so it ends.
    """
    turn = np.array(start, np.float64)
    size = float(np.ptp(points, axis=0).max())
    for _ in range(MAX_ROLLS):
        p, c = points @ turn.T, turn @ center
        p0 = p[np.argmin(p[:, 1])]
        down = p[p[:, 1] - p0[1] <= LEVEL * size][:, [0, 2]] - p0[[0, 2]]  # footprint, (x, z)
        over = (c - p0)[[0, 2]]
        edge = _edge_towards(down, over, LEVEL * size)
        if edge is None:
            return turn
        at, along = edge
        pivot = p0 + np.array([at[0], 0.0, at[1]])
        turn = _tip(p - pivot, c - pivot, along, LEVEL * size) @ turn
    return turn


def _edge_towards(footprint: np.ndarray, over: np.ndarray, tiny: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Point and direction, (x, z), of the axis over which the body tips; None if it stands.

    `over` is where the centre is; it tips over the side of the footprint's hull beyond which that lies.
    """
    hull = _hull(footprint, tiny)
    if len(hull) == 1:
        away = over - hull[0]
        size = np.linalg.norm(away)
        return hull[0], (np.array([-away[1], away[0]]) / size if size > 0 else np.array([1.0, 0.0]))
    worst, found = -tiny if len(hull) > 2 else -math.inf, None
    for a, b in zip(hull, np.roll(hull, -1, axis=0), strict=True):
        along = (b - a) / np.linalg.norm(b - a)
        beyond = float(along[1] * (over - a)[0] - along[0] * (over - a)[1])  # to the right: outside
        if beyond > worst:
            worst, found = beyond, (a, along)
    return found if worst > tiny or len(hull) == 2 else None


def _tip(p: np.ndarray, c: np.ndarray, along: np.ndarray, tiny: float) -> np.ndarray:
    """The rotation about a level axis through the origin, towards the centre, until the next point touches the ground."""
    axis = np.array([along[0], 0.0, along[1]])
    ahead = np.cross([0.0, 1.0, 0.0], axis)
    if c @ ahead < 0:
        ahead, axis = -ahead, -axis
    height, forward = p[:, 1], p @ ahead
    angles = np.arctan2(height, forward)  # those behind the axis have more than 90 degrees to go
    free = (np.hypot(height, forward) > tiny) & ~((np.abs(height) <= tiny) & (forward <= tiny))
    free &= angles > 1e-13
    angle = float(angles[free].min()) if free.any() else 0.0
    return Transform.rotate(axis, -math.degrees(angle)).matrix[:3, :3]


def _hull(points: np.ndarray, tiny: float) -> np.ndarray:
    """Corners of the convex hull of points in the plane, counter-clockwise (A. Andrew's monotone chain, 1979)."""
    points = np.unique(points, axis=0)
    if np.linalg.norm(np.ptp(points, axis=0)) <= tiny:
        return points[:1]
    chains = []
    for line in (points, points[::-1]):
        chain: list[np.ndarray] = []
        for p in line:
            while len(chain) > 1 and _left(chain[-2], chain[-1], p) <= tiny * tiny:
                chain.pop()
            chain.append(p)
        chains.append(chain[:-1])
    return np.array(chains[0] + chains[1])


def _left(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
    """Twice the area of a triangle, positive if it runs counter-clockwise."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
