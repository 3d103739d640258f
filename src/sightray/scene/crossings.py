"""Every surface along a ray, each exactly once.

A mesh is not asked triangle by triangle for "a hit within rounding": on a shared edge that gives two hits or none, and a
ray that enters a closed mesh would not be seen to leave it. Here the ray runs along z through the origin, as in
`bvh.triangles`, and a triangle is crossed if the origin is on the same side of all three edges. The sign of an
edge function is *exact*: where rounded products are equal, their rounding errors are compared (T. Dekker, 1971); where
those are equal too, the ray is moved aside by an infinitesimal (e, e^2), the same for all triangles (H. Edelsbrunner,
E. Mücke, "Simulation of simplicity", 1990). Two triangles find opposite signs for a shared edge, so an infinite line
leaves every closed mesh as often as it enters it.
"""

from __future__ import annotations

from typing import NamedTuple

from sightray._jit import kernel
from sightray.accelerators.item import MOVED, OBJECT_FROM_WORLD, WORLD_FROM_OBJECT
from sightray.bvh.bvh8 import LEAF, NODES, STACK_WORDS, box_ray, int_at, push_children_unsorted, unit_ray
from sightray.bvh.triangles import (
    BLOCK_FLOATS,
    BLOCKS,
    NUMBERS,
    Shear,
    axis_of,
    edge_functions,
    filter_block,
    shear,
    times,
    triangle_ray,
)
from sightray.mathlib.lanes import lowest_bit
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_put, i64_at, i64_put, scratch, table_at
from sightray.mathlib.transform import transform_point, transform_vector
from sightray.mathlib.vec import Vec3, dot
from sightray.shapes.mesh import FACES_GIVEN, VERTICES_GIVEN, vec3_of

MESH, OTHER = 1, 0  # what `kinds` says of an item, a 32-bit integer each
LAYER_WORDS = 4  # of a crossing: t as a double; item, primitive, 1 for entering and 0 for leaving


class ObjectRay(NamedTuple):
    """A ray in the space of an item's shape."""

    o: Vec3
    d: Vec3


@kernel
def object_ray(item: Table, o: Vec3, d: Vec3) -> ObjectRay:
    """Bring a ray into the item's object space; t means the same in both."""
    if i64_at(item, MOVED) == 0:
        return ObjectRay(o, d)
    return ObjectRay(transform_point(item, OBJECT_FROM_WORLD, o), transform_vector(item, OBJECT_FROM_WORLD, d))


@kernel
def place(item: Table, p: Vec3) -> Vec3:
    """A point of object space in the world."""
    return p if i64_at(item, MOVED) == 0 else transform_point(item, WORLD_FROM_OBJECT, p)


@kernel
def mesh_corner(mesh: Table, triangle: i64, corner: i64) -> Vec3:
    """Corner number 0, 1 or 2 of a triangle."""
    return vec3_of(table_at(mesh, VERTICES_GIVEN), int_at(table_at(mesh, FACES_GIVEN), 3 * triangle + corner))


class Corners(NamedTuple):
    """Three corners by axis, sheared such that the ray runs along z through the origin."""

    x: Vec3
    y: Vec3
    z: Vec3


@kernel
def sheared_corners(mesh: Table, triangle: i64, o: Vec3, s: Shear) -> Corners:
    """The corners of a triangle as the ray sees them: to the last bit those of `meet_triangle`."""
    a, b, c = mesh_corner(mesh, triangle, 0) - o, mesh_corner(mesh, triangle, 1) - o, mesh_corner(mesh, triangle, 2) - o
    z = Vec3(axis_of(a, s.kz), axis_of(b, s.kz), axis_of(c, s.kz))
    x = Vec3(axis_of(a, s.kx), axis_of(b, s.kx), axis_of(c, s.kx)) - times(z, s.sx)
    y = Vec3(axis_of(a, s.ky), axis_of(b, s.ky), axis_of(c, s.ky)) - times(z, s.sy)
    return Corners(x, y, z)


