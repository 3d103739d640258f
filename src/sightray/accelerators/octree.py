"""The octree."""

from __future__ import annotations

import numpy as np

from sightray._jit import implements, kernel
from sightray.accelerators.base import blocked, closest
from sightray.accelerators.item import ItemHit
from sightray.accelerators.primitives import (
    ORDER,
    OWN,
    Primitives,
    _OverPrimitives,
    nearest_listed,
    nearest_unbounded,
    no_item,
)
from sightray.accelerators.world_ray import meet_box, world_ray
from sightray.fields import integer, number
from sightray.mathlib.rays import is_ray
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import (
    Space,
    Table,
    f64_at,
    f64_put,
    i64_at,
    i64_put,
    is_null,
    link,
    scratch,
    table_at,
    vec3_at,
)
from sightray.mathlib.tally import NODES, tally
from sightray.mathlib.vec import Vec3

HALF, TO, COUNT, NODE_WORDS = 3, 4, 5, 6  # after the centre: half the side; first child or primitive; -1 if inner
TABLE = OWN
MAX_DEPTH = 24
CORNERS = np.array([[1 if octant >> axis & 1 else -1 for axis in range(3)] for octant in range(8)])
assert 2 * (7 * MAX_DEPTH + 8) <= 384


class Octree(_OverPrimitives):
    """Octree: a cube that holds too much is cut into eight, and so on; small cells where there is detail.

    Where `Grid` has one size of cell, this adapts: empty space stays one large cell, and a teapot in a stadium gets
    cells of its own size, a dozen levels down. Cells are cut in the middle, wherever the primitives are, so those that
    lie across a middle plane stand in cells on both sides; `KdTree` chooses its planes.

    A cube is cut if it holds more than ``leaf_size`` primitives, is less than ``max_depth`` down, and if its eight
    parts together hold at most ``growth`` times as many as it does: cutting pays only while it separates.

    Along a ray, octants come in the order of their numbers if the ray ascends on all axes. If it descends on some,
    their numbers are mirrored: octant k comes when k xor mask would.

    References
    ----------
    A. Glassner, "Space subdivision for fast ray tracing" (IEEE CG&A 1984); J. Revelles, C. Ureña, M. Lastra, "An
    efficient parametric algorithm for octree traversal" (WSCG 2000): going down from the top, as here.
    """

    leaf_size: int = integer("primitives up to which a cell is not cut", default=6, at_least=1)
    max_depth: int = integer("levels of cells", default=16, at_least=0, at_most=MAX_DEPTH)
    growth: float = number("entries in the parts of a cell, for each of its own, at most", default=3.0, at_least=1)

    def grow(self, space: Space, row: Table, primitives: Primitives) -> np.ndarray:
        if not len(primitives.number):
            return primitives.number
        lower, upper = primitives.lower.min(axis=0), primitives.upper.max(axis=0)
        center = 0.5 * (lower + upper)[None]
        half = 0.5 * float((upper - lower).max()) * (1.0 + 2.0**-40) + np.finfo(float).tiny
        which = np.arange(len(primitives.number))
        cell = np.zeros(len(which), np.int64)
        levels, order, listed, numbered = [], [], 0, 0
        for depth in range(self.max_depth + 1):
            count = np.bincount(cell, minlength=len(center))
            cut = (count > self.leaf_size) & (depth < self.max_depth)

            # Find out which octants the primitives of the cells to be cut reach into.
            entry = np.flatnonzero(cut[cell])
            middle = center[cell[entry]][:, None] + 0.5 * half * CORNERS
            reach = 0.5 * half
            low, high = primitives.lower[which[entry]][:, None], primitives.upper[which[entry]][:, None]
            inside = ((low <= middle + reach) & (high >= middle - reach)).all(axis=2)
            e, octant = np.nonzero(inside)
            inside[e, octant] = primitives.cross(which[entry][e], middle[e, octant], np.full((len(e), 3), reach))
            parts = np.bincount(cell[entry], inside.sum(axis=1), len(center))
            cut &= parts <= self.growth * count

            # List the primitives of the others, which are leaves.
            order.append(which[~cut[cell]])
            numbered += len(center)
            node = np.zeros((len(center), NODE_WORDS))
            node[:, :3], node[:, HALF] = center, half
            whole = node.view(np.int64)
            held = np.where(cut, 0, count)
            whole[:, TO] = np.where(cut, numbered + 8 * (np.cumsum(cut) - 1), listed + np.cumsum(held) - held)
            whole[:, COUNT] = np.where(cut, -1, count)
            levels.append(node)
            listed += int(held.sum())
            if not cut.any():
                break

            # Go down to the octants of those that are cut.
            e, octant = np.nonzero(inside & cut[cell[entry]][:, None])
            which, cell = which[entry][e], 8 * (np.cumsum(cut) - 1)[cell[entry][e]] + octant
            sort = np.argsort(cell, kind="stable")
            which, cell = which[sort], cell[sort]
            center = (center[cut][:, None] + 0.5 * half * CORNERS).reshape(-1, 3)
            half *= 0.5
        link(row, TABLE, space.array(np.concatenate(levels)))
        return primitives.number[np.concatenate(order)]


@kernel
def walk_octree(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64, any: bool) -> ItemHit:
    """Nearest hit, or with `any` whichever is found first."""
    nodes = table_at(tree, TABLE)
    if not is_ray(o, d):
        return no_item()
    ray = world_ray(o, d)
    best = nearest_unbounded(tree, ray, t_min, t_max)
    if is_null(nodes) or (any and best.item >= 0):
        return best
    mask = (1 if d.x < 0.0 else 0) + (2 if d.y < 0.0 else 0) + (4 if d.z < 0.0 else 0)
    stack = scratch(384)  # of (node, t where the ray enters it), the nearest on top
    i64_put(stack, 0, 0)
    f64_put(stack, 1, t_min)
    top = 1
    while top > 0:
        top -= 1
        if f64_at(stack, 2 * top + 1) > best.t:  # all that is left lies farther
            return best
        tally(NODES)
        at = NODE_WORDS * i64_at(stack, 2 * top)
        to, count = i64_at(nodes, at + TO), i64_at(nodes, at + COUNT)
        if count >= 0:
            best = nearest_listed(tree, table_at(tree, ORDER), to, count, ray, t_min, t_max, best)
            if any and best.item >= 0:
                return best
            continue
        half = 0.5 * f64_at(nodes, at + HALF)
        for k in range(7, -1, -1):
            child = to + (k ^ mask)
            center = vec3_at(nodes, NODE_WORDS * child)
            span = meet_box(center - half, center + half, ray, t_min, min(t_max, best.t))
            if span.near <= span.far and i64_at(nodes, NODE_WORDS * child + COUNT) != 0:
                i64_put(stack, 2 * top, child)
                f64_put(stack, 2 * top + 1, span.near)
                top += 1
    return best


@implements(closest, Octree)
def closest_in_octree(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> ItemHit:
    return walk_octree(tree, o, d, t_min, t_max, False)


@implements(blocked, Octree)
def blocked_in_octree(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> bool:
    return walk_octree(tree, o, d, t_min, t_max, True).item >= 0
