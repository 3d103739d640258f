"""The world as kernels see it: one row that points at everything, and the questions that integrators ask of it."""

from __future__ import annotations

from typing import NamedTuple

from sightray._jit import kernel
from sightray.accelerators.base import blocked, closest
from sightray.accelerators.item import LIGHT, MATERIAL, ItemHit, item_at, item_surface, to_object
from sightray.bvh.bvh8 import int_at
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, i64_at, table_at
from sightray.mathlib.vec import Vec3, dot, normalize
from sightray.textures.base import Where

TREE, ITEMS, LIGHTS, LIGHT_COUNT, CAMERA = 0, 1, 2, 3, 4
MERGED, ORIGIN = 5, 6  # item number of the small meshes put together, or NONE; whose triangles its triangles are
BACKGROUND, AMBIENT = 8, 12
WORLD_WORDS = 16
NONE = -2
GRAZING = 1e-3  # cosine of the viewer and a shading normal that was bent


class Point(NamedTuple):
    """A point of a surface that a ray has met, in the world."""

    p: Vec3
    normal: Vec3  # unit, geometric, outward
    shading: Vec3  # unit
    cos_view: f64  # of the viewer and the shading normal; negative when seen from inside
    material: Table
    where: Where
    light: i64  # number of the light whose surface this is, or -1


@kernel
def find_closest(world: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> ItemHit:
    """Nearest hit of a ray with the scene."""
    hit = closest(table_at(world, TREE), o, d, t_min, t_max)
    if hit.item != i64_at(world, MERGED):
        return hit
    origin = table_at(world, ORIGIN)
    return ItemHit(hit.t, int_at(origin, 2 * hit.prim), int_at(origin, 2 * hit.prim + 1), hit.u, hit.v)


@kernel
def is_blocked(world: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> bool:
    """Whether anything stands between t_min and t_max."""
    return blocked(table_at(world, TREE), o, d, t_min, t_max)


@kernel
def point_of(world: Table, hit: ItemHit, o: Vec3, d: Vec3) -> Point:
    """All that shading needs to know of a hit."""
    item = item_at(table_at(world, ITEMS), hit.item)
    p = o + d * hit.t
    p_object = to_object(item, p)
    s = item_surface(item, hit, p_object)
    shading = normalize(s.shading)
    return Point(
        p, normalize(s.normal), shading, -dot(shading, d), table_at(item, MATERIAL), Where(s.u, s.v, p_object),
        i64_at(item, LIGHT),
    )  # fmt: skip


@kernel
def on_seen_side(point: Point, d: Vec3) -> Point:
    """The point with its shading normal bent just so far that it lies on the side of the surface that is seen.

    Along the outline of a coarse mesh, interpolated normals turn away from the viewer before the surface does; taken
    at their word they show the inside of the mesh.
    """
    facing = -dot(point.normal, d)
    if facing * point.cos_view > 0.0:
        return point
    side = 1.0 if facing >= 0.0 else -1.0
    shading = normalize(point.shading - d * (side * GRAZING - point.cos_view))
    return Point(
        point.p, point.normal, shading, -dot(shading, d), point.material, point.where, point.light
    )  # fmt: skip


@kernel
def light_at(world: Table, index: i64) -> Table:
    """Row of light number `index`."""
    return table_at(table_at(world, LIGHTS), index)


@kernel
def light_count(world: Table) -> i64:
    """Number of lights."""
    return i64_at(world, LIGHT_COUNT)