# --------------------------------------------------------------------------------------------------------- exact signs


@kernel(exact=True)
def product_error(a: f64, b: f64, product: f64) -> f64:
    """What rounding took from a product: exactly a b - product (T. Dekker, 1971; splits by G. Veltkamp)."""
    p, q = 134217729.0 * a, 134217729.0 * b
    a1, b1 = p - (p - a), q - (q - b)
    a2, b2 = a - a1, b - b1
    return ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2


@kernel(exact=True)
def edge_side(px: f64, py: f64, qx: f64, qy: f64) -> i64:
    """On which side of the edge from p to q the origin lies, 1 or -1; opposite for the edge from q to p. 0 if p is q."""
    a, b = px * qy, qx * py
    if a != b:
        return 1 if a > b else -1
    rest, other = product_error(px, qy, a), product_error(qx, py, b)
    if rest != other:
        return 1 if rest > other else -1
    if py != qy:
        return 1 if py > qy else -1
    if px != qx:
        return 1 if qx > px else -1
    return 0


@kernel
def triangle_side(c: Corners) -> i64:
    """1 if the corners run counter-clockwise around the ray, -1 if clockwise, 0 if it passes by."""
    first = edge_side(c.x.x, c.y.x, c.x.y, c.y.y)
    if first == 0 or edge_side(c.x.y, c.y.y, c.x.z, c.y.z) != first or edge_side(c.x.z, c.y.z, c.x.x, c.y.x) != first:
        return 0
    return first


@kernel
def depth_along(c: Corners) -> f64:
    """z where the ray crosses a triangle that it is known to cross."""
    e = edge_functions(c.x, c.y)
    total = e.x + e.y + e.z
    z = dot(e, c.z) / total if total != 0.0 else c.z.x
    return max(min(c.z.x, c.z.y, c.z.z), min(max(c.z.x, c.z.y, c.z.z), z))  # rounding shall not leave the triangle


# ------------------------------------------------------------------------------------------------------------ crossings


@kernel
def put_layer(rows: Table, capacity: i64, row: i64, t: f64, item: i64, prim: i64, entering: bool) -> i64:
    """Write a crossing if there is room; the number of crossings in any case."""
    if row < capacity:
        f64_put(rows, row * LAYER_WORDS, t)
        i64_put(rows, row * LAYER_WORDS + 1, item)
        i64_put(rows, row * LAYER_WORDS + 2, prim)
        i64_put(rows, row * LAYER_WORDS + 3, 1 if entering else 0)
    return row + 1


@kernel
def cross_mesh(
    mesh: Table, item: i64, o: Vec3, d: Vec3, t_min: f64, t_max: f64, rows: Table, capacity: i64, count: i64
) -> i64:
    """Add the triangles that the ray crosses; the new number of crossings."""
    unit = unit_ray(mesh, o, d, t_min, t_max)
    if not unit.reach >= 0.0:
        return count
    boxes, lanes, s = box_ray(unit), triangle_ray(unit), shear(d)
    stack = scratch(STACK_WORDS)
    i64_put(stack, 0, 0)
    top = 1
    while top > 0:
        top -= 1
        child = i64_at(stack, top)
        if child < LEAF:
            top = push_children_unsorted(table_at(mesh, NODES), child, boxes, unit.reach, stack, top)
            continue
        block = child & (LEAF - 1)
        maybe = filter_block(table_at(mesh, BLOCKS), block * BLOCK_FLOATS, lanes, unit.reach).maybe
        while maybe != 0:
            triangle = int_at(table_at(mesh, NUMBERS), 4 * block + lowest_bit(maybe))
            maybe &= maybe - 1
            c = sheared_corners(mesh, triangle, o, s)
            side = triangle_side(c)
            t = depth_along(c) * s.sz
            if side != 0 and t_min < t < t_max:
                count = put_layer(rows, capacity, count, t, item, triangle, (side > 0) != (s.sz > 0.0))
    return count
