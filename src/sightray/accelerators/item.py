"""Items: one shape at one place. The leaves of the scene's tree.

An item row is `ITEM_WORDS` words: where its shape and material stand, the number of the scene's object that it belongs
to, the number of the light that it is the shape of (or -1), what its material is beside a plain surface, and the two
matrices between world and object. What moves has them for time 0; rays meet its `shapes.moving` wrapper, to which the
4th lane of their origin, the time in seconds, says where it is. Points on rays and in object space carry that on.
Instances share the shape's row, and so its triangles and its tree.
"""

from __future__ import annotations

from typing import NamedTuple

from sightray._jit import kernel
from sightray.mathlib.hit import Hit
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, advance, i64_at, table_at, vec3_at
from sightray.mathlib.transform import transform_normal, transform_point, transform_vector
from sightray.mathlib.vec import Vec3, cross, dot, length, normalize
from sightray.shapes.base import Surface, handedness, intersect, occluded, surface
from sightray.shapes.moving import normal_in_moving, point_in_moving

SHAPE, MATERIAL, MOVED, OBJECT, LIGHT, FLAGS = 0, 1, 2, 3, 4, 5
MET = 7  # what rays meet: the shape, or the wrapper of what moves
UNMOVED, PLACED, MOVING = 0, 1, 2  # MOVED: object space is world space; is not; and changes with time
LIGHT_STEP = 6  # from the light that a primitive is to that of the next: 1 where each triangle is one, else 0
# Bits of FLAGS: what the material is, see materials/base.py.
CUTOUT, BUMPY, ORIENTED, CLEAR, THIN, TRANSLUCENT, PATTERNED = 1, 2, 4, 8, 16, 32, 64
OBJECT_FROM_WORLD, WORLD_FROM_OBJECT = 8, 24
ITEM_WORDS = 40
TINY = 2.0**-1000  # metres; what is added to numbers that may be zero


class ItemHit(NamedTuple):
    """The nearest meeting of a ray and the items of a scene; ``t`` is infinite and `item` -1 where there is none."""

    t: f64
    item: i64
    prim: i64
    u: f64
    v: f64


@kernel
def better(hit: ItemHit, best: ItemHit) -> bool:
    """Whether a hit is nearer; of two at the same place the lower item and primitive counts, whatever the order."""
    if hit.t != best.t:
        return hit.t < best.t
    return hit.item < best.item or (hit.item == best.item and hit.prim < best.prim)


@kernel
def worth(best: ItemHit, t_max: f64) -> f64:
    """Up to where a better hit may lie: just behind the best one so far, so that one at the same place is seen."""
    return min(t_max, just_behind(best.t))


@kernel
def just_behind(t: f64) -> f64:
    """A number that is larger than t, by hardly anything."""
    return t + (abs(t) * 2.0**-52 + TINY)


@kernel
def item_at(items: Table, index: i64) -> Table:
    """Row of item number `index`."""
    return advance(items, index * ITEM_WORDS)


@kernel
def intersect_item(item: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> Hit:
    """Send the inverse-transformed ray to the item's shape; t means the same in both spaces."""
    shape = table_at(item, MET)
    if i64_at(item, MOVED) != PLACED:
        return intersect(shape, o, d, t_min, t_max)
    o_object = transform_point(item, OBJECT_FROM_WORLD, o)
    d_object = transform_vector(item, OBJECT_FROM_WORLD, d)
    return intersect(shape, o_object, d_object, t_min, t_max)


@kernel
def occluded_item(item: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> bool:
    """Whether the item stands in the way."""
    shape = table_at(item, MET)
    if i64_at(item, MOVED) != PLACED:
        return occluded(shape, o, d, t_min, t_max)
    o_object = transform_point(item, OBJECT_FROM_WORLD, o)
    d_object = transform_vector(item, OBJECT_FROM_WORLD, d)
    return occluded(shape, o_object, d_object, t_min, t_max)


@kernel
def item_surface(item: Table, hit: ItemHit, p_object: Vec3) -> Surface:
    """The surface at a hit in world space: normals by the inverse transpose, tangents by the matrix."""
    moved = i64_at(item, MOVED)
    # Only what moves is told the time: normals and tangents have none.
    p = Vec3(p_object.x, p_object.y, p_object.z, p_object.w if moved == MOVING else 0.0)
    s = surface(table_at(item, MET), Hit(hit.t, hit.prim, hit.u, hit.v), p)
    if moved != PLACED:
        return s
    return Surface(
        transform_normal(item, OBJECT_FROM_WORLD, s.normal),
        transform_normal(item, OBJECT_FROM_WORLD, s.shading),
        s.u, s.v, transform_vector(item, WORLD_FROM_OBJECT, s.tangent),
    )  # fmt: skip


@kernel
def normal_in_object(item: Table, n: Vec3) -> Vec3:
    """A world normal as a unit vector of the item's object space, at time 0."""
    return normal_in_object_at(item, n, 0.0)


@kernel
def normal_in_object_at(item: Table, n: Vec3, time: f64) -> Vec3:
    """A world normal as a unit vector of the item's object space at a time, seconds."""
    moved = i64_at(item, MOVED)
    if moved == UNMOVED:
        return normalize(n)
    if moved == MOVING:
        return normalize(normal_in_moving(table_at(item, MET), n, time))
    return normalize(transform_normal(item, WORLD_FROM_OBJECT, n))


@kernel
def object_scale(item: Table, along: Vec3) -> f64:
    """How long a metre of the world is in the item's object space, about; measured along a tangent."""
    size = length(along)
    if i64_at(item, MOVED) != PLACED or not size > 0.0:
        return 1.0
    return length(transform_vector(item, OBJECT_FROM_WORLD, along)) / size


@kernel
def is_mirrored(item: Table, prim: i64) -> bool:
    """Whether texture coordinates run over a primitive as in a mirror: u, v and the outward normal are left-handed."""
    hand = handedness(table_at(item, SHAPE), prim)
    if i64_at(item, MOVED) == PLACED:
        m = OBJECT_FROM_WORLD
        hand *= dot(vec3_at(item, m), cross(vec3_at(item, m + 4), vec3_at(item, m + 8)))
    return hand < 0.0


@kernel
def to_object(item: Table, p: Vec3) -> Vec3:
    """A world point in the item's object space; both carry the time."""
    moved = i64_at(item, MOVED)
    if moved == UNMOVED:
        return p
    q = point_in_moving(table_at(item, MET), p) if moved == MOVING else transform_point(item, OBJECT_FROM_WORLD, p)
    return Vec3(q.x, q.y, q.z, p.w)
