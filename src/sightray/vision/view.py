"""A view: a scene seen by a camera; and what two views have to do with one another."""

from __future__ import annotations

import math
from collections import Counter
from functools import cached_property
from typing import Any

import numpy as np

from sightray._jit import kernel
from sightray.bvh.bvh8 import int_at
from sightray.cameras.base import Camera, _Pinhole
from sightray.errors import SceneError
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Space, Table, aligned, f64_at, i64_at, is_null, link, table_at, vec3_at
from sightray.mathlib.transform import put_columns, transform_point
from sightray.mathlib.vec import Vec3
from sightray.scene.compile import Compiled, Item, compile_scene, flatten
from sightray.scene.instance import moves
from sightray.scene.scene import Scene
from sightray.shapes.mesh import Mesh, vec3_of
from sightray.vision.poses import item_motion
from sightray.vision.record import ITEM, POSITION, PRIM, U, V

FAR = 1e15  # metres; what is farther does not move in any picture, to the last digit of a double
NEAR = 1e-9  # of the way to a point: what is met closer to it is the surface that it lies on

# Words of a motion row: how items of one view moved to another, and where that sees them.
LINEAR, MOVES, DEFORMED, FACES, VANISHED, SIDE, STILL = 0, 1, 2, 3, 4, 5, 6  # STILL: nothing has moved or gone
PROJECTION = 8
MOTION_WORDS = 24


class View:
    """A scene with one of the cameras that look at it."""

    def __init__(self, scene: Scene, camera: Camera):
        self.given, self.camera = scene, camera
        self.blurred = camera.readout != 0 and any(map(moves, scene.objects))
        self.scene = scene if self.blurred else self.middle
        self.compiled: Compiled = compile_scene(self.scene)

    @cached_property
    def middle(self) -> Scene:
        """The scene in the middle of the picture's exposure; nothing in it moves."""
        time = exposure_middle(self.camera)
        if not any(map(moves, self.given.objects)):
            return self.given
        kept: dict[float, Scene] = vars(self.given).setdefault("_moments", {})
        if time not in kept:
            kept.clear()
            kept[time] = self.given.at(time)
        return kept[time]

    @cached_property
    def middle_items(self) -> list[Item]:
        """The items of that scene."""
        return self.compiled.items if self.scene is self.middle else list(flatten(self.middle))

    @cached_property
    def intrinsics(self) -> np.ndarray | None:
        """K, (3, 3) pixels, of cameras that have one; of those with distortion, that of the straight part. Else None."""
        inner = getattr(self.camera, "camera", self.camera)  # what a moving camera carries
        return inner.intrinsics() if hasattr(inner, "intrinsics") else None

    @cached_property
    def world_from_camera(self) -> np.ndarray:
        """Pose of the camera, (4, 4)."""
        return self.camera.world_from_camera()

    @cached_property
    def camera_from_world(self) -> np.ndarray:
        """Inverse of the pose, by transposition."""
        pose = self.world_from_camera
        inverse = np.eye(4)
        inverse[:3, :3] = pose[:3, :3].T
        inverse[:3, 3] = -pose[:3, :3].T @ pose[:3, 3]
        return inverse

    def project(self, points: np.ndarray) -> np.ndarray:
        """Continuous pixel coordinates of world points, (..., 2); NaN where they cannot be seen."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return self.camera.project(points)

    def within(self, pixels: np.ndarray) -> np.ndarray:
        """Whether pixel coordinates lie in the picture: (...) bool."""
        with np.errstate(invalid="ignore"):
            inside = (pixels >= 0) & (pixels < (self.camera.width, self.camera.height))
        return np.asarray(inside.all(axis=-1))

    def sees(
        self, points: np.ndarray, pixels: np.ndarray, threads: int | None = None, near: float = NEAR
    ) -> np.ndarray:
        """Whether nothing stands between the camera and points, (n, 3), that it has at `pixels`: (n,) bool, by rays.

        Rays end before the points by the share `near` of their way.
        """
        usable = np.isfinite(pixels).all(axis=-1) & np.isfinite(points).all(axis=-1)
        seen = np.zeros(len(points), bool)
        origins, _ = self.camera.rays(pixels[usable])
        to = points[usable] - origins
        seen[usable] = ~self.scene.occluded(origins, to, 1.0 - near, threads=threads)
        return seen


def is_linear(camera: Camera) -> bool:
    """Whether the camera is a pinhole, whose projection is a matrix."""
    return isinstance(camera, _Pinhole) and type(camera).project is _Pinhole.project


def exposure_middle(camera: Camera) -> float:
    """The middle of a picture's exposure, seconds."""
    return 0.5 * (camera.shutter_open + camera.shutter_close + camera.readout)


def later(camera: Any, seconds: float) -> Any:
    """The camera when it takes its picture so much later."""
    if "camera" in camera.given:
        return camera.replace(camera=later(camera.camera, seconds))
    opens, closes = camera.shutter_open + seconds, camera.shutter_close + seconds
    return camera.replace(shutter_open=opens, shutter_close=closes)


