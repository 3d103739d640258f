"""How rays meet the oriented disks of a `PointCloud`."""

from __future__ import annotations

import math

from sightray._jit import kernel
from sightray.bvh.bvh8 import CHILD, LEAF, NODES, STACK_WORDS, TREE_WORDS, box_ray, push_children, unit_ray
from sightray.mathlib.frame import perpendicular
from sightray.mathlib.hit import Hit, miss
from sightray.mathlib.lanes import sort_key
from sightray.mathlib.rays import is_ray
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, i64_at, i64_put, scratch, table_at, vec3_at
from sightray.mathlib.vec import Vec3, cross, dot
from sightray.shapes.base import Surface

MODE, BALLS = TREE_WORDS + 2, TREE_WORDS + 3  # words of the row: which surface, and a pointer to rows of BALL_WORDS
RADIUS, NORMAL, NUMBER, BALL_WORDS = 3, 4, 7, 8
SPLATS = 1


@kernel
def ball_point(balls: Table, row: i64) -> Vec3:
    """The point."""
    return vec3_at(balls, row * BALL_WORDS)


@kernel
def ball_normal(balls: Table, row: i64) -> Vec3:
    """Its unit normal."""
    return vec3_at(balls, row * BALL_WORDS + NORMAL)


@kernel
def ball_radius(balls: Table, row: i64) -> f64:
    """Its reach."""
    return f64_at(balls, row * BALL_WORDS + RADIUS)


@kernel
def meet_disk(balls: Table, row: i64, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> f64:
    """Where the ray meets a point's disk, or infinity."""
    n, c = ball_normal(balls, row), ball_point(balls, row) - o
    slope = dot(n, d)
    if slope == 0.0:
        return math.inf
    t = dot(n, c) / slope
    away, r = d * t - c, ball_radius(balls, row)
    return t if t_min < t < t_max and dot(away, away) <= r * r else math.inf


@kernel
def trace_splats(cloud: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> Hit:
    """The nearest disk that the ray meets; the first parameter of the hit is the disk's row."""
    unit = unit_ray(cloud, o, d, t_min, t_max)
    reach, balls = unit.reach, table_at(cloud, BALLS)
    nearest, found = t_max, -1
    if not (reach >= 0.0 and is_ray(o, d)):
        return miss()
    boxes = box_ray(unit)
    stack = scratch(STACK_WORDS)
    i64_put(stack, 0, 0)
    top = 1
    while top > 0:
        top -= 1
        key = i64_at(stack, top)
        if key > sort_key(reach):
            continue
        child = key & CHILD
        if child < LEAF:
            top = push_children(table_at(cloud, NODES), child, boxes, reach, stack, top)
            continue
        first = (child - LEAF) >> 3
        for row in range(first, first + (child & 7)):
            t = meet_disk(balls, row, o, d, t_min, nearest)
            if t < nearest:
                nearest, found = t, row
                reach = min(reach, t * unit.speed - unit.start + unit.slack)
    if found < 0:
        return miss()
    return Hit(nearest, int(f64_at(balls, found * BALL_WORDS + NUMBER)), float(found), 0.0)


@kernel
def disk_surface(balls: Table, row: i64, n: Vec3, p: Vec3) -> Surface:
    """A surface point with normal n, in the coordinates of a point's disk; the tangent keeps v."""
    flat = ball_normal(balls, row)
    e1 = perpendicular(flat)
    e2, away, size = cross(flat, e1), p - ball_point(balls, row), 0.5 / ball_radius(balls, row)
    tangent = cross(e2, n)
    rise = dot(tangent, e1) * size
    if rise != 0.0:
        tangent = tangent / rise
    return Surface(n, n, 0.5 + size * dot(away, e1), 0.5 + size * dot(away, e2), tangent)


@kernel
def surface_of_splat(cloud: Table, hit: Hit, p: Vec3) -> Surface:
    """The surface of a disk."""
    balls, row = table_at(cloud, BALLS), int(hit.u)
    return disk_surface(balls, row, ball_normal(balls, row), p)
