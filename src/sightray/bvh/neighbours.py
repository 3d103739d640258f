"""The nearest neighbours of points, through the 8-wide tree: as fast for crowded places as for lonely ones."""

from __future__ import annotations

import numpy as np

from sightray._jit import kernel
from sightray.bvh.binned_sah import Bvh8, build, pack_tree, runnable
from sightray.bvh.bvh8 import CHILD, LEAF, NODES, SCALE, STACK_WORDS, TREE_WORDS, int_at
from sightray.bvh.nearest import push_nearest, to_unit
from sightray.mathlib.lanes import sort_key
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Space, Table, f64_at, f64_put, i32_put, i64_at, i64_put, scratch, table_at
from sightray.mathlib.vec import Vec3, dot


def neighbours(points: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
    """The k nearest other points of each point.

    Parameters
    ----------
    points : (n, 3) float64
    k : less than n

    Returns
    -------
    indices : (n, k) int32, the nearest first
    distances : (n, k) float64
    """
    tree: Bvh8 = build(points, points, leaf_size=4)
    space = Space()
    row = space.row(TREE_WORDS)
    pack_tree(space, row, tree)
    n = len(points)
    indices, squares = np.full((n, k), -1, np.int32), np.full((n, k), np.inf)
    points = np.ascontiguousarray(points, np.float64)
    runnable(neighbours_of_all, n)(row, Table(tree.order), Table(points), n, k, Table(indices), Table(squares))
    return indices, np.sqrt(squares)


@kernel
def point_at(points: Table, i: i64) -> Vec3:
    """Row of an (n, 3) array."""
    return Vec3(f64_at(points, 3 * i), f64_at(points, 3 * i + 1), f64_at(points, 3 * i + 2))


@kernel
def keep_nearest(indices: Table, squares: Table, first: i64, k: i64, index: i64, square: f64) -> None:
    """Sort a point into the k nearest so far, unless it is farther than all."""
    if not square < f64_at(squares, first + k - 1):
        return
    i = first + k - 1
    while i > first and f64_at(squares, i - 1) > square:
        f64_put(squares, i, f64_at(squares, i - 1))
        i32_put(indices, i, int_at(indices, i - 1))
        i -= 1
    f64_put(squares, i, square)
    i32_put(indices, i, index)


@kernel
def neighbours_of_all(tree: Table, order: Table, points: Table, n: i64, k: i64, indices: Table, squares: Table) -> None:
    """Fill k indices and squared distances for each point."""
    per_world = f64_at(tree, SCALE) * f64_at(tree, SCALE) * (1.0 + 2.0**-40)
    stack = scratch(STACK_WORDS)
    for i in range(n):
        p = point_at(points, i)
        unit = to_unit(tree, p)
        i64_put(stack, 0, 0)
        top = 1
        while top > 0:
            top -= 1
            key = i64_at(stack, top)
            limit = f64_at(squares, k * i + k - 1) * per_world
            if key > sort_key(limit):
                continue
            child = key & CHILD
            if child < LEAF:
                top = push_nearest(table_at(tree, NODES), child, unit, limit, stack, top)
                continue
            first = (child - LEAF) >> 3
            for j in range(first, first + (child & 7)):
                index = int_at(order, j)
                away = point_at(points, index) - p
                if index != i:
                    keep_nearest(indices, squares, k * i, k, index, dot(away, away))
