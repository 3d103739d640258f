"""The world as kernels see it: one row that points at everything, and the questions that integrators ask of it."""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.accelerators.base import blocked, closest
from sightray.accelerators.item import (
    BUMPY,
    CUTOUT,
    LIGHT,
    LIGHT_STEP,
    MATERIAL,
    PATTERNED,
    ItemHit,
    is_mirrored,
    item_at,
    item_surface,
    normal_in_object_at,
    object_scale,
    to_object,
)
from sightray.accelerators.item import FLAGS as ITEM_FLAGS
from sightray.bvh.bvh8 import int_at
from sightray.cameras.base import APART, SPREAD
from sightray.lights.base import sky
from sightray.materials.base import Way, bent_normal, opacity
from sightray.mathlib.rng import stream, uniform
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, i64_at, no_table, table_at, vec3_at
from sightray.mathlib.vec import Vec3, cross, dot, length, normalize
from sightray.samplers.base import Draws
from sightray.textures.base import Where

TREE, ITEMS, LIGHTS, LIGHT_COUNT, CAMERA = 0, 1, 2, 3, 4
MERGED, ORIGIN = 5, 6  # item number of the small meshes put together, or NONE; whose triangles its triangles are
BACKGROUND, AMBIENT = 8, 12
KINDS = 7  # the items' materials by class, see scene/kinds.py
FLAGS, MEDIUM, SKIES, SKY_COUNT, CHOOSER = 16, 17, 18, 19, 20  # SKIES: numbers of the lights that are infinite
PIECES = 23  # what eight rays are met with at once, see scene/pieces.py; nothing if the scene is not made of such
AMID = 22  # whether the eye may be inside of a body with a medium
LAMP_COUNT = 21  # lights that the scene states; surfaces that glow come behind them
WORLD_WORDS = 24
NONE = -2
SIEVE = 1e6  # places per metre at which a ray may fall through a half-open surface or not
SLANT = 0.01  # cosine below which footprints grow no longer
GRAZING = 1e-3  # cosine of the viewer and a shading normal that was bent


class Beam(NamedTuple):
    """What a ray carries beside its line: how wide it is, and in which colours it sees."""

    width: f64  # metres, where it starts
    spread: f64  # by which it grows per metre
    bands: Table  # see mathlib/bands.py; null for RGB


class Point(NamedTuple):
    """A point of a surface that a ray has met, in the world."""

    p: Vec3
    normal: Vec3  # unit, geometric, outward
    shading: Vec3  # unit
    cos_view: f64  # of the viewer and the shading normal; negative when seen from inside
    material: Table
    where: Where
    light: i64  # number of the light whose surface this is, or -1
    tangent: Vec3  # derivative of the point by u, metres
    flags: i64  # what the material is beside a plain surface: CUTOUT, BUMPY, ORIENTED, CLEAR, ...


@kernel
def thin_beam() -> Beam:
    """A ray without width, in RGB."""
    return Beam(0.0, 0.0, no_table())


@kernel
def sight_beam(world: Table, draws: Draws, bands: Table) -> Beam:
    """A ray of sight: as wide as the camera's pixels, less what other samples of the pixel see beside it.

    Where it is not known how many there will be, those that came before count; so pictures grow sharper as they go on.
    """
    camera = table_at(world, CAMERA)
    share = 1.0 / math.sqrt(max(draws.samples, draws.sample + 1))
    return Beam(f64_at(camera, APART) * share, f64_at(camera, SPREAD) * share, bands)


