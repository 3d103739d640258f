"""What the classic structures hold: primitives, that is, single shapes and the single triangles of meshes.

To the default accelerator a mesh is one item with a tree of its own. The structures of the textbooks know no such
second level, so for them a scene is opened: each item is one primitive, but a mesh is as many as it has triangles. A
primitive is a pair (item, triangle), with -1 for "the whole item", and a box in the world. The ray still goes to the
item's own space and to the same double-precision tests, so a hit is the same number whichever structure found it.

**Why no hit is lost.** A point computed from a ray errs by a few 2^-53 of the coordinates that went into it. Boxes are
therefore larger by `PAD` of the scene and by 2^-46 of their own coordinates, which also gives flat ones a thickness,
and a ray from far away carries `slack` (see `world_ray`) wherever it meets a box or a plane.

Primitives without bounds, such as planes, stand apart; every ray asks them first, and what they answer shortens it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from sightray._jit import METHOD_SLOTS, kernel
from sightray.accelerators.base import Accelerator
from sightray.accelerators.item import (
    MOVED,
    OBJECT_FROM_WORLD,
    ItemHit,
    better,
    intersect_item,
    item_at,
    worth,
)  # fmt: skip
from sightray.accelerators.world_ray import WorldRay
from sightray.bvh.triangles import axis_of, depth_of, edge_functions, shear, times
from sightray.mathlib.hit import Hit, miss
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Space, Table, aligned, f64_at, i32_at, i64_at, link, table_at
from sightray.mathlib.tally import TESTS, tally
from sightray.mathlib.transform import transform_point, transform_vector
from sightray.mathlib.vec import Vec3
from sightray.shapes.mesh import Mesh

PAD = 2.0**-32

# The head of the row of every structure over primitives; what is its own begins at `OWN`.
ITEMS = METHOD_SLOTS  # pointer to the items' rows
PAIRS = METHOD_SLOTS + 1  # pointer to two int32 a primitive: item and triangle
MESHES = METHOD_SLOTS + 2  # pointer to two pointers an item: its vertices and its faces, null if it is no mesh
ORDER = METHOD_SLOTS + 3  # pointer to int32 primitive numbers: leaves and cells are ranges of these
UNBOUNDED = METHOD_SLOTS + 4  # pointer to the int32 numbers of primitives without bounds
UNBOUNDED_COUNT = METHOD_SLOTS + 5
OWN = METHOD_SLOTS + 8
ROW_WORDS = OWN + 24


class Primitives(NamedTuple):
    """The primitives that have bounds, as builders see them."""

    number: np.ndarray  # (n,) int32, what leaves name them by
    lower: np.ndarray  # (n, 3) float64, world, padded
    upper: np.ndarray
    corners: np.ndarray  # (n, 3, 3) float64: of triangles, world; NaN for others

    def extents(self, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest projection on each of k unit vectors: (n, k) each."""
        center, half = 0.5 * (self.lower + self.upper), 0.5 * (self.upper - self.lower)
        middle, reach = center @ normals.T, half @ np.abs(normals).T
        # Those of triangles are known better than from their boxes.
        along = self.corners @ normals.T
        pad = PAD * np.ptp(middle, axis=0).max(initial=0.0) + 2.0**-40 * (np.abs(middle) + reach) + np.finfo(float).tiny
        low, high = along.min(axis=1) - pad, along.max(axis=1) + pad
        return np.fmax(middle - reach, low), np.fmin(middle + reach, high)

    def cross(self, which: np.ndarray, center: np.ndarray, half: np.ndarray) -> np.ndarray:
        """Whether the planes of triangles cross boxes: (m,) bool for m numbers and boxes; other primitives do."""
        a, b, c = (self.corners[which, k] for k in range(3))
        n = np.cross(b - a, c - a)
        reach = (np.abs(n) * (half + 2.0**-20 * np.abs(half) + 2.0**-40 * np.abs(center))).sum(axis=-1)
        return ~(np.abs((n * (center - a)).sum(axis=-1)) > reach)


class _OverPrimitives(Accelerator):
    """Base of the structures over primitives: they state `grow`."""

    def build_scene(
        self, space: Space, items: Table, lower: np.ndarray, upper: np.ndarray, things: Sequence[Any]
    ) -> Any:
        row = space.row(ROW_WORDS)
        link(row, ITEMS, items)
        order = self.grow(space, row, open_scene(space, row, lower, upper, things))
        link(row, ORDER, space.array(np.ascontiguousarray(order, np.int32)))
        return row

    def grow(self, space: Space, row: Table, primitives: Primitives) -> np.ndarray:
        """Build the structure, write it into the row from `OWN` on; the numbers that its leaves are ranges of."""
        raise NotImplementedError


