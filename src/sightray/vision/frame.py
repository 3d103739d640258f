"""A picture being labelled: its view and the others that it is compared with, and the pass that computes pixel layers."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from sightray import _jit
from sightray._jit import kernel
from sightray.accelerators.item import CLEAR, CUTOUT
from sightray.engine.progress import Callback, Progress
from sightray.errors import SceneError
from sightray.integrators.whitted import Whitted
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Space, Table, aligned, i64_at, link, scratch, table_at
from sightray.mathlib.transform import put_columns
from sightray.samplers.base import default_sampler
from sightray.scene.compile import Item
from sightray.scene.crossings import MESH
from sightray.scene.parallel import run_chunks
from sightray.scene.queries import asked
from sightray.scene.world import FLAGS
from sightray.vision import record as words
from sightray.vision import shelf
from sightray.vision.casting import cast_tile
from sightray.vision.extents import extent
from sightray.vision.layers.base import Layer, fill
from sightray.vision.picking import BOX_WORDS, MOST_CASTS
from sightray.vision.poses import object_pose
from sightray.vision.rolling import Rolling
from sightray.vision.sight import has_plane
from sightray.vision.view import Motion, View

_WHITTED, _SAMPLER = Whitted(), default_sampler()
_STEPS = aligned((2, 16), np.float64)
_STEPS[:] = np.arange(16) % 4, np.arange(16) // 4


@dataclass(frozen=True, eq=False)
class ObjectInfo:
    """One object of a labelled scene, as people and datasets know it.

    Attributes
    ----------
    index : its index in ``scene.objects``, and its value in the layer ``instance``.
    name : as the scene states it; may be empty.
    category : name of its class; an entry of ``labels.classes``.
    kind : type of the object, such as "Sphere" or "Group".
    world_from_object : (4, 4) float64, its pose (and scale); the identity where the scene states no transform.
    lower, upper : (3,) float64, metres: the box around it in its own frame; infinite for shapes without end.
    """

    index: int
    name: str
    category: str
    kind: str
    world_from_object: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


@kernel
def label_tiles(frame: Table, layers: Table, n_layers: i64, outputs: Table, first: i64, last: i64, stop: Table) -> None:
    """All pixel layers of the tiles `first` to ``last - 1``."""
    records = scratch(2048)
    for tile in range(first, last):
        if i64_at(stop, 0) != 0:
            return
        count = cast_tile(frame, tile, records)
        for k in range(n_layers):
            fill(table_at(layers, k), frame, records, count, table_at(outputs, k))


class Frame:
    """A picture being labelled. ``values`` holds the layers that are done, by label."""

    def __init__(self, view: View, *, next: View | None = None, previous: View | None = None,
                 stereo: View | None = None, classes: Any = None, keypoints: Any = None,
                 threads: int | None = None, progress: Callback | None = None):  # fmt: skip
        self.view, self.next, self.previous, self.stereo = view, next, previous, stereo
        self.keypoints, self.threads, self.progress = keypoints, threads, progress
        self.width, self.height = view.camera.width, view.camera.height
        self.compiled = view.compiled
        self.classes, self.class_of_item = number_classes(self.compiled.items, classes)
        self.values: dict[str, Any] = {}
        self._motions: dict[str, Motion] = {}
        self._rolling: dict[str, Rolling] = {}

    # ------------------------------------------------------------------------------------------------- what is there

    @cached_property
    def objects(self) -> tuple[ObjectInfo, ...]:
        """The objects that can be seen, lights with a surface among them, in the scene's order."""
        parts: dict[int, list[int]] = {}
        for number, item in enumerate(self.compiled.items):
            parts.setdefault(item.object, []).append(number)
        return tuple(self._object(index, parts[index]) for index in sorted(parts))

    def _object(self, index: int, numbers: list[int]) -> ObjectInfo:
        """An object from its index and the numbers of its items."""
        thing = self.view.middle.objects[index]
        pose = object_pose(thing)
        object_from_world = np.linalg.inv(pose)
        parts = (self.view.middle_items[k] for k in numbers)
        ends = np.array([extent(item.shape, object_from_world @ item.transform.matrix) for item in parts])
        lower, upper = ends[:, 0].min(axis=0), ends[:, 1].max(axis=0)
        name = getattr(thing, "name", "") or self.compiled.items[numbers[0]].name
        category = self.classes[self.class_of_item[numbers[0]]]
        return ObjectInfo(index, name, category, type(thing).__name__, pose, lower, upper)

    @cached_property
    def integrator(self) -> Whitted:
        """By which light is computed, for the layers that need light: the scene's own if it is `Whitted`."""
        given = self.view.scene.integrator
        return given if isinstance(given, Whitted) else _WHITTED

    @cached_property
    def materials(self) -> tuple[Any, ...]:
        """The different materials of the scene, in the order in which they are first used."""
        return tuple({id(item.material): item.material for item in self.compiled.items}.values())

    # --------------------------------------------------------------------------------------------- the other pictures

    def other(self, name: str) -> View:
        """The view ``next``, ``previous`` or ``stereo``; a `SceneError` if it was not given."""
        view = getattr(self, name)
        if view is None:
            raise SceneError(f"label: {name}: missing; give {name}=, such as a Scene with a camera")
        return view

    def rolls(self, name: str) -> bool:
        """Whether objects move while this picture's rows, or those of that view, are exposed one after the other."""
        return self.view.blurred or self.other(name).blurred

    def rolling(self, name: str) -> Rolling:
        """How everything moved to that view, each point until the time of the row that sees it."""
        if name not in self._rolling:
            self._rolling[name] = Rolling(self, self.view, self.other(name))
        return self._rolling[name]

    def motion(self, name: str) -> Motion:
        """How everything moved to that view, where nothing moves while rows are exposed: see `rolls`."""
        if name not in self._motions:
            self._motions[name] = Motion(self.view, self.other(name))
        return self._motions[name]

    def partner_items(self, name: str) -> np.ndarray:
        """For each item the one of that view that it became; -1 where it is gone."""
        return self.rolling(name).item if self.rolls(name) else self.motion(name).item

    def beside(self, name: str) -> Frame:
        """That view as a picture of its own."""
        return Frame(self.other(name), threads=self.threads, progress=self.progress)

    def kernel(self, root: Callable) -> Callable:
        """A kernel as machine code, with the methods that it needs; tells `progress` while it is compiled."""
        began = time.perf_counter()

        def report(done: int, total: int, name: str) -> None:
            if self.progress is not None:
                self.progress(Progress("compile", done, total, time.perf_counter() - began, 0, name))

        self.compiled.tables.prepare(root, report)
        return _jit.native(root)

    # --------------------------------------------------------------------------------------------------- pixel layers

    def row(self, names: np.ndarray | None = None) -> tuple[Table, Space]:
        """The frame as kernels read it, and what keeps it alive; with all details, and names of items for `paths`."""
        space = Space()
        row = self._row(space, 1, words.SURFACE)
        names = np.arange(len(self.compiled.items) + 1) if names is None else names
        link(row, words.PATH_NAMES, space.array(np.ascontiguousarray(names, np.int32)))
        return row, space

    def run(self, layers: list[Layer], scale: int = 1) -> list[np.ndarray]:
        """Compute pixel layers in one pass: arrays (height * scale, width * scale[, columns]), `scale`² rays a pixel."""
        if not layers:
            return []
        columns, rows = self.width * scale, self.height * scale
        tables, space = self.compiled.tables, Space()
        row = self._row(space, scale, max(layer.detail for layer in layers))
        if any(layer.object_frames for layer in layers):
            link(row, words.OBJECT_FRAMES, self._object_frames(space))
        handles, outputs = space.row(len(layers)), space.row(len(layers))
        arrays: list[np.ndarray] = []
        for k, layer in enumerate(layers):
            deep = layer.columns_in(self)
            shape = (rows, columns) if deep == 1 and layer.columns == 1 else (rows, columns, deep)
            arrays.append(shelf.empty(shape, layer.dtype))
            link(handles, k, tables.row_of(layer))
            link(outputs, k, space.array(arrays[k]))
        tables.row_of(self.view.camera)
        run = self.kernel(label_tiles)

        def work(first: int, last: int, stop: Table) -> None:
            run(row, handles, len(layers), outputs, first // words.BLOCK, -(-last // words.BLOCK), stop)

        tiles = -(-columns // words.SIDE) * -(-rows // words.SIDE)
        run_chunks(tiles * words.BLOCK, work, self.threads, chunk=128 * words.BLOCK)
        return arrays

    def _row(self, space: Space, scale: int, detail: int) -> Table:
        row, ready = space.row(words.FRAME_WORDS), asked(self.view.scene)
        link(row, words.WORLD, self.compiled.world)
        link(row, words.CAMERA, self.compiled.tables.row_of(self.view.camera))
        n = len(self.compiled.items)
        kinds = np.append(ready.kinds.view(np.int32)[:n], MESH).astype(np.int32)  # the last: the meshes put together
        kinds[[k for k, item in enumerate(self.compiled.items) if item.shape.flat and kinds[k] != MESH]] = words.FLAT
        casts = self._casts()
        link(row, words.LATTICE, space.array(_STEPS) if scale == 1 and has_plane(self.view.camera) else None)
        link(row, words.KINDS, space.array(kinds))
        link(row, words.CASTS, space.array(np.array([*casts, 0], np.int32)))
        boxes = aligned((len(casts) + 1, BOX_WORDS), np.float64)
        boxes[:-1, :3], boxes[:-1, 4:7] = self.compiled.lower[casts], self.compiled.upper[casts]
        link(row, words.BOXES, space.array(boxes))
        numbers = row.view(np.int64)
        numbers[[words.CAST_COUNT, words.COLUMNS, words.ROWS, words.SCALE, words.DETAIL]] = (
            len(casts), self.width * scale, self.height * scale, scale, detail,
        )  # fmt: skip
        order = {id(material): k for k, material in enumerate(self.materials)}
        material = [order[id(item.material)] for item in self.compiled.items]
        link(row, words.CLASS_OF_ITEM, space.array(np.array([*self.class_of_item, -1], np.int32)))
        link(row, words.MATERIAL_OF_ITEM, space.array(np.array([*material, -1], np.int32)))
        put_columns(row, words.CAMERA_FROM_WORLD, self.view.camera_from_world)
        for word, name in ((words.NEXT, "next"), (words.PREVIOUS, "previous"), (words.STEREO, "stereo")):
            if name in self._motions:
                link(row, word, self._motions[name].row(space))
        link(row, words.INTEGRATOR, self.compiled.tables.row_of(self.integrator))
        link(row, words.SAMPLER, self.compiled.tables.row_of(_SAMPLER))
        return row

    def _casts(self) -> list[int]:
        """The items that tiles pick from, or none where all rays go through the tree."""
        merged, items = self.compiled.merged, self.compiled.items
        if self.compiled.world.view(np.int64)[FLAGS] & (CUTOUT | CLEAR) or self.view.blurred:
            return []
        inside = set() if merged is None else set(merged.members)
        alone = [k for k in range(len(items)) if k not in inside]
        casts = alone if merged is None else [*alone, len(items)]
        return casts if len(casts) <= MOST_CASTS else []

    def _object_frames(self, space: Space) -> Table:
        """For each item ``object_from_world`` of its object, as columns; then centre and diagonal of the object's box."""
        frames = space.array(aligned((max(1, len(self.compiled.items)) * words.OBJECT_FRAME_WORDS,), np.float64))
        known = {o.index: o for o in self.objects}
        numbers = frames.view(np.float64)
        for k, item in enumerate(self.compiled.items):
            thing, at = known[item.object], words.OBJECT_FRAME_WORDS * k
            put_columns(frames, at, np.linalg.inv(thing.world_from_object))
            with np.errstate(invalid="ignore"):
                numbers[at + 16 : at + 19] = 0.5 * (thing.lower + thing.upper)
                numbers[at + 19] = np.linalg.norm(thing.upper - thing.lower)
        return frames


def number_classes(items: list[Item], given: Any) -> tuple[tuple[str, ...], list[int]]:
    """Names of classes, and the class number of each item.

    `given` is None, a mapping from names of objects to names of classes, or a list of names that sets their order.
    """
    mapping = given if isinstance(given, dict) else {}
    wanted = [mapping.get(item.name, item.name or type(item.shape).__name__) for item in items]
    order = list(dict.fromkeys([*(given if isinstance(given, list | tuple) else mapping.values()), *wanted]))
    for name in order:
        if not isinstance(name, str):
            raise SceneError(f"label: classes: got {name!r}; allowed: names, or a mapping from object names to names")
    number = {name: k for k, name in enumerate(order)}
    return tuple(order), [number[name] for name in wanted]
