"""Objects that move while rows are exposed one after the other: where and when another picture sees their points.

A row y of a picture is exposed around the time t(y). A point that pixel x shows at the time of its row belongs to a body
that stands at T(t) then; the other picture shows it in the row y' at whose own time the body stands where that row looks:
``y' = π(T'(t(y')) T(t(y))⁻¹ X)``. The time is found by repeated substitution, which converges as long as things move
slower than rows do.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np

from sightray._jit import kernel
from sightray.cameras.base import sight_ray
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, f64_at, f64_put, i64_at, table_at
from sightray.scene.compile import Item
from sightray.scene.instance import frozen
from sightray.scene.parallel import run_chunks
from sightray.scene.world import find_closest
from sightray.vision.poses import deformed, object_pose, on_deformed, shape_motion
from sightray.vision.record import CAMERA, WORLD
from sightray.vision.view import FAR, View, partners

STEPS, EXACT = 60, 1e-14  # substitutions; seconds
FOLLOWED = ("ray_origin", "ray_direction", "position", "item", "primitive")  # layers that `Rolling` reads
CLOSE = 1e-6  # of the way to a point: what is met closer to it is the surface that it lies on


def row_times(view: View, y: Any) -> np.ndarray:
    """The middle of the exposure of rows, (...) continuous, seconds."""
    camera = view.camera
    middle = 0.5 * (camera.shutter_open + camera.shutter_close)
    return middle + np.asarray(y, np.float64) / camera.height * camera.readout


def places(item: Item, times: np.ndarray) -> np.ndarray:
    """``world_from_object`` of an item at some times, (n,): (n, 4, 4)."""
    found = np.eye(4)
    if item.placement is None:
        return np.broadcast_to(item.transform.matrix, (len(times), 4, 4))
    for before, motion in item.placement.moves:
        found = found @ before.matrix @ motion.matrices(times)
    return np.broadcast_to(found @ item.placement.last.matrix, (len(times), 4, 4))


def seen_from(view: View, body: Callable[[np.ndarray], np.ndarray], count: int) -> tuple[np.ndarray, np.ndarray]:
    """Where and when a camera sees points that move: pixel coordinates, (n, 2), and positions in the world, (n, 3).

    `body` gives the positions, (n, 3), at times, (n,). What no row sees has NaN for coordinates, and its place in the
    middle of the exposure.
    """
    middle = row_times(view, np.full(count, 0.5 * view.camera.height))
    times = middle
    for _ in range(STEPS):
        points = body(times)
        pixels = view.project(points)
        following = np.where(np.isfinite(pixels[:, 1]), row_times(view, pixels[:, 1]), middle)
        moved, times = np.abs(following - times), following
        if (moved <= EXACT * (1 + np.abs(times))).all():
            break
    lost = (moved > 1e-9 * view.camera.readout) | ~np.isfinite(pixels).all(axis=1)
    pixels[lost] = np.nan
    points[lost] = body(middle)[lost]
    return pixels, points


class Rolling:
    """What `view.Motion` is for still scenes: where the points that a view sees are when another view sees them.

    Attributes
    ----------
    item : (n,) int, the item of the other scene that each item became; -1 where it is gone.
    pixels : (h, w, 2) coordinates in the other picture; NaN where no row sees the point, or its object is not there.
    points : (h, w, 3) world, metres: the point at the time of the row that sees it, or else in the middle of the exposure;
        of the background 1e15 m away; NaN if its object is not there.
    """

    def __init__(self, frame: Any, before: View, after: View):
        self.frame, self.before, self.after = frame, before, after
        items, others = before.compiled.items, after.compiled.items
        partner = partners(before.scene, after.scene)
        theirs: dict[int, list[int]] = {}
        for index, item in enumerate(others):
            theirs.setdefault(item.object, []).append(index)
        turn = dict.fromkeys(range(len(partner)), 0)
        self.item = np.full(len(items), -1)
        for index, item in enumerate(items):
            there = theirs.get(partner[item.object], [])
            if turn[item.object] < len(there):
                self.item[index] = there[turn[item.object]]
            turn[item.object] += 1

    @cached_property
    def _found(self) -> tuple[np.ndarray, np.ndarray]:
        values, height, width = self.frame.values, self.frame.height, self.frame.width
        position, item = values["position"].reshape(-1, 3), values["item"].ravel()
        primitive = values["primitive"].ravel()
        times = row_times(self.before, np.repeat(np.arange(height) + 0.5, width))
        points = (values["ray_origin"] + values["ray_direction"] * FAR).reshape(-1, 3)
        pixels = self.after.project(points)
        for index in np.unique(item[item >= 0]):
            own = item == index
            points[own], pixels[own] = np.nan, np.nan
            if self.item[index] >= 0:
                inside = self.inside(index, position[own], primitive[own], times[own])
                body = partial(self.outside, index, inside)
                pixels[own], points[own] = seen_from(self.after, body, len(inside))
        return pixels.reshape(height, width, 2), points.reshape(height, width, 3)

    def inside(self, index: int, position: np.ndarray, primitive: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Points of an item, (n, 3) in the world at times, (n,), in the frame of the item that it became."""
        item, other = self.before.compiled.items[index], self.after.compiled.items[self.item[index]]
        inside = moved_by(np.linalg.inv(places(item, times)), position)
        if deformed(item, other):
            return on_deformed(item.shape, other.shape, primitive, inside)  # type: ignore[arg-type]
        change = shape_motion(item, other)
        return inside @ change[:3, :3].T + change[:3, 3]

    def outside(self, index: int, inside: np.ndarray, times: np.ndarray) -> np.ndarray:
        """The same points in the world of the other view, each at its own time."""
        return moved_by(places(self.after.compiled.items[self.item[index]], times), inside)

    @property
    def pixels(self) -> np.ndarray:
        return self._found[0]

    @property
    def points(self) -> np.ndarray:
        return self._found[1]