def other_view(value: Any, first: View, name: str) -> View | None:
    """The view that an option names: a scene with its camera, another camera for the same scene, or another time."""
    if value is None or isinstance(value, View):
        return value
    if isinstance(value, int | float) and not isinstance(value, bool) and name != "stereo" and math.isfinite(value):
        return View(first.given, later(first.camera, -value if name == "previous" else value))
    if isinstance(value, Camera):
        return View(first.given, value)
    if isinstance(value, Scene) and value.camera is not None:
        return View(value, value.camera)
    seconds = "" if name == "stereo" else ", or seconds"
    got = "a scene without a camera" if isinstance(value, Scene) else repr(value)
    raise SceneError(f"label: {name}: got {got}; allowed: a Scene with a camera, a camera{seconds}")


def partners(before: Scene, after: Scene) -> list[int]:
    """For each object of a scene the index of the same one in another scene, or -1.

    The same is what has the same name, where no other has it; else what stands at the same index without a name.
    """
    if before is after:
        return list(range(len(before.objects)))
    names = [getattr(thing, "name", "") for thing in before.objects], [getattr(t, "name", "") for t in after.objects]
    counts = Counter(names[0]), Counter(names[1])
    found = []
    for index, name in enumerate(names[0]):
        if name and counts[0][name] == counts[1][name] == 1:
            found.append(names[1].index(name))
        else:
            found.append(index if index < len(names[1]) and names[1][index] == name else -1)
    return found


class Motion:
    """How everything that a view sees moved to its place in another view.

    Attributes
    ----------
    after : the other view.
    item : (n,) int, the item of the other scene that each item became; -1 where it is gone.
    moves : (n, 4, 4) float64, ``after_from_before`` in the world; for deformed meshes ``world_from_object`` afterwards.
    vertices : for each item the new vertices of a deformed mesh, or None.
    """

    def __init__(self, before: View, after: View):
        self.before, self.after = before, after
        items, others = before.compiled.items, after.compiled.items
        partner = partners(before.scene, after.scene)
        places: dict[int, list[int]] = {}
        for index, item in enumerate(others):
            places.setdefault(item.object, []).append(index)
        turn: Counter[int] = Counter()
        self.item = np.full(len(items), -1)
        self.moves = np.tile(np.eye(4), (len(items), 1, 1))
        self.vertices: list[np.ndarray | None] = [None] * len(items)
        if before.scene is after.scene:
            self.item = np.arange(len(items))
            return
        for index, item in enumerate(items):
            theirs = places.get(partner[item.object], []) if partner[item.object] >= 0 else []
            place = turn[item.object]
            turn[item.object] += 1
            if place < len(theirs):
                self.item[index] = theirs[place]
                self.moves[index], self.vertices[index] = item_motion(item, others[theirs[place]])

    @property
    def linear(self) -> bool:
        """Whether the other camera is a pinhole, so that kernels project."""
        return is_linear(self.after.camera)

    @property
    def side(self) -> float:
        """1 if the other camera stands to the right, -1 to the left."""
        return 1.0 if self.before.camera_from_world[0] @ self.after.world_from_camera[:, 3] >= 0 else -1.0

    def row(self, space: Space) -> Table:
        """The motion as kernels read it."""
        row, n = space.row(MOTION_WORDS), len(self.moves)
        moves = space.array(aligned((max(n, 1) * 16,), np.float64))
        deformed, faces, gone = space.row(max(n, 1)), space.row(max(n, 1)), np.zeros(max(n, 1), np.int32)
        for index, item in enumerate(self.before.compiled.items):
            put_columns(moves, 16 * index, self.moves[index])
            gone[index] = self.item[index] < 0
            vertices = self.vertices[index]
            if vertices is not None and isinstance(item.shape, Mesh):
                link(deformed, index, space.array(vertices))
                link(faces, index, space.array(item.shape.faces))
        link(row, MOVES, moves)
        link(row, DEFORMED, deformed)
        link(row, FACES, faces)
        link(row, VANISHED, space.array(gone))
        row.view(np.int64)[LINEAR] = self.linear
        row.view(np.int64)[STILL] = self.before.scene is self.after.scene
        row.view(np.float64)[SIDE] = self.side
        if self.linear:
            matrix = np.zeros((4, 4))
            matrix[:3] = self.after.intrinsics @ self.after.camera_from_world[:3]
            put_columns(row, PROJECTION, matrix)
        return row


@kernel
def is_gone(motion: Table, record: Table) -> bool:
    """Whether what the pixel shows is not in the other view at all."""
    return int_at(table_at(motion, VANISHED), i64_at(record, ITEM)) != 0


@kernel
def moved_point(motion: Table, record: Table) -> Vec3:
    """Where the material point that the pixel shows is in the other view, in the world."""
    index = i64_at(record, ITEM)
    moves, vertices = table_at(motion, MOVES), table_at(table_at(motion, DEFORMED), index)
    if is_null(vertices):
        return transform_point(moves, 16 * index, vec3_at(record, POSITION))
    faces, first = table_at(table_at(motion, FACES), index), 3 * i64_at(record, PRIM)
    a, b = corner_of(vertices, faces, first), corner_of(vertices, faces, first + 1)
    c = corner_of(vertices, faces, first + 2)
    p = a + (b - a) * f64_at(record, U) + (c - a) * f64_at(record, V)
    return transform_point(moves, 16 * index, p)


@kernel
def corner_of(vertices: Table, faces: Table, corner: i64) -> Vec3:
    """The vertex that an entry of ``faces`` names."""
    return vec3_of(vertices, int_at(faces, corner))
