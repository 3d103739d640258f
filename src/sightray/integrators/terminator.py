"""Where shadow rays begin on smooth meshes, whose shading is rounder than they are.

A coarse mesh with interpolated normals is lit as if it were round, but its flat triangles turn from the light one by
one: the edge of night is a staircase. So shadow rays begin on a surface that is as round as the shading: above the
point, on the tangent planes of the triangle's corners, weighed as the normals are (J. Hanika, "Hacking the shadow
terminator", Ray Tracing Gems II, 2021). Where the mesh is hollow, and at its corners, nothing changes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.accelerators.item import MET, MOVED, MOVING, PLACED, WORLD_FROM_OBJECT, ItemHit, item_at
from sightray.mathlib.hit import Hit
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, i64_at, table_at
from sightray.mathlib.transform import transform_vector
from sightray.mathlib.vec import Vec3, dot, length
from sightray.scene.world import ITEMS, Point
from sightray.shapes.base import rise


class ShadowRay(NamedTuple):
    """Where a shadow ray begins, its unit direction, and where the light is."""

    o: Vec3
    d: Vec3
    distance: f64


@kernel
def lifted(world: Table, hit: ItemHit, point: Point) -> Vec3:
    """The point from which shadow rays begin on the side that is seen."""
    bend = point.shading - point.normal
    if not dot(bend, bend) > 0.0:
        return point.p
    item = item_at(table_at(world, ITEMS), hit.item)
    p, moved = point.where.p, i64_at(item, MOVED)
    side = 1.0 if point.cos_view >= 0.0 else -1.0
    time = p.w if moved == MOVING else 0.0  # only what moves is told the time
    up = rise(table_at(item, MET), Hit(hit.t, hit.prim, hit.u, hit.v), Vec3(p.x, p.y, p.z, time), side)
    if moved == PLACED:
        up = transform_vector(item, WORLD_FROM_OBJECT, up)
    return point.p + Vec3(up.x, up.y, up.z)


@kernel
def shadow_ray(start: Vec3, p: Vec3, d: Vec3, distance: f64) -> ShadowRay:
    """The ray from `start` to the light that p sees in direction d."""
    step = start - p
    if distance == math.inf or not dot(step, step) > 0.0:
        return ShadowRay(start, d, distance)
    way = d * distance - step
    size = length(way)
    return ShadowRay(start, way / size, size)