def open_scene(space: Space, row: Table, lower: np.ndarray, upper: np.ndarray, things: Sequence[Any]) -> Primitives:
    """List the primitives of a scene in the head of a row."""
    pointers = space.array(aligned(2 * len(things) + 2, np.int64))
    pairs, low, high, corners = [], [], [], []
    for index, thing in enumerate(things):
        if not isinstance(thing.shape, Mesh) or thing.placement is not None:  # what moves is one primitive
            pairs.append(np.array([(index, -1)]))
            low.append(lower[index : index + 1])
            high.append(upper[index : index + 1])
            corners.append(np.full((1, 3, 3), np.nan))
            continue
        vertices, faces = thing.shape.vertices, thing.shape.faces
        link(pointers, 2 * index, space.array(vertices))
        link(pointers, 2 * index + 1, space.array(faces))
        placed = thing.transform.point(vertices)[faces]
        pairs.append(np.stack([np.full(len(faces), index), np.arange(len(faces))], axis=1))
        low.append(placed.min(axis=1))
        high.append(placed.max(axis=1))
        corners.append(placed)
    pair = np.concatenate([*pairs, np.empty((0, 2))]).astype(np.int32)
    lo, hi = np.concatenate([*low, np.empty((0, 3))]), np.concatenate([*high, np.empty((0, 3))])
    finite = np.isfinite(lo).all(axis=1) & np.isfinite(hi).all(axis=1)
    unbounded = np.flatnonzero(~finite).astype(np.int32)
    link(row, PAIRS, space.array(pair))
    link(row, MESHES, pointers)
    link(row, UNBOUNDED, space.array(unbounded))
    row.view(np.int64)[UNBOUNDED_COUNT] = len(unbounded)
    lo, hi, corner = lo[finite], hi[finite], np.concatenate([*corners, np.empty((0, 3, 3))])[finite]
    scene = (hi.max(axis=0) - lo.min(axis=0)).max() if len(lo) else 0.0
    pad = PAD * scene + 2.0**-46 * np.maximum(np.abs(lo), np.abs(hi)).max(axis=1, initial=0.0)[:, None]
    return Primitives(np.flatnonzero(finite).astype(np.int32), lo - pad, hi + pad, corner)


# ------------------------------------------------------------------------------------------------------------- kernels


@kernel
def number_at(table: Table, index: i64) -> i64:
    """32-bit integer number `index` of a table, as one of 64 bits."""
    return int(i32_at(table, index))


@kernel
def no_item() -> ItemHit:
    """No hit."""
    return ItemHit(math.inf, -1, -1, 0.0, 0.0)


@kernel
def meet_face(vertices: Table, faces: Table, face: i64, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> Hit:
    """Meet one triangle of a mesh, in its own space (Woop, Benthin and Wald, 2013; see `triangles`)."""
    s = shear(d)
    a, b, c = 3 * number_at(faces, 3 * face), 3 * number_at(faces, 3 * face + 1), 3 * number_at(faces, 3 * face + 2)
    z = Vec3(f64_at(vertices, a + s.kz), f64_at(vertices, b + s.kz), f64_at(vertices, c + s.kz)) - axis_of(o, s.kz)
    x = Vec3(f64_at(vertices, a + s.kx), f64_at(vertices, b + s.kx), f64_at(vertices, c + s.kx)) - axis_of(o, s.kx)
    y = Vec3(f64_at(vertices, a + s.ky), f64_at(vertices, b + s.ky), f64_at(vertices, c + s.ky)) - axis_of(o, s.ky)
    e = edge_functions(x - times(z, s.sx), y - times(z, s.sy))
    det = e.x + e.y + e.z
    if (min(e.x, e.y, e.z) < 0.0 and max(e.x, e.y, e.z) > 0.0) or det == 0.0:
        return miss()
    t = depth_of(e, z, s.sz, det)
    return Hit(t, face, e.y / det, e.z / det) if t_min < t < t_max else miss()


@kernel
def intersect_primitive(tree: Table, index: i64, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> ItemHit:
    """Send the inverse-transformed ray to the primitive's shape or triangle; t means the same in both spaces."""
    tally(TESTS)
    number, face = number_at(table_at(tree, PAIRS), 2 * index), number_at(table_at(tree, PAIRS), 2 * index + 1)
    item = item_at(table_at(tree, ITEMS), number)
    if face < 0:
        hit = intersect_item(item, o, d, t_min, t_max)
        return ItemHit(hit.t, number, hit.prim, hit.u, hit.v)
    if i64_at(item, MOVED) != 0:
        o, d = transform_point(item, OBJECT_FROM_WORLD, o), transform_vector(item, OBJECT_FROM_WORLD, d)
    meshes = table_at(tree, MESHES)
    hit = meet_face(table_at(meshes, 2 * number), table_at(meshes, 2 * number + 1), face, o, d, t_min, t_max)
    return ItemHit(hit.t, number, hit.prim, hit.u, hit.v)


@kernel
def nearest_listed(
    tree: Table, numbers: Table, first: i64, count: i64, ray: WorldRay, t_min: f64, t_max: f64, best: ItemHit
) -> ItemHit:
    """The nearest hit of the primitives in a range of a list if it is nearer than the best one so far, or that one."""
    for i in range(first, first + count):
        hit = intersect_primitive(tree, number_at(numbers, i), ray.o, ray.d, t_min, worth(best, t_max))
        if hit.item >= 0 and better(hit, best):
            best = hit
    return best


@kernel
def nearest_unbounded(tree: Table, ray: WorldRay, t_min: f64, t_max: f64) -> ItemHit:
    """The nearest hit of the primitives that are in no structure."""
    count = i64_at(tree, UNBOUNDED_COUNT)
    return nearest_listed(tree, table_at(tree, UNBOUNDED), 0, count, ray, t_min, t_max, no_item())
