"""Small meshes put together into one, so that a ray walks one tree instead of one for each.

A room of boxes and panels is a handful of meshes of two or twelve triangles; preparing a ray for each costs more than
meeting them. Meshes with few triangles that stand in the world as they are, once, are therefore joined for the tree
alone: what a hit reports, and how it is shaded, still belongs to the mesh that it came from. Moved ones are left alone,
because vertices moved into the world would be rounded, and hits then not the same to the last digit.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from sightray.shapes.mesh import Mesh

SMALL = 4096  # triangles; a larger mesh's own tree is worth keeping between scenes
MOST = 200_000  # triangles in all


class Merged(NamedTuple):
    """Several meshes as one."""

    mesh: Mesh
    members: list[int]  # numbers of the items that went into it
    origin: np.ndarray  # (m, 2) int32: item and triangle of each of its triangles


def merge_small_meshes(items: Sequence[Any]) -> Merged | None:
    """Join what is worth joining among a scene's items; None if nothing is."""
    shown = Counter(id(item.shape) for item in items if isinstance(item.shape, Mesh))
    small = [
        index
        for index, item in enumerate(items)
        if shown[id(item.shape)] == 1
        and item.transform.is_identity
        and item.placement is None
        and len(item.shape.faces) <= SMALL
    ]
    total = np.cumsum([len(items[index].shape.faces) for index in small])
    small = small[: int(np.searchsorted(total, MOST, side="right"))]
    if len(small) < 2:
        return None
    vertices, faces, origin, first = [], [], [], 0
    for index in small:
        mesh = items[index].shape
        vertices.append(mesh.vertices)
        faces.append(mesh.faces + first)
        origin.append(np.stack([np.full(len(mesh.faces), index), np.arange(len(mesh.faces))], axis=1))
        first += len(mesh.vertices)
    joined = Mesh.joined(np.concatenate(vertices), np.concatenate(faces))
    return Merged(joined, small, np.ascontiguousarray(np.concatenate(origin), np.int32))
