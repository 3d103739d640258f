"""Rays in batches: kernels that read them where the user keeps them.

A *column* of a batch (origins, directions, ends) is a table and a **form**. Its lowest bit is set if the numbers are single
precision; the other 31 bits of its low half are the step from ray to ray in numbers (0 if all rays share one), its high half
is the step from one number of a ray to the next.

What is no ray misses: an origin or direction that is not finite, a direction of length zero, t_max <= t_min.
"""

from __future__ import annotations

import math

from sightray._jit import kernel
from sightray.accelerators.item import OBJECT, SHAPE, ItemHit, intersect_item, item_at, item_surface, to_object
from sightray.bvh.bvh8 import int_at
from sightray.bvh.triangles import edge_functions, shear
from sightray.mathlib.hit import is_hit
from sightray.mathlib.rays import is_ray
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f32_at, f64_at, f64_put, i32_put, i64_at, table_at
from sightray.mathlib.vec import Vec3, normalize
from sightray.scene.crossings import MESH, mesh_corner, object_ray, place, sheared_corners
from sightray.scene.world import ITEMS, find_closest, is_blocked

LOOK = 255  # rays between two looks at the stop word, less one


@kernel
def number_at(column: Table, form: i64, index: i64) -> f64:
    """One number of a column."""
    return float(f32_at(column, index)) if form & 1 else f64_at(column, index)


@kernel
def step_of(form: i64) -> i64:
    """Numbers from ray to ray."""
    return (form >> 1) & 0x7FFFFFFF


@kernel
def triple_at(column: Table, form: i64, ray: i64) -> Vec3:
    """Three numbers of a column."""
    at, apart = step_of(form) * ray, form >> 32
    return Vec3(
        number_at(column, form, at), number_at(column, form, at + apart), number_at(column, form, at + 2 * apart)
    )  # fmt: skip


@kernel
def end_at(column: Table, form: i64, ray: i64, o: Vec3, d: Vec3) -> f64:
    """Where a ray ends; NaN, before which nothing is met, if it is none."""
    return number_at(column, form, step_of(form) * ray) if is_ray(o, d) else math.nan


@kernel
def put_triple(table: Table, row: i64, a: Vec3) -> None:
    """Write row number `row` of an (n, 3) array of doubles."""
    f64_put(table, 3 * row, a.x)
    f64_put(table, 3 * row + 1, a.y)
    f64_put(table, 3 * row + 2, a.z)


@kernel
def closest_of_rays(
    world: Table, origins: Table, o_form: i64, directions: Table, d_form: i64, ends: Table, e_form: i64, t_min: f64,
    n: i64, t: Table, items: Table, objects: Table, primitives: Table, stop: Table,
) -> None:  # fmt: skip
    """The nearest hit of each ray: float64 t, and int32 item, object and primitive, -1 where there is none."""
    for i in range(n):
        if i & LOOK == LOOK and i64_at(stop, 0) != 0:
            return
        o, d = triple_at(origins, o_form, i), triple_at(directions, d_form, i)
        t_max = end_at(ends, e_form, i, o, d)
        hit = ItemHit(math.inf, -1, -1, 0.0, 0.0)
        if t_min < t_max:
            hit = find_closest(world, o, d, t_min, t_max)
        f64_put(t, i, hit.t)
        i32_put(items, i, hit.item)
        i32_put(primitives, i, hit.prim)
        i32_put(objects, i, i64_at(item_at(table_at(world, ITEMS), hit.item), OBJECT) if hit.item >= 0 else -1)


@kernel
def any_of_rays(
    world: Table, origins: Table, o_form: i64, directions: Table, d_form: i64, ends: Table, e_form: i64, t_min: f64,
    n: i64, blocked: Table, stop: Table,
) -> None:  # fmt: skip
    """Whether each ray meets anything: one byte a ray; `blocked` is eight bytes longer than n."""
    word = 0
    for i in range(n):
        if i & LOOK == LOOK and i64_at(stop, 0) != 0:
            return
        o, d = triple_at(origins, o_form, i), triple_at(directions, d_form, i)
        t_max = end_at(ends, e_form, i, o, d)
        if t_min < t_max and is_blocked(world, o, d, t_min, t_max):
            word |= 1 << (8 * (i & 3))
        if i & 3 == 3 or i == n - 1:  # four answers at a time: tables have no bytes
            i32_put(blocked, i >> 2, word)
            word = 0


@kernel
def exact_hit(world: Table, kinds: Table, hit: ItemHit, o: Vec3, d: Vec3) -> ItemHit:
    """The hit at a known t of a known primitive once more, with its two parameters."""
    item = item_at(table_at(world, ITEMS), hit.item)
    if int_at(kinds, hit.item) != MESH:
        # The primitive is the only one between the two neighbours of t.
        ulp = 2.0**-52 * abs(hit.t)
        again = intersect_item(item, o, d, hit.t - ulp, hit.t + ulp)
        return ItemHit(again.t, hit.item, again.prim, again.u, again.v) if is_hit(again) else hit
    ray = object_ray(item, o, d)
    c = sheared_corners(table_at(item, SHAPE), hit.prim, ray.o, shear(ray.d))
    e = edge_functions(c.x, c.y)
    total = e.x + e.y + e.z
    return ItemHit(hit.t, hit.item, hit.prim, e.y / total, e.z / total) if total != 0.0 else hit


@kernel
def describe_hits(
    world: Table, kinds: Table, origins: Table, o_form: i64, directions: Table, d_form: i64, n: i64, t: Table,
    items: Table, primitives: Table, uv: Table, normal: Table, shading: Table, position: Table, stop: Table,
) -> None:  # fmt: skip
    """All that is to be known of hits, in doubles; NaN for rays that met nothing."""
    nothing = Vec3(math.nan, math.nan, math.nan)
    for i in range(n):
        if i & LOOK == LOOK and i64_at(stop, 0) != 0:
            return
        index = int_at(items, i)
        n_geometric, n_shading, p, u, v = nothing, nothing, nothing, math.nan, math.nan
        if index >= 0:
            o, d = triple_at(origins, o_form, i), triple_at(directions, d_form, i)
            item = item_at(table_at(world, ITEMS), index)
            hit = ItemHit(f64_at(t, i), index, int_at(primitives, i), 0.0, 0.0)
            hit = exact_hit(world, kinds, hit, o, d)
            p = hit_point(world, kinds, hit, o, d)
            s = item_surface(item, hit, to_object(item, p))
            n_geometric, n_shading, u, v = normalize(s.normal), normalize(s.shading), s.u, s.v
        put_triple(normal, i, n_geometric)
        put_triple(shading, i, n_shading)
        put_triple(position, i, p)
        f64_put(uv, 2 * i, u)
        f64_put(uv, 2 * i + 1, v)


@kernel
def hit_point(world: Table, kinds: Table, hit: ItemHit, o: Vec3, d: Vec3) -> Vec3:
    """The point of a hit; on meshes the weighted mean of the corners, which stays on the triangle however far the eye."""
    if int_at(kinds, hit.item) != MESH:
        return o + d * hit.t
    item = item_at(table_at(world, ITEMS), hit.item)
    mesh = table_at(item, SHAPE)
    a, b, c = mesh_corner(mesh, hit.prim, 0), mesh_corner(mesh, hit.prim, 1), mesh_corner(mesh, hit.prim, 2)
    p = a + (b - a) * hit.u + (c - a) * hit.v
    return place(item, p)
