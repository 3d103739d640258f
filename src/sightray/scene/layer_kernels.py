"""Layers: all crossings of rays with all items of a scene, in order along each ray.

Shapes that are no meshes are asked for one hit after the other. Crossings of surfaces where these have a hole are sieved
out afterwards, in scenes that have any.
"""

from __future__ import annotations

from sightray._jit import kernel
from sightray.accelerators.bvh import ITEMS, ORDER, UNBOUNDED, UNBOUNDED_COUNT
from sightray.accelerators.item import CUTOUT, FLAGS, SHAPE, ItemHit, item_at
from sightray.bvh.bvh8 import LEAF, NODES, STACK_WORDS, box_ray, int_at, push_children_unsorted, unit_ray
from sightray.mathlib.hit import is_hit
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.sorting import sort_rows, swap_rows
from sightray.mathlib.table import Table, advance, f64_at, i64_at, i64_put, scratch, table_at
from sightray.mathlib.vec import Vec3, dot, max3, vabs
from sightray.scene.crossings import LAYER_WORDS, MESH, cross_mesh, object_ray, put_layer
from sightray.scene.query_kernels import LOOK, end_at, exact_hit, triple_at
from sightray.scene.world import ITEMS as WORLD_ITEMS
from sightray.scene.world import through_hole
from sightray.shapes.base import intersect, surface

ENOUGH = 1 << 20  # crossings of one shape; stops a shape that would answer for ever
ROUNDING = 2.0**-48  # of t's terms: closer crossings may have been sorted by their rounding errors


@kernel
def cross_shape(
    shape: Table, item: i64, o: Vec3, d: Vec3, t_min: f64, t_max: f64, rows: Table, capacity: i64, count: i64
) -> i64:
    """Add the hits of any shape, one after the other; the new number of crossings."""
    t, last = t_min, count + ENOUGH
    while count < last:
        hit = intersect(shape, o, d, t, t_max)
        if not (is_hit(hit) and hit.t > t):
            break
        t = hit.t
        entering = dot(surface(shape, hit, o + d * t).normal, d) < 0.0
        count = put_layer(rows, capacity, count, t, item, hit.prim, entering)
    return count


@kernel
def cross_item(
    tree: Table, kinds: Table, index: i64, o: Vec3, d: Vec3, t_min: f64, t_max: f64,
    rows: Table, capacity: i64, count: i64,
) -> i64:  # fmt: skip
    """Add the crossings of one item; the new number of crossings."""
    item = item_at(table_at(tree, ITEMS), index)
    ray, shape = object_ray(item, o, d), table_at(item, SHAPE)
    if int_at(kinds, index) == MESH:
        return cross_mesh(shape, index, ray.o, ray.d, t_min, t_max, rows, capacity, count)
    return cross_shape(shape, index, ray.o, ray.d, t_min, t_max, rows, capacity, count)


@kernel
def cross_items(
    tree: Table, kinds: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64, rows: Table, capacity: i64, count: i64
) -> i64:
    """Add the crossings of all items of a scene, in no order; the new number of crossings."""
    for i in range(i64_at(tree, UNBOUNDED_COUNT)):
        index = int_at(table_at(tree, UNBOUNDED), i)
        count = cross_item(tree, kinds, index, o, d, t_min, t_max, rows, capacity, count)
    unit = unit_ray(tree, o, d, t_min, t_max)
    if not unit.reach >= 0.0:
        return count
    boxes = box_ray(unit)
    stack = scratch(STACK_WORDS)
    i64_put(stack, 0, 0)
    top = 1
    while top > 0:
        top -= 1
        child = i64_at(stack, top)
        if child < LEAF:
            top = push_children_unsorted(table_at(tree, NODES), child, boxes, unit.reach, stack, top)
            continue
        first = (child - LEAF) >> 3
        for i in range(first, first + (child & 7)):
            index = int_at(table_at(tree, ORDER), i)
            count = cross_item(tree, kinds, index, o, d, t_min, t_max, rows, capacity, count)
    return count


@kernel
def drop_repeated(rows: Table, first: i64, end: i64) -> i64:
    """Of sorted crossings keep one of those of the same primitive at the same place; the end of those kept.

    A triangle that is cut (`bvh.slivers`) stands in several leaves.
    """
    kept = first
    for i in range(first, end):
        row, j = advance(rows, i * LAYER_WORDS), kept - 1
        while j >= first and f64_at(rows, j * LAYER_WORDS) == f64_at(row, 0) and not is_same(rows, j, row):
            j -= 1
        if j >= first and f64_at(rows, j * LAYER_WORDS) == f64_at(row, 0):
            continue
        for word in range(LAYER_WORDS):
            i64_put(rows, kept * LAYER_WORDS + word, i64_at(row, word))
        kept += 1
    return kept


