"""The gate between objects and kernels: a `Scene` becomes tables here and nowhere else."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from sightray import _jit
from sightray._compilers import compile_missing
from sightray._jit import METHOD_SLOTS
from sightray.accelerators import item as item_row
from sightray.errors import SceneError
from sightray.lights.base import Light
from sightray.materials.lambert import Lambert
from sightray.mathlib.cores import core_count
from sightray.mathlib.motion import Placement
from sightray.mathlib.table import Space, Table, aligned, link, set_methods
from sightray.mathlib.transform import IDENTITY, Transform, put_columns
from sightray.registry import Member
from sightray.scene import world as world_row
from sightray.scene.instance import Group, Instance
from sightray.scene.kinds import are_for_eight, has_kind, kinds_of, pack_kinds
from sightray.scene.lighting import pack_glow, pack_lamps
from sightray.scene.merge import merge_small_meshes
from sightray.scene.pieces import MOST, pack_pieces, pieces_of
from sightray.scene.scene import Scene
from sightray.scene.world import light_count
from sightray.shapes.base import Shape
from sightray.shapes.moving import _Moving

DEFAULT_MATERIAL = Lambert(albedo=0.5)
Report = Callable[[int, int, str], None]  # kernels compiled, kernels to compile, name of the next


class Item(NamedTuple):
    """One shape at one place."""

    shape: Shape
    material: Member
    transform: Transform
    object: int  # index of the scene's object that it belongs to
    name: str
    placement: Placement | None = None  # of what moves: `transform` is where it is at time 0


class Tables:
    """Rows of members, packed once each, and filled with the methods that a kernel can reach."""

    def __init__(self) -> None:
        self.space = Space()
        self._rows: dict[int, tuple[Member, Table]] = {}
        self._alike: list[np.ndarray] = []  # rows that have the methods of their first one
        self._waiting: dict[Callable, Callable[[], None]] = {}
        self._ready: dict[tuple[Callable, bool], int] = {}  # how many rows there were when methods were filled in

    def row_of(self, member: Member) -> Table:
        """The row of a member; packed on first use. The member is kept alive, so its id stays its own."""
        known = self._rows.get(id(member))
        if known is None:
            row = self.space.row(member.row_words())
            known = self._rows[id(member)] = (member, row)
            member.pack(row, self)
        return known[1]

    def add(self, member: Member, row: Table) -> None:
        """Know a row that was packed elsewhere."""
        self._rows[id(member)] = (member, row)

    def add_alike(self, member: Member, values: np.ndarray) -> list[Table]:
        """Know many rows, (n, words) float64, that are all `member` as far as their methods go."""
        rows = [self.space.array(row) for row in values]
        for row in rows:
            row.functions = rows[0].functions
        self._alike.append(values.view(np.int64)[:, :METHOD_SLOTS])
        self.add(member, rows[0])
        return rows

    def once_reached(self, function: Callable, action: Callable[[], None]) -> None:
        """Put off packing until a kernel is prepared that can reach `function`."""
        self._waiting[function] = action

    def _catch_up(self, root: Callable) -> None:
        """Do what was put off until now."""
        needed = _jit.needed_kernels(root, dict.fromkeys(type(member) for member, _ in self._rows.values()))
        roots = (root, *(k for slots in needed.values() for k in slots.values()))
        reached = {callee for k in roots for callee in _jit.reachable(k)}
        for function in [f for f in self._waiting if f in reached]:
            self._waiting.pop(function)()

    def prepare(self, root: Callable, report: Report | None = None, compiled: bool | None = None) -> None:
        """Fill in the methods that the kernel `root` can reach, compiling what the cache does not have."""
        compiled = _jit.enabled() if compiled is None else compiled
        if self._ready.get((root, compiled)) == len(self._rows):
            return
        if self._waiting:
            self._catch_up(root)
        rows = list(self._rows.values())
        needed = _jit.needed_kernels(root, dict.fromkeys(type(member) for member, _ in rows))
        kernels = list(dict.fromkeys(itertools.chain([root], *(slots.values() for slots in needed.values()))))
        if compiled:
            compile_missing(kernels, core_count(), report)
        addresses = {k: _jit.address(k) if compiled else 0 for k in kernels}
        for member, row in rows:
            set_methods(row, [(slot, k, addresses[k]) for slot, k in needed[type(member)].items()])
        for methods in self._alike:
            methods[1:] = methods[0]
        self._ready[root, compiled] = len(self._rows)


class Compiled:
    """A scene as tables: `world` for kernels, `items` for people who ask what item number 7 is.

    `lower` and `upper`, (n, 3), are the items' boxes in the world; last come those of the meshes that were put together.
    """

    def __init__(self, scene: Scene, accelerator: Any):
        self.scene = scene
        self.tables = Tables()
        self.items = list(flatten(scene))
        self.accelerator = accelerator
        self.merged = merge_small_meshes(self.items) if accelerator.merges_meshes else None
        self.world = self._pack(accelerator)

    def _pack(self, accelerator: Any) -> Table:
        tables, scene, space = self.tables, self.scene, self.tables.space
        items = space.array(aligned((len(self.items) + 1) * item_row.ITEM_WORDS, np.float64))
        self.lower, self.upper = self._pack_items(items)
        tree = accelerator.build_scene(space, items, self.lower, self.upper, self.items)
        tables.add(accelerator, tree)
        world = space.row(world_row.WORLD_WORDS)
        lamps, own = scene.lights, set(light_indices(scene))
        pack_lamps(world, tables, lamps)

        def pack_lights() -> None:
            pack_glow(world, tables, lamps, items, self.items, own)

        def pack_for_eight() -> None:
            kinds = pack_kinds(tables, [item.material for item in self.items])
            link(world, world_row.KINDS, kinds)
            if self.in_pieces:
                count = int(world.view(np.int64)[world_row.LIGHT_COUNT])
                link(world, world_row.PIECES, pack_pieces(tables, items, self.items, kinds, count))

        tables.once_reached(light_count, pack_lights)
        tables.once_reached(kinds_of, pack_for_eight)  # after the lights, which whoever asks for kinds reaches, too
        link(world, world_row.TREE, tree)
        link(world, world_row.ITEMS, items)
        world.view(np.int64)[world_row.MERGED] = world_row.NONE if self.merged is None else len(self.items)
        link(world, world_row.ORIGIN, None if self.merged is None else space.array(self.merged.origin))
        integers = items.view(np.int64).reshape(-1, item_row.ITEM_WORDS)
        world.view(np.int64)[world_row.FLAGS] = np.bitwise_or.reduce(integers[:, item_row.FLAGS])
        link(world, world_row.MEDIUM, None if scene.medium is None else tables.row_of(scene.medium))
        if scene.camera is not None:
            link(world, world_row.CAMERA, tables.row_of(scene.camera))
        world.view(np.int64)[world_row.AMID] = self._amid_bodies()
        numbers = world.view(np.float64)
        numbers[world_row.BACKGROUND : world_row.BACKGROUND + 3] = scene.background
        numbers[world_row.AMBIENT : world_row.AMBIENT + 3] = scene.ambient
        return world

    @functools.cached_property
    def for_eight(self) -> bool:
        """Whether paths may be followed eight at once: no medium is about."""
        return self.scene.medium is None and are_for_eight(self.items, self._flags())

    @functools.cached_property
    def all_have_kinds(self) -> bool:
        """Whether all materials have forms for eight paths."""
        return all(has_kind(material) for material in {id(item.material): item.material for item in self.items}.values())

    @functools.cached_property
    def in_pieces(self) -> bool:
        """Whether they may do without the tree: few simple surfaces, and no structure that was asked for."""
        if not self.accelerator.steps_aside or len(self.items) > MOST or not self.for_eight:
            return False
        return pieces_of(self.items, self._flags()) is not None

    def _flags(self) -> list[int]:
        """What the items' materials are, as in the FLAGS of their rows."""
        known = {id(item.material): item.material for item in self.items}
        flags = {key: flags_of(material) for key, material in known.items()}
        return [flags[id(item.material)] for item in self.items]

    def _amid_bodies(self) -> bool:
        """Whether rays of sight may begin in a body that is filled."""
        filled = [item for item in self.items if is_filled(item.material)]
        if self.scene.camera is None or not filled:
            return False
        eye = self.scene.camera.eye_of_all_rays()
        boxes = [world_bounds(item) for item in filled]
        return eye is None or any(bool(((lower <= eye) & (eye <= upper)).all()) for lower, upper in boxes)

    def _pack_items(self, items: Table) -> tuple[np.ndarray, np.ndarray]:
        """Fill the items' rows; their bounds, each (n, 3). Items that were merged have none, what they became has."""
        integers, numbers = items.view(np.int64), items.view(np.float64)
        packed = list(self.items)
        unmoved, flags = np.tile(np.eye(4).ravel(), 2), {}  # both matrices of what stays in its place
        if self.merged is not None:
            packed.append(Item(self.merged.mesh, DEFAULT_MATERIAL, IDENTITY, -1, ""))
        lower, upper = np.empty((2, len(packed), 3))
        lights = {index: number for number, index in enumerate(light_indices(self.scene))}
        for index, item in enumerate(packed):
            start = index * item_row.ITEM_WORDS
            integers[start + item_row.SHAPE] = self.tables.row_of(item.shape).address
            integers[start + item_row.MATERIAL] = self.tables.row_of(item.material).address
            still = item.transform.is_identity
            integers[start + item_row.MOVED] = item_row.UNMOVED if still else item_row.PLACED
            integers[start + item_row.MET] = integers[start + item_row.SHAPE]
            if item.placement is not None:
                moving = _Moving(shape=item.shape, placement=item.placement)
                integers[start + item_row.MOVED] = item_row.MOVING
                integers[start + item_row.MET] = self.tables.row_of(moving).address
            integers[start + item_row.OBJECT] = item.object
            integers[start + item_row.LIGHT] = lights.get(item.object, -1)
            if id(item.material) not in flags:
                flags[id(item.material)] = flags_of(item.material)
            integers[start + item_row.FLAGS] = flags[id(item.material)]
            if still:
                first = start + item_row.OBJECT_FROM_WORLD
                numbers[first : first + len(unmoved)] = unmoved
            else:
                put_columns(items, start + item_row.OBJECT_FROM_WORLD, item.transform.inverse)
                put_columns(items, start + item_row.WORLD_FROM_OBJECT, item.transform.matrix)
            lower[index], upper[index] = world_bounds(item)
        if self.merged is not None:
            lower[self.merged.members], upper[self.merged.members] = np.inf, -np.inf
        return lower, upper