def clear_sight(frame: Any, points: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Whether a frame's camera sees points, (n, 3), that it has at `pixels`, when their rows do: (n,) bool, by rays."""
    usable = np.flatnonzero(np.isfinite(pixels).all(axis=1) & np.isfinite(points).all(axis=1))
    seen = np.zeros(len(points), bool)
    origins, _ = frame.view.camera.rays(pixels[usable])
    way = np.linalg.norm(points[usable] - origins, axis=1)
    seen[usable] = sight_distances(frame, pixels[usable]) >= (1 - CLOSE) * way
    return seen


def sight_distances(frame: Any, pixels: np.ndarray) -> np.ndarray:
    """Distances to what the rays of sight through pixel coordinates, (n, 2), meet, each at its row's time: (n,) metres."""
    row, space = frame.row()
    run = frame.kernel(measure_sights)
    pixels, found = np.ascontiguousarray(pixels, np.float64), np.empty(len(pixels))
    inputs, outputs = space.array(pixels), space.array(found)

    def work(first: int, last: int, stop: Table) -> None:
        run(row, inputs, first, last, outputs, stop)

    run_chunks(len(pixels), work, frame.threads)
    return found


@kernel
def measure_sights(frame: Table, pixels: Table, first: i64, last: i64, found: Table, stop: Table) -> None:
    """Distances along the rays number `first` to ``last - 1``; 1e300 where they meet nothing."""
    world, camera = table_at(frame, WORLD), table_at(frame, CAMERA)
    for i in range(first, last):
        if i & 255 == 0 and i64_at(stop, 0) != 0:
            return
        ray = sight_ray(camera, f64_at(pixels, 2 * i), f64_at(pixels, 2 * i + 1), 0.5, 0.5, 0.5)
        hit = find_closest(world, ray.origin, ray.direction, 0.0, 1e300)
        f64_put(found, i, hit.t if hit.item >= 0 else 1e300)


def object_points(view: View, index: int, inside: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Points of an object, (n, 3) in its frame, in the world, each at its own time, (n,)."""
    thing = view.given.objects[index]
    poses = np.array([object_pose(frozen(thing, float(time))) for time in times])
    return moved_by(poses, inside)


class Crossings(NamedTuple):
    """What `Scene.intersect_all` finds along the rays through all pixel centres: `offsets` (pixels + 1,), else (n,) each."""

    ray: np.ndarray
    offsets: np.ndarray
    t: np.ndarray
    shape: np.ndarray
    primitive: np.ndarray
    entering: np.ndarray


def crossings(frame: Any) -> Crossings:
    """All surfaces along the rays of sight, from the layers `ray_origin` and `ray_direction`; each row's at its own time."""
    origins, directions = (frame.values[name] for name in ("ray_origin", "ray_direction"))
    view, rows = frame.view, np.arange(frame.height)
    if view.blurred:
        parts = [(view.given.at(float(row_times(view, row + 0.5))), np.s_[row]) for row in rows]
    else:
        parts = [(view.scene, np.s_[:])]
    found: list[Any] = []
    rays: list[np.ndarray] = []
    offsets = [np.zeros(1, np.int64)]
    for scene, part in parts:
        met = scene.intersect_all(origins[part].reshape(-1, 3), directions[part].reshape(-1, 3), threads=frame.threads)
        rays.append(met.ray + (len(rays) * frame.width))
        offsets.append(offsets[-1][-1] + met.offsets[1:])
        found.append(met)
    names = ("t", "shape", "primitive", "entering")
    values = (np.concatenate([getattr(met, name) for met in found]) for name in names)
    return Crossings(np.concatenate(rays), np.concatenate(offsets), *values)


def inside_objects(frame: Any) -> np.ndarray:
    """The points that are seen in the frames of their objects at the times of their rows, (h, w, 3); NaN for nothing."""
    position, instance = frame.values["position"], frame.values["instance"]
    found = np.full_like(position, np.nan)
    for row, time in enumerate(row_times(frame.view, np.arange(frame.height) + 0.5)):
        for index in np.unique(instance[row][instance[row] >= 0]):
            thing = frozen(frame.view.given.objects[index], float(time))
            own, back = instance[row] == index, np.linalg.inv(object_pose(thing))
            found[row, own] = position[row, own] @ back[:3, :3].T + back[:3, 3]
    return found


def moved_by(matrices: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points, (n, 3), each under its own map, (n, 4, 4)."""
    return (matrices[:, :3, :3] @ points[..., None])[..., 0] + matrices[:, :3, 3]
