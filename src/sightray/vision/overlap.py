"""Whether bodies run into one another: exactly, for triangle meshes.

Two surfaces of triangles meet if and only if an edge of one passes through a triangle of the other (T. Möller, "A fast
triangle-triangle intersection test", 1997, tests that pair by pair). Edges are asked as rays against the other body's tree
of boxes, so nothing else is looked at than what lies near. Bodies whose surfaces do not meet overlap only if one lies within
the other, which closed meshes tell by `Scene.contains`.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from sightray.scene.closed import open_edges
from sightray.scene.compile import flatten
from sightray.scene.scene import Scene
from sightray.shapes.mesh import Mesh

_BOX = ((0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4), (2, 6, 3), (3, 6, 7), (0, 4, 2), (2, 4, 6),
        (1, 3, 5), (3, 7, 5))  # fmt: skip


class Solid:
    """What takes up room, in its own frame: the triangles of meshes, and the boxes around other shapes.

    Parameters
    ----------
    thing : a shape, group or instance with an end.
    """

    def __init__(self, thing: Any):
        meshes = [_mesh(item) for item in flatten(Scene(thing))]
        self.scene = Scene(*meshes)
        self.points = np.concatenate([mesh.vertices[np.unique(mesh.faces)] for mesh in meshes])
        starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
        vertices = np.concatenate([mesh.vertices for mesh in meshes])
        faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)])
        edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        edges = np.unique(edges, axis=0)
        self.from_, self.to = vertices[edges[:, 0]], vertices[edges[:, 1]]
        self.lower, self.upper = self.points.min(axis=0), self.points.max(axis=0)
        self.meshes = meshes

    @cached_property
    def closed(self) -> bool:
        """Whether it has an inside."""
        return all(open_edges(mesh) == 0 for mesh in self.meshes)

    def lowest(self, matrix: np.ndarray) -> float:
        """The least y of all points after a matrix, (4, 4)."""
        return float((self.points @ matrix[1, :3]).min() + matrix[1, 3])


def _mesh(item: Any) -> Mesh:
    """The triangles of an item, or of the box around it, where it stands."""
    if isinstance(item.shape, Mesh):
        if item.transform.is_identity:
            return item.shape
        return Mesh.joined(item.transform.point(item.shape.vertices), item.shape.faces)
    low, high = item.shape.bounds()
    corners = np.array([np.where((k >> np.arange(3)) & 1, high, low) for k in range(8)])
    faces = np.array(_BOX)
    a, b, c = (corners[faces[:, k]] for k in range(3))
    solid = np.linalg.norm(np.cross(b - a, c - a), axis=1) > 0  # a flat box has two sides only
    return Mesh.joined(item.transform.point(corners), faces[solid])


def overlap(a: Solid, world_from_a: np.ndarray, b: Solid, world_from_b: np.ndarray) -> bool:
    """Whether two bodies share a point; touching counts one way or the other. Matrices are (4, 4), affine."""
    if not _boxes_meet(a, world_from_a, b, world_from_b):
        return False
    b_from_a = np.linalg.inv(world_from_b) @ world_from_a
    a_from_b = np.linalg.inv(b_from_a)
    if _edge_meets(a, b_from_a, b) or _edge_meets(b, a_from_b, a):
        return True
    return _within(a, b_from_a, b) or _within(b, a_from_b, a)


def _boxes_meet(a: Solid, world_from_a: np.ndarray, b: Solid, world_from_b: np.ndarray) -> bool:
    """Whether the boxes around both in the world do."""
    ends = [_moved_box(solid, matrix) for solid, matrix in ((a, world_from_a), (b, world_from_b))]
    (low_a, high_a), (low_b, high_b) = ends
    return bool((low_a <= high_b).all() and (low_b <= high_a).all())


def _moved_box(solid: Solid, matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    p, q = matrix[:3, :3] * solid.lower, matrix[:3, :3] * solid.upper
    return matrix[:3, 3] + np.minimum(p, q).sum(axis=1), matrix[:3, 3] + np.maximum(p, q).sum(axis=1)


def _edge_meets(a: Solid, b_from_a: np.ndarray, b: Solid) -> bool:
    """Whether an edge of a passes through a triangle of b."""
    start, end = (points @ b_from_a[:3, :3].T + b_from_a[:3, 3] for points in (a.from_, a.to))
    near = ((np.minimum(start, end) <= b.upper) & (np.maximum(start, end) >= b.lower)).all(axis=1)
    start, end = start[near], end[near]
    return bool(len(start) and b.scene.occluded(start, end - start, 1.0).any())


def _within(a: Solid, b_from_a: np.ndarray, b: Solid) -> bool:
    """Whether a point of a lies inside of b."""
    if not b.closed:
        return False
    points = a.points @ b_from_a[:3, :3].T + b_from_a[:3, 3]
    points = points[((points > b.lower) & (points < b.upper)).all(axis=1)]
    return bool(len(points) and b.scene.contains(points).any())