def compile_scene(scene: Scene, accelerator: Any = None) -> Compiled:
    """The tables of a scene; kept with it, so that the next call is free."""
    if accelerator is None:
        from sightray.accelerators.bvh import Bvh

        accelerator = Bvh()
    cache: dict[str, Compiled] = scene._compiled  # type: ignore[attr-defined]
    key = repr(accelerator)
    if key not in cache:
        cache[key] = Compiled(scene, accelerator)
    return cache[key]


def flatten(scene: Scene) -> Iterator[Item]:
    """Every shape of the scene with its place in the world: groups opened, instances followed."""
    for index, thing in enumerate(scene.objects):
        if isinstance(thing, Light):
            thing = thing.shape()
        if thing is not None:
            yield from _flatten(thing, Placement(), None, index, "")


def _flatten(thing: Any, place: Placement, material: Member | None, index: int, name: str) -> Iterator[Item]:
    here = place.within(thing.transform, getattr(thing, "motion", None))
    name = name or thing.name
    if isinstance(thing, Group):
        for part in thing.objects:
            yield from _flatten(part, here, material, index, name)
    elif isinstance(thing, Instance):
        yield from _flatten(thing.of, here, material or thing.material, index, name)
    else:
        moving = here if here.moves else None
        yield Item(thing, material or thing.material or DEFAULT_MATERIAL, here.at(0.0), index, name, moving)


