"""How rays meet the smooth surface that the points of a `PointCloud` imply; the mathematics stands there.

All balls that the ray's line meets are listed, sorted by where it enters them; where they overlap, they form stretches of
the line, and only there is f defined. Where the list has no room for all, the line is taken in shorter windows. What is
listed and where f is evaluated does not depend on t_min and t_max: a root is the same number for all rays that continue
one another.
"""

from __future__ import annotations

import math

from sightray._jit import kernel
from sightray.bvh.bvh8 import (
    CENTER,
    CHILD,
    HALF,
    LEAF,
    NODES,
    SCALE,
    STACK_WORDS,
    box_ray,
    push_children_unsorted,
    unit_ray,
)
from sightray.bvh.nearest import push_nearest, to_unit
from sightray.mathlib.hit import Hit, miss
from sightray.mathlib.rays import is_ray, nearest_parameter
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.sorting import sort_rows
from sightray.mathlib.table import Table, f64_at, f64_put, i64_at, i64_put, scratch, table_at, vec3_at
from sightray.mathlib.vec import Vec3, dot, length
from sightray.shapes.base import Surface
from sightray.shapes.point_roots import WORDS, Line, Range, root_in_stretch
from sightray.shapes.point_splats import BALL_WORDS, BALLS, NUMBER, ball_normal, ball_point, ball_radius, disk_surface

ROOM, ROOM_WORDS = 1024, 3072  # of the list of balls, whose rows `point_roots` describes
STEPS = 6.0  # samples for each radius
MOST_STEPS = 4096


@kernel
def list_balls(cloud: Table, line: Line, low: f64, high: f64, rows: Table) -> i64:
    """List the balls that the line meets between two places, sorted; more than `ROOM` if there is no room for all."""
    unit = unit_ray(cloud, line.p, line.q, low, high)
    balls, count = table_at(cloud, BALLS), 0
    if not unit.reach >= 0.0:
        return 0
    boxes = box_ray(unit)
    stack = scratch(STACK_WORDS)
    i64_put(stack, 0, 0)
    top = 1
    while top > 0 and count <= ROOM:
        top -= 1
        child = i64_at(stack, top)
        if child < LEAF:
            top = push_children_unsorted(table_at(cloud, NODES), child, boxes, unit.reach, stack, top)
            continue
        first = (child - LEAF) >> 3
        for ball in range(first, first + (child & 7)):
            c, r = ball_point(balls, ball) - line.p, ball_radius(balls, ball)
            middle = dot(c, line.q)
            aside = c - line.q * middle
            square = r * r - dot(aside, aside)
            half = math.sqrt(max(square, 0.0))
            if square > 0.0 and middle + half > low and middle - half < high:
                if count < ROOM:
                    f64_put(rows, count * WORDS, middle - half)
                    f64_put(rows, count * WORDS + 1, middle + half)
                    i64_put(rows, count * WORDS + 2, ball)
                count += 1
    sort_rows(rows, 0, min(count, ROOM), WORDS)
    return count


@kernel
def first_root(balls: Table, rows: Table, count: i64, line: Line, low: f64, high: f64, wanted: Range) -> f64:
    """The first root that is wanted between two places of the line, or infinity."""
    first = 0
    while first < count:
        # Find the stretch of overlapping balls that begins here.
        begin, end, last, r = f64_at(rows, first * WORDS), f64_at(rows, first * WORDS + 1), first, math.inf
        while last < count and f64_at(rows, last * WORDS) < end:
            end = max(end, f64_at(rows, last * WORDS + 1))
            r = min(r, ball_radius(balls, i64_at(rows, last * WORDS + 2)))
            last += 1
        # At its very ends no ball weighs anything.
        inset = 1e-7 * (end - begin)
        begin, end = max(begin + inset, low), min(end - inset, high)
        if end > begin and end >= wanted.low and begin <= wanted.high:
            n = min(MOST_STEPS, 1 + int((end - begin) * STEPS / r))
            s = root_in_stretch(balls, rows, first, last, line, begin, end, n, wanted)
            if s < math.inf:
                return s
        first = last
    return math.inf


@kernel
def nearest_ball(balls: Table, rows: Table, count: i64, line: Line, s: f64) -> i64:
    """Of the balls that hold p + s q, the one with the nearest centre; -1 if there is none."""
    best, square, x = -1, math.inf, line.p + line.q * s
    for i in range(count):
        ball = i64_at(rows, i * WORDS + 2)
        away = x - ball_point(balls, ball)
        if dot(away, away) < square and f64_at(rows, i * WORDS) < s < f64_at(rows, i * WORDS + 1):
            best, square = ball, dot(away, away)
    return best


@kernel
def trace_smooth(cloud: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> Hit:
    """The nearest root of f along the ray; the first parameter of the hit is the row of the nearest ball."""
    if not (is_ray(o, d) and t_min < t_max):
        return miss()
    start, speed, balls = nearest_parameter(o, d, vec3_at(cloud, CENTER)), length(d), table_at(cloud, BALLS)
    line = Line(o + d * start, d / speed)
    size = 1.01 * length(vec3_at(cloud, HALF)) / f64_at(cloud, SCALE)
    if not length(line.p - vec3_at(cloud, CENTER)) <= size:
        return miss()
    wanted = Range((t_min - start) * speed, (t_max - start) * speed, start, speed, t_min, t_max)
    rows = scratch(ROOM_WORDS)
    low, width = -size, 2.0 * size
    while low < size and low <= wanted.high:
        high = min(low + width, size)
        count = list_balls(cloud, line, low, high, rows)
        if count > ROOM and width > 1e-4 * size:
            width *= 0.5
            continue
        count = min(count, ROOM)
        if high >= wanted.low:
            s = first_root(balls, rows, count, line, low, high, wanted)
            if s < math.inf:
                ball = nearest_ball(balls, rows, count, line, s)
                number = int(f64_at(balls, max(ball, 0) * BALL_WORDS + NUMBER))
                return Hit(start + s / speed, number, float(max(ball, 0)), 0.0)
        low = high
    return miss()


@kernel
def surface_of_smooth(cloud: Table, hit: Hit, p: Vec3) -> Surface:
    """The normal is the gradient of f: of Σ w n·(x - p), since f is zero."""
    balls, unit, n = table_at(cloud, BALLS), to_unit(cloud, p), Vec3(0.0, 0.0, 0.0)
    stack = scratch(STACK_WORDS)
    i64_put(stack, 0, 0)
    top = 1
    while top > 0:
        top -= 1
        child = i64_at(stack, top) & CHILD
        if child < LEAF:
            top = push_nearest(table_at(cloud, NODES), child, unit, 0.0, stack, top)
            continue
        first = (child - LEAF) >> 3
        for ball in range(first, first + (child & 7)):
            away, r = p - ball_point(balls, ball), ball_radius(balls, ball)
            rest = 1.0 - dot(away, away) / (r * r)
            if rest > 0.0:
                normal, cube = ball_normal(balls, ball), rest * rest * rest
                n = n + normal * (cube * rest) - away * (8.0 * cube * dot(normal, away) / (r * r))
    return disk_surface(balls, int(hit.u), n, p)
