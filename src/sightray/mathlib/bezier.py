"""Bicubic Bézier patches: points, normals, and tessellation (P. Bézier, 1962; P. de Casteljau, 1959)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Grid(NamedTuple):
    """A tessellated patch."""

    vertices: np.ndarray  # (n, 3) float64
    normals: np.ndarray  # (n, 3) float64, unit
    uvs: np.ndarray  # (n, 2) float64
    faces: np.ndarray  # (m, 3) int32, counter-clockwise seen from where the normals point


def bernstein(t: np.ndarray) -> np.ndarray:
    """The four cubic Bernstein polynomials at t: (..., 4)."""
    s = 1 - t
    return np.stack([s**3, 3 * t * s**2, 3 * t**2 * s, t**3], axis=-1)


def bernstein_slope(t: np.ndarray) -> np.ndarray:
    """Their derivatives at t: (..., 4)."""
    s = 1 - t
    return np.stack([-3 * s**2, 3 * s**2 - 6 * t * s, 6 * t * s - 3 * t**2, 3 * t**2], axis=-1)


def tessellate(control: np.ndarray, segments: int) -> Grid:
    """Cut a patch into ``2 segments²`` triangles.

    `control` is (4, 4, 3); u runs along its first index, v along its second, and normals are v × u. Normals at points
    where an edge of the patch has collapsed are those of the surface just beside.
    """
    t = np.linspace(0.0, 1.0, segments + 1)
    vertices = np.einsum("ui,vj,ijk->uvk", bernstein(t), bernstein(t), control).reshape(-1, 3)
    inside = np.clip(t, 1e-4, 1 - 1e-4)
    along_u = np.einsum("ui,vj,ijk->uvk", bernstein_slope(inside), bernstein(inside), control)
    along_v = np.einsum("ui,vj,ijk->uvk", bernstein(inside), bernstein_slope(inside), control)
    normals = np.cross(along_v, along_u).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    uvs = np.stack(np.meshgrid(t, t, indexing="ij"), axis=-1).reshape(-1, 2)
    corner = (np.arange(segments)[:, None] * (segments + 1) + np.arange(segments)).ravel()
    right, up = corner + 1, corner + segments + 1
    faces = np.concatenate([np.stack([corner, right, up], 1), np.stack([right, up + 1, up], 1)])
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return Grid(vertices, normals, uvs, faces[area > 1e-12].astype(np.int32))


def merge(grids: list[Grid]) -> Grid:
    """Several tessellated patches as one list of triangles."""
    starts = np.cumsum([0] + [len(g.vertices) for g in grids[:-1]])
    return Grid(
        np.concatenate([g.vertices for g in grids]), np.concatenate([g.normals for g in grids]),
        np.concatenate([g.uvs for g in grids]),
        np.concatenate([g.faces + start for g, start in zip(grids, starts, strict=True)]).astype(np.int32),
    )  # fmt: skip
