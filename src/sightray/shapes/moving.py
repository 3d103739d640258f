"""What moves, as rays meet it: a shape whose place is decided by the ray's own time."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray._jit import implements, kernel
from sightray.fields import child, derived_array, other
from sightray.mathlib.hit import Hit
from sightray.mathlib.motion import Placement
from sightray.mathlib.moving import inverse, point_by, pose_at, transposed_by, vector_by
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, table_at
from sightray.mathlib.vec import Vec3
from sightray.shapes.base import Shape, Surface, intersect, occluded, rise, surface


class _Moving(Shape):
    """A shape on the move, in the world. `scene.compile` makes these of what stands in moving groups and instances.

    The 4th lane of a ray's origin is its time in seconds; a point handed to `surface` is in the space of the shape and
    carries the time as well. Being a shape of its own, it costs scenes in which nothing moves nothing at all.
    """

    shape: Any = child("what moves", "shapes")
    placement: Placement = other("where it is over time", lambda placement: placement)
    _poses: Any = derived_array("the placement as kernels read it", lambda m: m.placement.table())

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        return self.placement.bounds(*self.shape.bounds())


SHAPE, POSES = _Moving.offsets()


@implements(intersect, _Moving)
def intersect_moving(moving: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> Hit:
    back = inverse(pose_at(table_at(moving, POSES), o.w))
    return intersect(table_at(moving, SHAPE), point_by(back, o), vector_by(back, d), t_min, t_max)


@implements(occluded, _Moving)
def occluded_by_moving(moving: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> bool:
    back = inverse(pose_at(table_at(moving, POSES), o.w))
    return occluded(table_at(moving, SHAPE), point_by(back, o), vector_by(back, d), t_min, t_max)


@implements(surface, _Moving)
def surface_of_moving(moving: Table, hit: Hit, p: Vec3) -> Surface:
    s = surface(table_at(moving, SHAPE), hit, Vec3(p.x, p.y, p.z))
    pose = pose_at(table_at(moving, POSES), p.w)
    back = inverse(pose)
    n, shading = transposed_by(back, s.normal), transposed_by(back, s.shading)
    return Surface(n, shading, s.u, s.v, vector_by(pose, s.tangent))


@implements(rise, _Moving)
def rise_over_moving(moving: Table, hit: Hit, p: Vec3, side: f64) -> Vec3:
    up = rise(table_at(moving, SHAPE), hit, Vec3(p.x, p.y, p.z), side)
    return vector_by(pose_at(table_at(moving, POSES), p.w), up)


@kernel
def point_in_moving(moving: Table, p: Vec3) -> Vec3:
    """A world point that carries its time, in the space of the shape."""
    return point_by(inverse(pose_at(table_at(moving, POSES), p.w)), p)


@kernel
def normal_in_moving(moving: Table, n: Vec3, time: f64) -> Vec3:
    """A world normal in the space of the shape, of any length."""
    return transposed_by(pose_at(table_at(moving, POSES), time), n)
