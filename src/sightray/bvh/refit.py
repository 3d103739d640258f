"""Refitting: the tree of a mesh whose vertices have moved, without building it again.

Which triangles share a leaf, and which children a node, stays as it is; boxes and packed triangles are computed anew, the
leaves first, then nodes from the last to the first: children have larger numbers than their node. Hits are what those of a
tree built anew would be, because a tree only says where to look. What grows is the work: triangles that lay together
and have parted make large boxes. Slivers that are cut (`slivers`) are cut anew, into as many pieces as before.

That is measured by the surface area heuristic: a ray that meets a convex box meets one within it with the ratio of their
surfaces as probability, so a ray through the tree's box visits about `tree_cost` nodes and leaves. The ratio of the cost
when the tree was built to that of now is the **quality** of a refitted tree.

References: G. van den Bergen, "Efficient collision detection of complex deformable models using AABB trees" (JGT 1997);
C. Lauterbach, S. Yoon, D. Manocha, D. Tuft, "RT-DEFORM: interactive ray tracing of dynamic scenes using BVHs" (RT 2006),
who rebuild by how such a ratio grows.
"""

from __future__ import annotations

import math

import numpy as np

from sightray._jit import kernel
from sightray.bvh.binned_sah import Bvh8, runnable, unit_frame
from sightray.bvh.bvh8 import CHILDREN, LEAF, NODE_FLOATS, int_at
from sightray.bvh.shadow_order import half_surface
from sightray.bvh.slivers import cut_pieces
from sightray.bvh.triangles import BLOCK_FLOATS, EDGES, MeshTree, unit_vertex
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, aligned, f32_at, f32_put, is_null, no_table


def refit_mesh(mesh: MeshTree, vertices: np.ndarray) -> MeshTree:
    """The tree of a mesh over vertices that have moved, (n, 3) float64, which are not copied; the old one stays."""
    vertices = np.ascontiguousarray(vertices, np.float64)
    center, half, scale = unit_frame(vertices.min(axis=0), vertices.max(axis=0))
    nodes, blocks = aligned(mesh.tree.nodes.shape, np.float32), aligned(mesh.blocks.shape, np.float32)
    nodes[:], blocks[:] = mesh.tree.nodes, mesh.blocks
    frame, inputs = np.array([*center, scale]), (Table(vertices), Table(mesh.faces))
    boxes, pieces = no_table(), no_table()
    if mesh.cuts is not None:
        boxes = Table(cut_pieces(vertices, mesh.faces, frame, mesh.cuts.counts, mesh.cuts.edges).boxes)
        pieces = Table(mesh.cuts.pieces)
    tables = (Table(frame), Table(mesh.numbers), boxes, pieces, Table(nodes))
    runnable(refit, len(mesh.faces))(*inputs, *tables, len(nodes), Table(blocks))
    tree = Bvh8(nodes, mesh.tree.order, center, half, scale)
    return MeshTree(tree, blocks, mesh.numbers, vertices, mesh.faces, mesh.cuts)


def expected_cost(mesh: MeshTree) -> float:
    """Nodes and leaves that a ray through the tree's box visits, by the surface area heuristic."""
    return runnable(tree_cost, len(mesh.faces))(Table(mesh.tree.nodes), len(mesh.tree.nodes))


@kernel
def refit(
    vertices: Table, faces: Table, frame: Table, numbers: Table, boxes: Table, pieces: Table,
    nodes: Table, n_nodes: i64, blocks: Table,
) -> None:  # fmt: skip
    """Compute all boxes and packed triangles anew; of triangles that are cut, the boxes of pieces are given."""
    for done in range(n_nodes):
        at = (n_nodes - 1 - done) * NODE_FLOATS
        for lane in range(8):
            code = int_at(nodes, at + CHILDREN + lane)
            if code >= LEAF:
                refit_block(vertices, faces, frame, numbers, code - LEAF, blocks, nodes, at + lane)
                if not is_null(boxes):
                    enclose_pieces(boxes, pieces, code - LEAF, nodes, at + lane)
            elif code > 0:
                enclose_node(nodes, code * NODE_FLOATS, at + lane)


@kernel
def refit_block(
    vertices: Table, faces: Table, frame: Table, numbers: Table, block: i64, blocks: Table, nodes: Table, at: i64
) -> None:
    """Pack the triangles of a leaf anew, as `pack_triangle` does, and write their box to the lane at `at` of the nodes."""
    for axis in range(3):
        low, high = math.inf, -math.inf
        for lane in range(4):
            triangle = int_at(numbers, 4 * block + lane)
            if triangle >= 0:
                a = unit_vertex(vertices, frame, int_at(faces, 3 * triangle), axis)
                b = unit_vertex(vertices, frame, int_at(faces, 3 * triangle + 1), axis)
                c = unit_vertex(vertices, frame, int_at(faces, 3 * triangle + 2), axis)
                low, high = min(low, a, b, c), max(high, a, b, c)
                word = block * BLOCK_FLOATS + 4 * axis + lane
                f32_put(blocks, word, a)
                f32_put(blocks, word + EDGES, b - a)
                f32_put(blocks, word + 2 * EDGES, c - a)
        f32_put(nodes, at + 16 * axis, low)
        f32_put(nodes, at + 16 * axis + 8, high)


@kernel
def enclose_pieces(boxes: Table, pieces: Table, block: i64, nodes: Table, at: i64) -> None:
    """Write the box around the pieces in a leaf to the lane at `at` of the nodes."""
    for axis in range(3):
        low, high = math.inf, -math.inf
        for lane in range(4):
            piece = int_at(pieces, 4 * block + lane)
            if piece >= 0:
                low = min(low, float(f32_at(boxes, 8 * piece + axis)))
                high = max(high, -float(f32_at(boxes, 8 * piece + axis + 4)))
        f32_put(nodes, at + 16 * axis, low)
        f32_put(nodes, at + 16 * axis + 8, high)


@kernel
def enclose_node(nodes: Table, child: i64, at: i64) -> None:
    """Write the box around all children of the node at `child` to the lane at `at`; empty lanes are from inf to -inf."""
    for axis in range(3):
        low, high = math.inf, -math.inf
        for lane in range(child + 16 * axis, child + 16 * axis + 8):
            low, high = min(low, float(f32_at(nodes, lane))), max(high, float(f32_at(nodes, lane + 8)))
        f32_put(nodes, at + 16 * axis, low)
        f32_put(nodes, at + 16 * axis + 8, high)


@kernel
def tree_cost(nodes: Table, n_nodes: i64) -> f64:
    """The surfaces of all children over that of the root; infinite if that has none."""
    total, whole = 0.0, half_surface(nodes, 0, 0, 7)
    for node in range(n_nodes):
        for lane in range(8):
            if int_at(nodes, node * NODE_FLOATS + CHILDREN + lane) > 0:
                total += half_surface(nodes, node * NODE_FLOATS, lane, lane)
    return total / whole if whole > 0.0 else math.inf
