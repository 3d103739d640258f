"""What a structure costs: seconds and bytes to build, nodes and tests for each ray, rays a second."""

from __future__ import annotations

import gc
import math
import time
from typing import Any, NamedTuple

import numpy as np

from sightray import _jit
from sightray._jit import kernel
from sightray.accelerators.base import Accelerator
from sightray.accelerators.primitives import _OverPrimitives
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Space, Table, f64_at, f64_put, i64_at, i64_put
from sightray.mathlib.tally import COUNTS, NODES, TESTS, counting
from sightray.mathlib.vec import Vec3
from sightray.scene.compile import Compiled, require_camera
from sightray.scene.world import find_closest
from sightray.shapes.mesh import Mesh

AT_LEAST = 0.2  # seconds to measure a speed for


class Survey(NamedTuple):
    """What a structure costs over a scene and some rays."""

    accelerator: str
    primitives: int  # single shapes, and triangles of meshes
    rays: int
    hits: int
    build_seconds: float
    bytes: int  # of the structure alone, without the geometry
    nodes_per_ray: float
    tests_per_ray: float
    mrays_per_second: float  # one thread, nearest hits, in the build that does not count


class Costs(NamedTuple):
    """What each ray met and cost."""

    t: np.ndarray  # (n,) float64; infinite for a miss
    hits: np.ndarray  # (n, 2) int64: item and primitive; -1 for a miss
    nodes: np.ndarray  # (n,) int64: nodes or cells visited
    tests: np.ndarray  # (n,) int64: primitives asked


@kernel
def trace_rays(world: Table, rays: Table, n: i64, counts: Table, t: Table, hits: Table, costs: Table) -> None:
    """Find the nearest hits of n rays, and how far the counters went meanwhile."""
    for i in range(n):
        o = Vec3(f64_at(rays, 6 * i), f64_at(rays, 6 * i + 1), f64_at(rays, 6 * i + 2))
        d = Vec3(f64_at(rays, 6 * i + 3), f64_at(rays, 6 * i + 4), f64_at(rays, 6 * i + 5))
        nodes, tests = i64_at(counts, NODES), i64_at(counts, TESTS)
        hit = find_closest(world, o, d, 0.0, math.inf)
        f64_put(t, i, hit.t)
        i64_put(hits, 2 * i, hit.item)
        i64_put(hits, 2 * i + 1, hit.prim)
        i64_put(costs, 2 * i, i64_at(counts, NODES) - nodes)
        i64_put(costs, 2 * i + 1, i64_at(counts, TESTS) - tests)


def camera_rays(scene: Any) -> np.ndarray:
    """Rays through the centres of all pixels, row by row: (height * width, 6) float64, origin and direction."""
    camera = require_camera(scene)
    x, y = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    o, d = camera.rays(np.stack([x.ravel(), y.ravel()], axis=1))
    return np.concatenate([o, d], axis=1)


def count_costs(scene: Any, accelerator: Accelerator, rays: np.ndarray | None = None) -> Costs:
    """Count what each ray costs: (n, 6) float64, by default those of the camera. Compiles kernels that count."""
    rays = np.ascontiguousarray(camera_rays(scene) if rays is None else rays, np.float64)
    compiled = Compiled(scene, accelerator)  # apart from others: its rows point at kernels that count
    with counting():
        compiled.tables.prepare(trace_rays)
        return _trace(compiled, rays)


def _trace(compiled: Compiled, rays: np.ndarray) -> Costs:
    n = len(rays)
    t, hits, costs = np.empty(n), np.empty((n, 2), np.int64), np.empty((n, 2), np.int64)
    _jit.native(trace_rays)(compiled.world, Table(rays), n, COUNTS, Table(t), Table(hits), Table(costs))
    return Costs(t, hits, costs[:, 0].copy(), costs[:, 1].copy())


def survey(scene: Any, accelerator: Accelerator, rays: np.ndarray | None = None) -> Survey:
    """Measure a structure over a scene: rays as for `count_costs`."""
    rays = np.ascontiguousarray(camera_rays(scene) if rays is None else rays, np.float64)
    measured = _measured(accelerator)
    compiled = Compiled(scene, measured)
    seconds, size = vars(measured)["_spent"]
    meshes = {id(item.shape): item.shape for item in compiled.items if isinstance(item.shape, Mesh)}
    if not isinstance(accelerator, _OverPrimitives):  # the meshes' own trees are part of what it needs
        for mesh in meshes.values():
            began = time.perf_counter()
            tree = mesh.replace().tree()
            seconds += time.perf_counter() - began
            size += _size(tree) - mesh.vertices.nbytes - mesh.faces.nbytes

    # Time the usual build, then count with the other.
    compiled.tables.prepare(trace_rays)
    _trace(compiled, rays[:64])
    times, spent = 0, 0.0
    gc.collect()
    began = time.perf_counter()
    while spent < AT_LEAST:
        _trace(compiled, rays)
        times, spent = times + 1, time.perf_counter() - began
    costs = count_costs(scene, accelerator, rays)
    return Survey(
        type(accelerator).__name__,
        sum(len(i.shape.faces) if isinstance(i.shape, Mesh) else 1 for i in compiled.items),
        len(rays), int(np.isfinite(costs.t).sum()), seconds, size,
        float(costs.nodes.mean()), float(costs.tests.mean()), len(rays) * times / spent / 1e6,
    )  # fmt: skip


def _measured(accelerator: Accelerator) -> Any:
    """The same accelerator, which remembers what building took: ``_spent``, seconds and bytes."""
    kind: Any = type(accelerator)

    def build_scene(self: Any, space: Space, *inputs: Any) -> Any:
        known = set(space.tables)
        began = time.perf_counter()
        row = kind.build_scene(self, space, *inputs)
        seconds = time.perf_counter() - began
        size = sum(len(table.bytes) for address, table in space.tables.items() if address not in known)
        object.__setattr__(self, "_spent", (seconds, size))
        return row

    return type("_Measured", (kind,), {"build_scene": build_scene})(**accelerator.values())


def _size(value: Any) -> int:
    """Bytes of all arrays in nested tuples."""
    if isinstance(value, np.ndarray):
        return value.nbytes
    return sum(map(_size, value)) if isinstance(value, tuple) else 0