@kernel
def find_closest(world: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> ItemHit:
    """Nearest hit of a ray with the scene; holes in surfaces let it through."""
    hit = find_closest_surface(world, o, d, t_min, t_max)
    if i64_at(world, FLAGS) & CUTOUT != 0:
        while hit.item >= 0 and through_hole(world, hit, o, d):
            hit = find_closest_surface(world, o, d, hit.t, t_max)
    return hit


@kernel
def through_hole(world: Table, hit: ItemHit, o: Vec3, d: Vec3) -> bool:
    """Whether a surface lets this ray pass: its opacity is the probability that it does not, drawn by the place."""
    item = item_at(table_at(world, ITEMS), hit.item)
    if i64_at(item, ITEM_FLAGS) & CUTOUT == 0:
        return False
    point = point_of(world, hit, o, d, thin_beam())
    p = point.p
    key = stream(stream(int(p.x * SIEVE), int(p.y * SIEVE)), int(p.z * SIEVE))
    return uniform(key, 0) >= opacity(point.material, point.where)


@kernel
def find_closest_surface(world: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> ItemHit:
    """Nearest hit of a ray with the scene's surfaces, whether they have holes or not."""
    hit = closest(table_at(world, TREE), o, d, t_min, t_max)
    if hit.item != i64_at(world, MERGED):
        return hit
    origin = table_at(world, ORIGIN)
    return ItemHit(hit.t, int_at(origin, 2 * hit.prim), int_at(origin, 2 * hit.prim + 1), hit.u, hit.v)


@kernel
def is_blocked(world: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> bool:
    """Whether anything stands between t_min and t_max."""
    if i64_at(world, FLAGS) & CUTOUT != 0:
        return find_closest(world, o, d, t_min, t_max).item >= 0
    return blocked(table_at(world, TREE), o, d, t_min, t_max)


@kernel
def point_of(world: Table, hit: ItemHit, o: Vec3, d: Vec3, beam: Beam) -> Point:
    """All that shading needs to know of a hit."""
    item = item_at(table_at(world, ITEMS), hit.item)
    p = o + d * hit.t
    p = Vec3(p.x, p.y, p.z, o.w)  # the same time all along the ray, whatever the direction's 4th lane holds
    p_object = to_object(item, p)
    s = item_surface(item, hit, p_object)
    shading = normalize(s.shading)
    material, flags = table_at(item, MATERIAL), i64_at(item, ITEM_FLAGS)
    n = normalize(s.normal)
    where = Where(s.u, s.v, p_object, n, 0.0, beam.bands)
    if flags & (PATTERNED | BUMPY) != 0:
        stretch = length(s.tangent)
        slant = max(abs(dot(n, d)), SLANT)  # a footprint is long where a surface is seen at a slant
        reach = (beam.width + beam.spread * hit.t) / slant
        width = reach / stretch if stretch > 0.0 else 0.0
        inner = normal_in_object_at(item, s.normal, o.w)
        inner = Vec3(inner.x, inner.y, inner.z, reach * object_scale(item, s.tangent))
        where = Where(s.u, s.v, p_object, inner, width, beam.bands)
        if flags & BUMPY != 0:
            mirrored = is_mirrored(item, hit.prim)
            across = cross(n, s.tangent) * (-1.0 if mirrored else 1.0)
            along = moved_in_object(item, p, p_object, s.tangent)
            tilted = bent_normal(material, where, Way(stretch, along, moved_in_object(item, p, p_object, across)))
            if mirrored:
                tilted = Vec3(tilted.x, -tilted.y, tilted.z)
            shading = bent(shading, s.tangent, tilted)
    light = i64_at(item, LIGHT) + i64_at(item, LIGHT_STEP) * hit.prim
    return Point(
        p, n, shading, -dot(shading, d), material, where, light, s.tangent, flags,
    )  # fmt: skip


@kernel
def moved_in_object(item: Table, p: Vec3, p_object: Vec3, way: Vec3) -> Vec3:
    """How a way from p in the world goes in the item's object space."""
    return to_object(item, Vec3(p.x + way.x, p.y + way.y, p.z + way.z, p.w)) - p_object


@kernel
def bent(n: Vec3, tangent: Vec3, local_normal: Vec3) -> Vec3:
    """A normal that was given in the frame of the tangent and the shading normal, in the world."""
    across = cross(n, tangent)
    if not dot(across, across) > 0.0:
        return n
    b = normalize(across)
    return normalize(cross(b, n) * local_normal.x + b * local_normal.y + n * local_normal.z)


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
        point.p, point.normal, shading, -dot(shading, d), point.material, point.where, point.light, point.tangent,
        point.flags,
    )  # fmt: skip


@kernel
def light_at(world: Table, index: i64) -> Table:
    """Row of light number `index`."""
    return table_at(table_at(world, LIGHTS), index)


@kernel
def light_count(world: Table) -> i64:
    """Number of lights, with surfaces that glow."""
    return i64_at(world, LIGHT_COUNT)


@kernel
def lamp_count(world: Table) -> i64:
    """Number of lights that the scene states; they have the lowest numbers."""
    return i64_at(world, LAMP_COUNT)


@kernel
def background(world: Table, d: Vec3) -> Vec3:
    """Radiance, RGB, that a ray in direction d finds where it meets nothing: the background and all skies."""
    color = vec3_at(world, BACKGROUND)
    for k in range(i64_at(world, SKY_COUNT)):
        color += sky(light_at(world, i64_at(table_at(world, SKIES), k)), d)
    return color
