"""Meshes as files hold them: with triangles that have no area, and normals that are none."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.shapes.mesh import Mesh

SLIVER = 1e-15  # twice the area over the longest edge squared; what is below, a `Mesh` drops


def solid_mesh(vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray | None = None, **fields: Any) -> Any:
    """A `Mesh`; None where not one triangle has an area.

    Exporters write zeros for normals that they never computed: if a triangle uses one, all normals are left out.
    """
    faces = faces.astype(np.int32)
    if faces.size and 0 <= faces.min() <= faces.max() < len(vertices):
        a, b, c = (vertices[faces[:, corner]] for corner in range(3))
        longest = np.max([((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
        if np.isfinite(longest).all() and not (np.linalg.norm(np.cross(b - a, c - a), axis=1) > SLIVER * longest).any():
            return None
        if normals is not None and not normals[faces].any(axis=2).all():
            normals = None
    fields["normals"] = normals
    return Mesh(**{"vertices": vertices, "faces": faces, **fields})
