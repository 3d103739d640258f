"""The nearest point of the meshes of a scene, and how often their surfaces wind around a point.

Trees are walked from the nearest box on (`bvh.nearest`); the nearest point of a triangle is found by the
regions of its plane (C. Ericson, "Real-Time Collision Detection", 2004, 5.1.5), in coordinates relative to the query
point, so that far-away scenes keep their digits. Distances are those of the world: in the object space of a moved item
they are at most 1/`shrink` times as long, where `shrink` is the smallest singular value of its matrix.

**Inside** is where surfaces wind around a point: of a ray from it, crossings that leave less crossings that enter, over
all meshes. Crossings are exact (`crossings`), so that one ray decides, whatever it grazes. Angle-weighted normals at the
nearest point (J. Bærentzen, H. Aanæs, 2005) would save the ray, but are wrong where bodies overlap: there the nearest
surface may lie inside of another.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.accelerators.bvh import ITEMS, ORDER, UNBOUNDED, UNBOUNDED_COUNT
from sightray.accelerators.item import OBJECT, SHAPE, item_at, to_object
from sightray.bvh.bvh8 import CHILD, LEAF, NODES, SCALE, STACK_WORDS, int_at
from sightray.bvh.nearest import push_nearest, to_unit
from sightray.bvh.triangles import NUMBERS
from sightray.mathlib.lanes import sort_key
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.sorting import sort_rows
from sightray.mathlib.table import Table, f64_at, f64_put, i32_put, i64_at, i64_put, scratch, table_at
from sightray.mathlib.vec import Vec3, dot
from sightray.scene.crossings import LAYER_WORDS, MESH, mesh_corner, place
from sightray.scene.layer_kernels import cross_items, drop_repeated
from sightray.scene.query_kernels import LOOK, put_triple, triple_at


class Near(NamedTuple):
    """The nearest point so far."""

    square: f64  # of the distance
    item: i64
    prim: i64
    u: f64  # weights of the second and third corner
    v: f64


class Weights(NamedTuple):
    """Barycentric weights of the second and third corner."""

    u: f64
    v: f64


@kernel
def nearest_of_triangle(a: Vec3, b: Vec3, c: Vec3) -> Weights:
    """The point of a triangle that is nearest to the origin (Ericson, 2004)."""
    ab, ac = b - a, c - a
    d1, d2, d3, d4, d5, d6 = -dot(ab, a), -dot(ac, a), -dot(ab, b), -dot(ac, b), -dot(ab, c), -dot(ac, c)
    if d1 <= 0.0 and d2 <= 0.0:
        return Weights(0.0, 0.0)
    if d3 >= 0.0 and d4 <= d3:
        return Weights(1.0, 0.0)
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        return Weights(d1 / (d1 - d3), 0.0)
    if d6 >= 0.0 and d5 <= d6:
        return Weights(0.0, 1.0)
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        return Weights(0.0, d2 / (d2 - d6))
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 >= d3 and d5 >= d6:
        v = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return Weights(1.0 - v, v)
    total = va + vb + vc
    return Weights(vb / total, vc / total)


@kernel
def nearer_triangle(item: Table, index: i64, triangle: i64, p: Vec3, best: Near) -> Near:
    """The nearest point of a triangle to the world point p if it is nearer than the best one so far, or else that one."""
    mesh = table_at(item, SHAPE)
    a = place(item, mesh_corner(mesh, triangle, 0)) - p
    b = place(item, mesh_corner(mesh, triangle, 1)) - p
    c = place(item, mesh_corner(mesh, triangle, 2)) - p
    w = nearest_of_triangle(a, b, c)
    x = a + (b - a) * w.u + (c - a) * w.v
    square = dot(x, x)
    return Near(square, index, triangle, w.u, w.v) if square < best.square else best


@kernel
def nearest_of_mesh(item: Table, index: i64, shrink: f64, p: Vec3, best: Near) -> Near:
    """The nearest point of a mesh if it is nearer than the best one so far, or else that one."""
    mesh = table_at(item, SHAPE)
    unit = to_unit(mesh, to_object(item, p))
    per_world = f64_at(mesh, SCALE) / shrink * (1.0 + 2.0**-40)
    per_world *= per_world
    stack = scratch(STACK_WORDS)
    i64_put(stack, 0, 0)
    top = 1
    while top > 0:
        top -= 1
        key = i64_at(stack, top)
        if key > sort_key(best.square * per_world):
            continue
        child = key & CHILD
        if child < LEAF:
            top = push_nearest(table_at(mesh, NODES), child, unit, best.square * per_world, stack, top)
            continue
        block = child & (LEAF - 1)
        for lane in range(4):
            triangle = int_at(table_at(mesh, NUMBERS), 4 * block + lane)
            if triangle >= 0:
                best = nearer_triangle(item, index, triangle, p, best)
    return best


@kernel
def nearest_of_item(tree: Table, kinds: Table, shrinks: Table, index: i64, p: Vec3, best: Near) -> Near:
    """`nearest_of_mesh` for an item, if that shows a mesh."""
    if int_at(kinds, index) != MESH:
        return best
    return nearest_of_mesh(item_at(table_at(tree, ITEMS), index), index, f64_at(shrinks, index), p, best)


@kernel
def nearest_of_items(tree: Table, kinds: Table, shrinks: Table, p: Vec3) -> Near:
    """The nearest point of all meshes of a scene."""
    best = Near(math.inf, -1, -1, 0.0, 0.0)
    for i in range(i64_at(tree, UNBOUNDED_COUNT)):  # all of them, where they are few
        best = nearest_of_item(tree, kinds, shrinks, int_at(table_at(tree, UNBOUNDED), i), p, best)
    unit = to_unit(tree, p)
    per_world = f64_at(tree, SCALE) * (1.0 + 2.0**-40)
    per_world *= per_world
    stack = scratch(STACK_WORDS)
    i64_put(stack, 0, 0)
    top = 1
    while top > 0:
        top -= 1
        key = i64_at(stack, top)
        if key > sort_key(best.square * per_world):
            continue
        child = key & CHILD
        if child < LEAF:
            top = push_nearest(table_at(tree, NODES), child, unit, best.square * per_world, stack, top)
            continue
        first = (child - LEAF) >> 3
        for i in range(first, first + (child & 7)):
            best = nearest_of_item(tree, kinds, shrinks, int_at(table_at(tree, ORDER), i), p, best)
    return best


@kernel
def nearest_of_points(
    tree: Table, kinds: Table, shrinks: Table, points: Table, form: i64, n: i64,
    near: Table, distances: Table, objects: Table, primitives: Table, uv: Table, stop: Table,
) -> None:  # fmt: skip
    """For each point the nearest one of the meshes; NaN, infinity and -1 if it is not finite or there are none."""
    for i in range(n):
        if i & LOOK == LOOK and i64_at(stop, 0) != 0:
            return
        p = triple_at(points, form, i)
        best = Near(math.inf, -1, -1, math.nan, math.nan)
        if dot(p, p) < math.inf:
            best = nearest_of_items(tree, kinds, shrinks, p)
        q, object = Vec3(math.nan, math.nan, math.nan), -1
        if best.item >= 0:
            item = item_at(table_at(tree, ITEMS), best.item)
            mesh, object = table_at(item, SHAPE), i64_at(item, OBJECT)
            a = mesh_corner(mesh, best.prim, 0)
            b, c = mesh_corner(mesh, best.prim, 1) - a, mesh_corner(mesh, best.prim, 2) - a
            q = place(item, a + b * best.u + c * best.v)
        put_triple(near, i, q)
        f64_put(distances, i, math.sqrt(best.square))
        i32_put(objects, i, object)
        i32_put(primitives, i, best.prim)
        f64_put(uv, 2 * i, best.u if best.item >= 0 else math.nan)
        f64_put(uv, 2 * i + 1, best.v if best.item >= 0 else math.nan)


@kernel
def windings_of_points(
    tree: Table, kinds: Table, points: Table, form: i64, n: i64, rows: Table, capacity: i64, windings: Table,
    stop: Table,
) -> i64:  # fmt: skip
    """How often the meshes wind around each point; the crossings that one of them needs room for if it is too many."""
    d = Vec3(0.3588, 0.6241, 0.6941)  # along nothing that is built
    for i in range(n):
        if i & LOOK == LOOK and i64_at(stop, 0) != 0:
            return 0
        p = triple_at(points, form, i)
        total = 0
        if dot(p, p) < math.inf:
            count = cross_items(tree, kinds, p, d, 0.0, math.inf, rows, capacity, 0)
            if count > capacity:
                return count
            sort_rows(rows, 0, count, LAYER_WORDS)
            count = drop_repeated(rows, 0, count)
            for row in range(count):
                if int_at(kinds, i64_at(rows, row * LAYER_WORDS + 1)) == MESH:
                    total += 1 - 2 * i64_at(rows, row * LAYER_WORDS + 3)
        i64_put(windings, i, total)
    return 0
