"""Rotations as matrices, unit quaternions (w, x, y, z) and rotation vectors, in radians; Hamilton's product.

References: S. Shepperd, "Quaternion from rotation matrix", Journal of Guidance and Control 1(3), 1978; K. Shoemake,
"Animating rotation with quaternion curves", SIGGRAPH 1985.
"""

from __future__ import annotations

import math

import numpy as np


def quaternion(rotation: np.ndarray) -> np.ndarray:
    """The quaternion with w >= 0 of a rotation matrix, (3, 3): the largest component first, for accuracy."""
    m = rotation
    trace = m[0, 0] + m[1, 1] + m[2, 2]
    which = int(np.argmax([trace, m[0, 0], m[1, 1], m[2, 2]]))
    if which == 0:
        q = np.array([1 + trace, m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])
    else:
        i = which - 1
        j, k = (i + 1) % 3, (i + 2) % 3
        q = np.empty(4)
        q[0] = m[k, j] - m[j, k]
        q[1 + i] = 1 + m[i, i] - m[j, j] - m[k, k]
        q[1 + j], q[1 + k] = m[i, j] + m[j, i], m[i, k] + m[k, i]
    q /= np.linalg.norm(q)
    return -q if q[0] < 0 else q


def matrix(q: np.ndarray) -> np.ndarray:
    """The rotation matrix, (3, 3), of a unit quaternion."""
    w, x, y, z = q
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def times(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The rotation b, and then a."""
    v, w = a[1:], b[1:]
    return np.concatenate([[a[0] * b[0] - v @ w], a[0] * w + b[0] * v + np.cross(v, w)])


def exp(vector: np.ndarray) -> np.ndarray:
    """The quaternion of a turn about `vector` by its length, radians."""
    angle = float(np.linalg.norm(vector))
    half = 0.5 * angle
    share = math.sin(half) / angle if angle > 1e-8 else 0.5 - angle * angle / 48
    return np.concatenate([[math.cos(half)], share * vector])


def log(q: np.ndarray) -> np.ndarray:
    """The rotation vector, of at most half a turn, of a unit quaternion."""
    q = -q if q[0] < 0 else q
    size = float(np.linalg.norm(q[1:]))
    angle = 2 * math.atan2(size, q[0])
    return q[1:] * (angle / size if size > 1e-12 else 2.0)


def between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The rotation vector that leads from a to b on the shorter way, in the frame of a."""
    return log(times(a * np.array([1, -1, -1, -1]), b))


def slerp(a: np.ndarray, b: np.ndarray, share: float) -> np.ndarray:
    """The quaternion at `share` of the shorter way from a to b, at even speed; beyond 0 and 1, too."""
    return times(a, exp(share * between(a, b)))