def world_bounds(item: Item) -> tuple[np.ndarray, np.ndarray]:
    """Box around an item in the world, at all times; infinite stays infinite."""
    if item.placement is not None:
        return item.placement.bounds(*item.shape.bounds())
    return item.transform.box(*item.shape.bounds())


def flags_of(material: Any) -> int:
    """What a material is beside a plain surface, as the bits of an item's FLAGS."""
    # In the order of the bits CUTOUT, BUMPY, ...
    kinds = ("cutout", "bumpy", "oriented", "clear", "thin", "translucent", "patterned")
    return sum(1 << bit for bit, kind in enumerate(kinds) if getattr(material, kind))


def is_filled(material: Any) -> bool:
    """Whether there is a medium behind a surface of this material."""
    return material.filled and not material.thin


def light_indices(scene: Scene) -> list[int]:
    """Where the lights stand among the scene's objects."""
    return [index for index, thing in enumerate(scene.objects) if isinstance(thing, Light)]


def require_view(scene: Scene) -> Any:
    """The scene's camera, or a `SceneError` if it has none or there is nothing to see."""
    if next(flatten(scene), None) is None:
        raise SceneError("Scene.objects: no shapes; a picture needs at least one, such as Sphere(radius=1)")
    return require_camera(scene)


def require_camera(scene: Scene) -> Any:
    """The scene's camera, or a `SceneError`."""
    if scene.camera is None:
        raise SceneError("Scene.camera: missing; a picture needs one, such as PerspectiveCamera(eye=..., target=...)")
    return scene.camera