@kernel
def is_same(rows: Table, j: i64, row: Table) -> bool:
    """Whether crossing number j is of the item and the primitive of another."""
    at = j * LAYER_WORDS
    return i64_at(rows, at + 1) == i64_at(row, 1) and i64_at(rows, at + 2) == i64_at(row, 2)


@kernel
def tidy_order(rows: Table, first: i64, end: i64, o: Vec3, d: Vec3) -> None:
    """Where two crossings of an item are one in rounding, let it be entered before it is left.

    From the far end of the ray, where one is outside: what comes before leaving is entering. Only what was crossed
    changes places; the values of t are sorted.
    """
    offset = max3(vabs(o)) / max3(vabs(d))
    for i in range(end - 1, first, -1):
        near = f64_at(rows, (i - 1) * LAYER_WORDS)
        if f64_at(rows, i * LAYER_WORDS) - near > ROUNDING * (abs(near) + offset):
            continue
        item = i64_at(rows, i * LAYER_WORDS + 1)
        later = i + 1
        while later < end and i64_at(rows, later * LAYER_WORDS + 1) != item:
            later += 1
        wanted = 1 - i64_at(rows, later * LAYER_WORDS + 3) if later < end else 0
        same = i64_at(rows, (i - 1) * LAYER_WORDS + 1) == item
        if same and i64_at(rows, i * LAYER_WORDS + 3) != wanted == i64_at(rows, (i - 1) * LAYER_WORDS + 3):
            swap_rows(rows, i - 1, i, 1, LAYER_WORDS)


@kernel
def layers_of_rays(
    tree: Table, kinds: Table, origins: Table, o_form: i64, directions: Table, d_form: i64, ends: Table, e_form: i64,
    t_min: f64, n: i64, first: i64, rows: Table, capacity: i64, counts: Table, stop: Table,
) -> i64:  # fmt: skip
    """All crossings of rays number `first` to n - 1, ray by ray, sorted; the number of the first that has no room."""
    row = 0
    for i in range(first, n):
        if i & LOOK == LOOK and i64_at(stop, 0) != 0:
            return n
        o, d = triple_at(origins, o_form, i), triple_at(directions, d_form, i)
        t_max = end_at(ends, e_form, i, o, d)
        after = row
        if t_min < t_max:
            after = cross_items(tree, kinds, o, d, t_min, t_max, rows, capacity, row)
        if after > capacity:
            return i
        sort_rows(rows, row, after - row, LAYER_WORDS)
        after = drop_repeated(rows, row, after)
        tidy_order(rows, row, after, o, d)
        i64_put(counts, i, after - row)
        row = after
    return n


@kernel
def is_hole(world: Table, kinds: Table, row: Table, o: Vec3, d: Vec3) -> bool:
    """Whether a crossing is where the surface has a hole for this ray, as `find_closest` sees it."""
    index = i64_at(row, 1)
    if i64_at(item_at(table_at(world, WORLD_ITEMS), index), FLAGS) & CUTOUT == 0:
        return False
    hit = ItemHit(f64_at(row, 0), index, i64_at(row, 2), 0.0, 0.0)
    return through_hole(world, exact_hit(world, kinds, hit, o, d), o, d)


@kernel
def sieve_layers(
    world: Table, kinds: Table, origins: Table, o_form: i64, directions: Table, d_form: i64, first: i64, last: i64,
    rows: Table, counts: Table, stop: Table,
) -> None:  # fmt: skip
    """Leave out the crossings of rays number `first` to ``last - 1`` that are holes; the others move up."""
    row, kept = 0, 0
    for i in range(first, last):
        if i & LOOK == LOOK and i64_at(stop, 0) != 0:
            return
        o, d, before = triple_at(origins, o_form, i), triple_at(directions, d_form, i), kept
        for _ in range(i64_at(counts, i)):
            crossing = advance(rows, row * LAYER_WORDS)
            if not is_hole(world, kinds, crossing, o, d):
                for word in range(LAYER_WORDS):
                    i64_put(rows, kept * LAYER_WORDS + word, i64_at(crossing, word))
                kept += 1
            row += 1
        i64_put(counts, i, kept - before)


@kernel
def count_of_rays(
    tree: Table, kinds: Table, origins: Table, o_form: i64, directions: Table, d_form: i64, ends: Table, e_form: i64,
    t_min: f64, n: i64, counts: Table, stop: Table,
) -> None:  # fmt: skip
    """The number of crossings of each ray through a scene in whose meshes no triangle is cut."""
    for i in range(n):
        if i & LOOK == LOOK and i64_at(stop, 0) != 0:
            return
        o, d = triple_at(origins, o_form, i), triple_at(directions, d_form, i)
        t_max = end_at(ends, e_form, i, o, d)
        count = 0
        if t_min < t_max:
            count = cross_items(tree, kinds, o, d, t_min, t_max, counts, 0, 0)
        i64_put(counts, i, count)
