"""`Transform`: an invertible affine map, and the kernels that apply one to points, vectors and normals."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import kernel
from sightray.errors import SceneError
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, vec3_at
from sightray.mathlib.vec import Vec3, dot


class Transform:
    """An invertible affine map of space: ``matrix`` (4, 4) float64, ``world_from_object`` unless said otherwise.

    Maps compose with ``@``, the right one first: ``Transform.translate(0, 1, 0) @ Transform.scale(2)`` doubles, then
    lifts. Angles are in degrees; rotations are right-handed.
    """

    __slots__ = ("inverse", "matrix")

    matrix: np.ndarray
    inverse: np.ndarray

    def __init__(self, matrix: Any = None):
        if isinstance(matrix, Transform):
            matrix = matrix.matrix
        try:
            m = np.eye(4) if matrix is None else np.array(matrix, dtype=np.float64)
        except (TypeError, ValueError):
            raise SceneError(f"got {matrix!r}; allowed: a 4x4 matrix of numbers") from None
        if m.shape != (4, 4) or not np.isfinite(m).all():
            raise SceneError(f"got an array of shape {m.shape}; allowed: a 4x4 matrix of finite numbers")
        if (m[3] != (0, 0, 0, 1)).any():
            raise SceneError(f"the last row is {m[3].tolist()}; allowed: [0, 0, 0, 1] (affine maps only)")
        object.__setattr__(self, "matrix", m)
        object.__setattr__(self, "inverse", _inverse(m))
        m.flags.writeable = self.inverse.flags.writeable = False

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError("Transform is immutable")

    @classmethod
    def translate(cls, x: float, y: float, z: float) -> Transform:
        """Move by (x, y, z) metres."""
        m = np.eye(4)
        m[:3, 3] = x, y, z
        return cls(m)

    @classmethod
    def scale(cls, x: float, y: float | None = None, z: float | None = None) -> Transform:
        """Stretch along the axes; one number stretches alike."""
        return cls(np.diag([x, x if y is None else y, x if z is None else z, 1.0]))

    @classmethod
    def rotate(cls, axis: Any, degrees: float) -> Transform:
        """Turn about an axis through the origin, counter-clockwise if it points at the viewer (Rodrigues, 1840)."""
        a = np.asarray(axis, dtype=np.float64)
        size = np.linalg.norm(a)
        if a.shape != (3,) or not np.isfinite(size) or size == 0:
            raise SceneError(f"rotation axis: got {axis!r}; allowed: three finite numbers, not all zero")
        x, y, z = a / size
        angle = math.radians(degrees)
        c, s = math.cos(angle), math.sin(angle)
        skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        m = np.eye(4)
        m[:3, :3] = c * np.eye(3) + s * skew + (1 - c) * np.outer((x, y, z), (x, y, z))
        return cls(m)

    def __matmul__(self, other: Transform) -> Transform:
        return Transform(self.matrix @ other.matrix)

    def point(self, p: Any) -> np.ndarray:
        """Map points, (..., 3)."""
        return np.asarray(p, np.float64) @ self.matrix[:3, :3].T + self.matrix[:3, 3]

    def direction(self, d: Any) -> np.ndarray:
        """Map vectors, (..., 3): no translation."""
        return np.asarray(d, np.float64) @ self.matrix[:3, :3].T

    def normal(self, n: Any) -> np.ndarray:
        """Map normals, (..., 3), by the inverse transpose; not normalised."""
        return np.asarray(n, np.float64) @ self.inverse[:3, :3]

    def box(self, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Box around the image of a box, each (3,): infinite in all directions if the box is in any.

        Interval arithmetic of an affine map (J. Arvo, "Transforming axis-aligned bounding boxes", Graphics Gems, 1990).
        """
        if self.is_identity:
            return lower, upper
        if not (np.isfinite(lower).all() and np.isfinite(upper).all()):
            return np.full(3, -np.inf), np.full(3, np.inf)
        a, b = self.matrix[:3, :3] * lower, self.matrix[:3, :3] * upper
        return self.matrix[:3, 3] + np.minimum(a, b).sum(1), self.matrix[:3, 3] + np.maximum(a, b).sum(1)

    @property
    def is_identity(self) -> bool:
        """Whether nothing moves."""
        return self is IDENTITY or bool((self.matrix == IDENTITY.matrix).all())

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Transform) and bool((self.matrix == other.matrix).all())

    def __hash__(self) -> int:
        return hash(self.matrix.tobytes())

    def __repr__(self) -> str:
        return f"Transform({self.matrix.tolist()})"


def _inverse(m: np.ndarray) -> np.ndarray:
    """Inverse of an affine matrix; singular means that the three axes do not span space to 1e-12 of their lengths."""
    axes = m[:3, :3]
    volume = abs(np.linalg.det(axes))
    if not volume > 1e-12 * np.prod(np.linalg.norm(axes, axis=0)):
        raise SceneError(f"singular transform (determinant {np.linalg.det(axes):g}); allowed: an invertible matrix")
    inverse = np.eye(4)
    inverse[:3, :3] = np.linalg.inv(axes)
    inverse[:3, 3] = -inverse[:3, :3] @ m[:3, 3]
    return inverse


IDENTITY = Transform()


def as_transform(value: Any) -> Transform:
    """A transform as it is, None as the identity, anything else as a 4x4 matrix."""
    if isinstance(value, Transform):
        return value
    return IDENTITY if value is None else Transform(value)


COLUMNS_WORDS = 16


def put_columns(table: Table, word: int, matrix: np.ndarray) -> None:
    """Store a matrix for the kernels below: four columns of four words."""
    table.view(np.float64)[word : word + COLUMNS_WORDS] = matrix.T.ravel()


@kernel
def transform_point(table: Table, at: i64, p: Vec3) -> Vec3:
    """Map a point by the matrix whose columns stand at word `at`."""
    return transform_vector(table, at, p) + vec3_at(table, at + 12)


@kernel
def transform_vector(table: Table, at: i64, v: Vec3) -> Vec3:
    """Map a vector by the matrix whose columns stand at word `at`."""
    return vec3_at(table, at) * v.x + vec3_at(table, at + 4) * v.y + vec3_at(table, at + 8) * v.z


@kernel
def transform_normal(table: Table, inverse_at: i64, n: Vec3) -> Vec3:
    """Map a normal by the transpose of the inverse matrix whose columns stand at word `inverse_at`."""
    x, y, z = vec3_at(table, inverse_at), vec3_at(table, inverse_at + 4), vec3_at(table, inverse_at + 8)
    return Vec3(dot(x, n), dot(y, n), dot(z, n))
