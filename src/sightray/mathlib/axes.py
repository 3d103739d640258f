"""Axes across a normal: how flat and round shapes choose the directions of their texture coordinates."""

from __future__ import annotations

from typing import Any

import numpy as np

_NEARLY_VERTICAL = 1.0 - 1e-9


def unit(v: Any) -> np.ndarray:
    """The unit vector along `v`, without over- or underflow."""
    v = np.asarray(v, np.float64)
    v = v / np.abs(v).max()
    return v / np.linalg.norm(v)


def axes_across(normal: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit vectors (U, V, N) with N along `normal` and U × V = N.

    V points as far up (+y) as it can, and U to the right of someone who looks at the side the normal comes out of:
    what a picture on a wall does. On floors and ceilings, which have no up, V points to -z.
    """
    n = unit(normal)
    up = (0.0, 0.0, -1.0) if abs(n[1]) > _NEARLY_VERTICAL else (0.0, 1.0, 0.0)
    u = unit(np.cross(up, n))
    return u, np.cross(n, u), n
