"""Batched ray queries: arrays in, arrays out. The methods of `Scene` with these names are documented there."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from functools import cached_property, partial
from typing import Any

import numpy as np

from sightray._jit import is_compiled, native
from sightray.accelerators.bvh import pack_items
from sightray.accelerators.item import CUTOUT
from sightray.accelerators.item_packets import ITEM_ROOM_WORDS
from sightray.errors import SceneError
from sightray.mathlib.table import Table, aligned, table_at
from sightray.scene.columns import Column, Output, common_shape, numbers
from sightray.scene.compile import Compiled, compile_scene, world_bounds
from sightray.scene.crossings import LAYER_WORDS, MESH, OTHER
from sightray.scene.hits import Details, Hits, Layers
from sightray.scene.layer_kernels import count_of_rays, layers_of_rays, sieve_layers
from sightray.scene.many_kernels import any_of_many, closest_of_many
from sightray.scene.packet_kernels import FEW_ITEMS, any_of_few, closest_of_few, fast_of_few
from sightray.scene.parallel import run_chunks
from sightray.scene.query_kernels import any_of_rays, closest_of_rays, describe_hits
from sightray.scene.world import FLAGS, ITEMS
from sightray.shapes.mesh import Mesh

PRECISIONS = ("exact", "fast")
FEW_RAYS = 1 << 13  # fewer are not worth ten seconds for compiling packets, once, but take them if they are at hand
MANY_RAYS = 1 << 15  # that are worth the seconds which compiling packets for many items takes, once


class Asked:
    """A compiled scene, ready for queries; one for each scene, made by the first query."""

    def __init__(self, scene: Any):
        self.compiled: Compiled = compile_scene(scene)
        self.world = self.compiled.world
        items = self.compiled.items
        kinds = np.array([MESH if isinstance(item.shape, Mesh) else OTHER for item in items] or [OTHER], np.int32)
        self.kinds = self.compiled.tables.space.array(kinds)
        self.objects = np.array([item.object for item in items], np.int32)
        self.holes = bool(self.world.view(np.int64)[FLAGS] & CUTOUT)  # packets do not know that surfaces may have them
        self.packets = 0 < len(items) <= FEW_ITEMS and MESH in kinds and not self.holes
        self.many = len(items) > FEW_ITEMS and not self.holes
        self._tree: Table | None = None
        self._kernels: dict[Callable, Callable] = {}

    def kernel(self, function: Callable) -> Callable:
        """A kernel as machine code, with the methods that it needs filled in."""
        found = self._kernels.get(function)
        if found is None:
            self.compiled.tables.prepare(function)
            found = self._kernels[function] = native(function)
        return found

    def closest(self, n: int, precision: str) -> Callable:
        """The kernel for the nearest hits of n rays, with its scene: by packets where that is worth it."""
        by_packets = fast_of_few if precision == "fast" else closest_of_few
        if self.packets and (precision == "fast" or n >= FEW_RAYS or is_compiled(by_packets)):
            return self.with_room(by_packets, self.kinds, len(self.objects))
        if self.many and n >= MANY_RAYS:
            return self.with_room(closest_of_many)
        return partial(self.kernel(closest_of_rays), self.world)

    def any(self, n: int) -> Callable:
        """The kernel for any hit of n rays, with its scene."""
        if self.packets and (n >= FEW_RAYS or is_compiled(any_of_few)):
            return self.with_room(any_of_few, self.kinds, len(self.objects))
        if self.many and n >= MANY_RAYS:
            return self.with_room(any_of_many)
        return partial(self.kernel(any_of_rays), self.world)

    def with_room(self, function: Callable, *scene: Any) -> Callable:
        """A kernel of packets, with the rest of its scene, and with working memory for each thread."""
        run = partial(self.kernel(function), self.world, *scene)
        return lambda *arguments: run(*arguments, room())

    @cached_property
    def cut(self) -> bool:
        """Whether a mesh has slivers that stand in several leaves."""
        meshes = {id(item.shape): item.shape for item in self.compiled.items if isinstance(item.shape, Mesh)}
        return any(mesh.tree().cuts is not None for mesh in meshes.values())

    def tree(self) -> Table:
        """A tree over the items as they are: that of the world may have put small meshes together."""
        if self._tree is None:
            bounds = np.array([world_bounds(item) for item in self.compiled.items]).reshape(-1, 2, 3)
            table = table_at(self.world, ITEMS)
            self._tree = pack_items(self.compiled.tables.space, table, bounds[:, 0].copy(), bounds[:, 1].copy())
        return self._tree


_rooms = threading.local()


def room() -> Table:
    """Working memory of the calling thread."""
    found = vars(_rooms).get("room")
    if found is None:
        found = _rooms.room = Table(aligned(ITEM_ROOM_WORDS, np.int64))
    return found


def asked(scene: Any) -> Asked:
    """What queries need of a scene; kept with it."""
    found = vars(scene).get("_asked")
    if found is None:
        found = Asked(scene)
        object.__setattr__(scene, "_asked", found)
    return found


class Rays:
    """The rays of one batch, checked."""

    __slots__ = ("columns", "forms", "n", "shape", "t_min", "threads")

    def __init__(self, verb: str, origins: Any, directions: Any, t_max: Any, t_min: Any, precision: str, threads: Any):
        o, d = numbers(origins, 3, verb, "origins"), numbers(directions, 3, verb, "directions")
        ends = numbers(t_max, 1, verb, "t_max")
        if precision not in PRECISIONS:
            raise SceneError(f"{verb}: precision: got {precision!r}; allowed: {', '.join(PRECISIONS)}")
        if not isinstance(t_min, int | float | np.integer | np.floating) or isinstance(t_min, bool):
            raise SceneError(f"{verb}: t_min: got {t_min!r}; allowed: a number")
        self.threads = thread_option(verb, threads)
        self.t_min = float(t_min)
        self.shape = common_shape(verb, origins=o.shape[:-1], directions=d.shape[:-1], t_max=ends.shape)
        self.n = math.prod(self.shape)
        if self.n:
            self.columns = Column(o, self.shape, 3), Column(d, self.shape, 3), Column(ends, self.shape, 1)

    def arguments(self, first: int, last: int) -> tuple[Any, ...]:
        """Tables and forms of a chunk: origins, directions, ends."""
        o, d, ends = self.columns
        return o.chunk(first, last), o.form, d.chunk(first, last), d.form, ends.chunk(first, last), ends.form


def thread_option(verb: str, threads: Any) -> int | None:
    """Check the number of threads."""
    if threads is None or (isinstance(threads, int) and not isinstance(threads, bool) and 1 <= threads <= 4096):
        return threads
    raise SceneError(f"{verb}: threads: got {threads!r}; allowed: a whole number from 1 to 4096, or None")


def intersect(scene: Any, origins: Any, directions: Any, t_max: Any, t_min: Any, precision: str, threads: Any) -> Hits:
    rays, ready = Rays("intersect", origins, directions, t_max, t_min, precision, threads), asked(scene)
    n, run = rays.n, ready.closest(rays.n, precision)
    block = np.empty((5, n), np.int32)  # one piece of memory is allocated, and found by kernels, faster than four
    t, item, shape, primitive = block[:2].reshape(-1).view(np.float64), block[2], block[3], block[4]
    start = Output(t)
    outputs = (start, *(Output(a, start.address + k * n * 4) for k, a in ((2, item), (3, shape), (4, primitive))))

    def work(first: int, last: int, stop: Table) -> None:
        filled = [output.chunk(first, last) for output in outputs]
        run(*rays.arguments(first, last), rays.t_min, last - first, *filled, stop)

    run_chunks(n, work, rays.threads)
    answers = (t, shape, primitive, item)
    if len(rays.shape) != 1:
        answers = tuple(a.reshape(rays.shape) for a in answers)  # type: ignore[assignment]
    return Hits(*answers, lambda hits: _describe(ready, rays, hits))


def _describe(ready: Asked, rays: Rays, hits: Hits) -> Details:
    n, run = rays.n, ready.kernel(describe_hits)
    t, item, primitive = (a.reshape(-1) for a in (hits.t, hits.item, hits.primitive))
    uv, normal, shading, position = np.empty((n, 2)), np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3))
    arrays = [Output(a) for a in (t, item, primitive, uv, normal, shading, position)]

    def work(first: int, last: int, stop: Table) -> None:
        tables = [array.chunk(first, last) for array in arrays]
        run(ready.world, ready.kinds, *rays.arguments(first, last)[:4], last - first, *tables, stop)

    run_chunks(n, work, rays.threads)
    return Details(*(a.reshape((*rays.shape, a.shape[1])) for a in (uv, normal, shading, position)))


def occluded(
    scene: Any, origins: Any, directions: Any, t_max: Any, t_min: Any, precision: str, threads: Any
) -> np.ndarray:
    rays, ready = Rays("occluded", origins, directions, t_max, t_min, precision, threads), asked(scene)
    run = ready.any(rays.n)
    blocked = np.empty(rays.n + 16, np.uint8)  # kernels write four or sixteen answers at a time

    output = Output(blocked)

    def work(first: int, last: int, stop: Table) -> None:
        end = -(-last // 16) * 16
        run(*rays.arguments(first, last), rays.t_min, last - first, output.chunk(first, end), stop)

    run_chunks(rays.n, work, rays.threads)
    return blocked[: rays.n].view(np.bool_).reshape(rays.shape)


def count(scene: Any, origins: Any, directions: Any, t_max: Any, t_min: Any, threads: Any) -> np.ndarray:
    rays, ready = Rays("count", origins, directions, t_max, t_min, "exact", threads), asked(scene)
    counts = np.zeros(rays.n, np.int64)
    if ready.holes or ready.cut:
        _layers(ready, rays, counts, lambda first, rows: None)
        return counts.reshape(rays.shape)
    tree, run = ready.tree(), ready.kernel(count_of_rays)

    def work(first: int, last: int, stop: Table) -> None:
        arguments = rays.arguments(first, last)
        run(tree, ready.kinds, *arguments, rays.t_min, last - first, Table(counts[first:last]), stop)

    run_chunks(rays.n, work, rays.threads)
    return counts.reshape(rays.shape)


def _layers(ready: Asked, rays: Rays, counts: np.ndarray, keep: Callable[[int, np.ndarray], None]) -> None:
    """Fill `counts`, and give the crossings of rays from a number on to `keep`, a few thousand rays at a time."""
    tree, run = ready.tree(), ready.kernel(layers_of_rays)
    sieve = ready.kernel(sieve_layers) if ready.holes else None

    def work(first: int, last: int, stop: Table) -> None:
        columns, n, ray = rays.arguments(first, last), last - first, 0
        number = Table(counts[first:last])
        capacity = 4 * n + 64
        while ray < n:
            rows = aligned((capacity, LAYER_WORDS), np.int64)
            done = run(tree, ready.kinds, *columns, rays.t_min, n, ray, Table(rows), capacity, number, stop)
            if done == ray:
                capacity *= 4
                continue
            if sieve is not None:
                sieve(ready.world, ready.kinds, *columns[:4], ray, done, Table(rows), number, stop)
            keep(first + ray, rows[: counts[first + ray : first + done].sum()])
            ray = done

    run_chunks(rays.n, work, rays.threads)


def intersect_all(scene: Any, origins: Any, directions: Any, t_max: Any, t_min: Any, threads: Any) -> Layers:
    rays, ready = Rays("intersect_all", origins, directions, t_max, t_min, "exact", threads), asked(scene)
    counts, parts = np.zeros(rays.n, np.int64), {0: np.empty((0, LAYER_WORDS), np.int64)}
    _layers(ready, rays, counts, lambda first, rows: parts.update({first: rows.copy()}))
    rows = np.concatenate([parts.pop(key) for key in sorted(parts)])
    item = rows[:, 1].astype(np.int32)
    return Layers(
        np.concatenate([np.zeros(1, np.int64), np.cumsum(counts)]), np.repeat(np.arange(rays.n), counts),
        rows[:, 0].copy().view(np.float64), ready.objects[item], rows[:, 2].astype(np.int32), rows[:, 3] != 0, item,
    )  # fmt: skip
