"""Queries that ask for the nearest point of meshes, and for what is inside of them."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.errors import SceneError, UnsupportedError
from sightray.lights.base import Light
from sightray.mathlib.table import Table, aligned
from sightray.scene.columns import Column, numbers
from sightray.scene.crossings import LAYER_WORDS
from sightray.scene.hits import ClosestPoints
from sightray.scene.nearest_kernels import nearest_of_points, windings_of_points
from sightray.scene.parallel import run_chunks
from sightray.scene.queries import Asked, asked, thread_option
from sightray.shapes.mesh import Mesh


class Points:
    """The points of one batch, checked."""

    def __init__(self, verb: str, points: Any, threads: Any):
        array = numbers(points, 3, verb, "points")
        self.threads = thread_option(verb, threads)
        self.shape = array.shape[:-1]
        self.n = array.size // 3
        self.column = Column(array, self.shape, 3)


def _meshes(scene: Any, verb: str) -> Asked:
    """The scene, if it holds nothing but meshes and lights."""
    ready = asked(scene)
    for item in ready.compiled.items:
        if not isinstance(item.shape, Mesh) and not isinstance(scene.objects[item.object], Light):
            name = f" '{item.name}'" if item.name else ""
            kind = type(item.shape).__name__
            raise UnsupportedError(f"{verb}: object {item.object}{name}: got a {kind}; allowed: meshes")
    return ready


def open_edges(mesh: Mesh) -> int:
    """Number of edges of a mesh that are not run through once in each direction by its triangles.

    Vertices at the same place count as one, so that seams of textures and files without shared vertices are closed.
    """
    _, same = np.unique(mesh.vertices, axis=0, return_inverse=True)
    faces = same.reshape(-1)[mesh.faces].astype(np.int64)
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    n = int(faces.max()) + 1
    sign = np.where(start < end, 1, -1)
    _, edge = np.unique(np.minimum(start, end) * n + np.maximum(start, end), return_inverse=True)
    return int(np.count_nonzero(np.bincount(edge.reshape(-1), weights=sign)))


def _closed_meshes(scene: Any, verb: str) -> Asked:
    """The scene, if all its meshes are closed; what is known of a mesh is kept with it."""
    ready = _meshes(scene, verb)
    for item in ready.compiled.items:
        if not isinstance(item.shape, Mesh):
            continue
        if "_open_edges" not in vars(item.shape):
            object.__setattr__(item.shape, "_open_edges", open_edges(item.shape))
        found = vars(item.shape)["_open_edges"]
        if found:
            name = f" '{item.name}'" if item.name else ""
            raise SceneError(
                f"{verb}: object {item.object}{name}: got a mesh with {found} open edges; allowed: closed meshes, each "
                "edge of which is shared by triangles that run through it in opposite directions"
            )
    return ready


def closest_point(scene: Any, points: Any, threads: Any, verb: str = "closest_point") -> ClosestPoints:
    batch, ready = Points(verb, points, threads), _meshes(scene, verb)
    if "_shrinks" not in vars(ready):
        sizes = [np.linalg.svd(item.transform.matrix[:3, :3])[1].min() for item in ready.compiled.items]
        vars(ready)["_shrinks"] = ready.compiled.tables.space.array(np.array(sizes or [1.0]))
    shrinks, run, n = vars(ready)["_shrinks"], ready.kernel(nearest_of_points), batch.n
    tree = ready.tree()
    near, uv, distance = np.empty((n, 3)), np.empty((n, 2)), np.empty(n)
    shape, primitive = np.empty(n, np.int32), np.empty(n, np.int32)

    def work(first: int, last: int, stop: Table) -> None:
        outputs = [Table(a[first:last]) for a in (near, distance, shape, primitive, uv)]
        column = batch.column
        run(tree, ready.kinds, shrinks, column.chunk(first, last), column.form, last - first, *outputs, stop)

    run_chunks(n, work, batch.threads)
    return ClosestPoints(
        near.reshape((*batch.shape, 3)), distance.reshape(batch.shape), shape.reshape(batch.shape),
        primitive.reshape(batch.shape), uv.reshape((*batch.shape, 2)),
    )  # fmt: skip


def contains(scene: Any, points: Any, threads: Any, verb: str = "contains") -> np.ndarray:
    batch, ready = Points(verb, points, threads), _closed_meshes(scene, verb)
    tree = ready.tree()
    run, windings = ready.kernel(windings_of_points), np.zeros(batch.n, np.int64)

    def work(first: int, last: int, stop: Table) -> None:
        table, form, capacity = batch.column.chunk(first, last), batch.column.form, 256
        while capacity:
            rows, out = aligned((capacity, LAYER_WORDS), np.int64), Table(windings[first:last])
            more = run(tree, ready.kinds, table, form, last - first, Table(rows), capacity, out, stop)
            capacity = 2 * more

    run_chunks(batch.n, work, batch.threads)
    return (windings != 0).reshape(batch.shape)


def signed_distance(scene: Any, points: Any, threads: Any) -> np.ndarray:
    inside = contains(scene, points, threads, "signed_distance")
    distance = closest_point(scene, points, threads, "signed_distance").distance
    return np.where(inside, -distance, distance)
