"""The order in which any-hit rays visit the children of a node: first those that are likely to stop them at little cost.

Any hit will do, so not the nearest child should come first but the one that most probably blocks the ray for the work that
it takes. For a ray that meets a child's box, the probability is estimated by areas: a convex body shows a quarter of its
surface on average over all directions (A. Cauchy, 1841), a triangle half of its area. Of a leaf that gives
p = 2 * area of triangles / surface of the box; of a node, whose rays meet a child with probability q, one minus the
product of all 1 - q p. The cost of a leaf is 1, that of a node 1 and what its children cost until one of them blocks.

Children are visited by p / cost, the largest first: the order of least expected cost if they are independent. To that end
the lanes of each node are sorted once: rays push children lane by lane and visit the last one first. Rays for the nearest
hit go by distance and do not mind.

Reference: J.-H. Nah, D. Manocha, "SATO: Surface area traversal order for shadow ray tracing" (Computer Graphics Forum,
2014), which goes by areas as well.
"""

from __future__ import annotations

import math

from sightray._jit import kernel
from sightray.bvh.bvh8 import CHILDREN, LEAF, NODE_FLOATS, int_at
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.sorting import sort_rows
from sightray.mathlib.table import Table, f32_at, f64_at, f64_put, i32_put, i64_at, i64_put, scratch


@kernel
def order_children(nodes: Table, n_nodes: i64, blocks: Table, block_floats: i64, worth: Table) -> None:
    """Sort the lanes of every node, the best last; `worth` is room for two numbers a node.

    Children have larger numbers than their node, so that all is known of them when it has its turn.
    """
    rows, lanes, kept = scratch(16), scratch(24), scratch(4)
    for i in range(n_nodes):
        node = n_nodes - 1 - i
        at = node * NODE_FLOATS
        for lane in range(8):
            code = int_at(nodes, at + CHILDREN + lane)
            h, p, cost = 0.0, 0.0, 1.0
            if code >= LEAF:
                h = half_surface(nodes, at, lane, lane)
                area = block_area(blocks, (code - LEAF) * block_floats)
                p = min(area / h, 1.0) if h > 0.0 else 0.0
            elif code > 0:
                h = half_surface(nodes, at, lane, lane)
                p, cost = f64_at(worth, 2 * code), f64_at(worth, 2 * code + 1)
            f64_put(lanes, 3 * lane, h)
            f64_put(lanes, 3 * lane + 1, p)
            f64_put(lanes, 3 * lane + 2, cost)
            f64_put(rows, 2 * lane, p / cost if code > 0 else -1.0)
            i64_put(rows, 2 * lane + 1, lane)
        sort_rows(rows, 0, 8, 2)

        # What the node is worth, if the best children come first.
        whole = half_surface(nodes, at, 0, 7)
        passing, expected = 1.0, 1.0
        for rank in range(8):
            lane = i64_at(rows, 2 * (7 - rank) + 1)
            met = min(f64_at(lanes, 3 * lane) / whole, 1.0) if whole > 0.0 else 0.0
            expected += passing * met * f64_at(lanes, 3 * lane + 2)
            passing *= 1.0 - met * f64_at(lanes, 3 * lane + 1)
        f64_put(worth, 2 * node, 1.0 - passing)
        f64_put(worth, 2 * node + 1, expected)

        # Move the lanes of the six planes and of the children.
        for k in range(0, 56, 8):
            for lane in range(8):
                i32_put(kept, lane, int_at(nodes, at + k + lane))
            for lane in range(8):
                i32_put(nodes, at + k + lane, int_at(kept, i64_at(rows, 2 * lane + 1)))


@kernel
def half_surface(nodes: Table, at: i64, first: i64, last: i64) -> f64:
    """Half the surface of the box around some lanes of a node; negative or NaN if all are empty."""
    x, y, z = extent(nodes, at, first, last), extent(nodes, at + 16, first, last), extent(nodes, at + 32, first, last)
    return x * y + y * z + z * x


@kernel
def extent(nodes: Table, at: i64, first: i64, last: i64) -> f64:
    """Extent of the box around some lanes along one axis."""
    low, high = math.inf, -math.inf
    for lane in range(first, last + 1):
        low, high = min(low, float(f32_at(nodes, at + lane))), max(high, float(f32_at(nodes, at + 8 + lane)))
    return high - low


@kernel
def block_area(blocks: Table, at: i64) -> f64:
    """Area of the triangles of a block: half the cross products of their edges."""
    area = 0.0
    for lane in range(4):
        bx, by, bz = edge(blocks, at + 12 + lane, 0), edge(blocks, at + 12 + lane, 1), edge(blocks, at + 12 + lane, 2)
        cx, cy, cz = edge(blocks, at + 24 + lane, 0), edge(blocks, at + 24 + lane, 1), edge(blocks, at + 24 + lane, 2)
        x, y, z = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        square = x * x + y * y + z * z
        area += 0.5 * math.sqrt(square) if square > 0.0 else 0.0  # NaN where a lane is empty
    return area


@kernel
def edge(blocks: Table, at: i64, axis: i64) -> f64:
    """One coordinate of an edge."""
    return float(f32_at(blocks, at + 4 * axis))
