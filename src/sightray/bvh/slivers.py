"""Cutting slivers to pieces before a tree is built over them.

The box of a triangle that is long, thin and aslant is nearly empty, and with it every box of the tree above. A triangle cut
to k pieces of equal length stands in k boxes that have together a k-th of the surface; each piece names the whole
triangle, so hits are the same to the last bit, and a triangle may be met more than once along a ray.

Compact triangles only make the tree larger that way. A triangle is a **sliver** if the surface of its box is more than
`SLIVER` times what the triangle itself shows along the three axes: of a triangle with two edges along axes both are the
same. The total surface of all boxes is least, for a number of pieces, if a triangle's pieces are in proportion to the root
of its box's surface. None is cut finer than `FINE` times what triangles of the mesh show on average, nor to more than `MOST`
pieces, and in all there are at most `GROWTH` pieces a triangle.

References: M. Ernst, G. Greiner, "Early split clipping for bounding volume hierarchies" (RT 2007), who cut before building;
T. Karras, T. Aila, "Fast parallel construction of high-quality bounding volume hierarchies" (HPG 2013), section 4, for
sharing out a number of pieces.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sightray._jit import kernel, native
from sightray.bvh.binned_sah import MAX_ITEMS
from sightray.bvh.bvh8 import int_at
from sightray.bvh.collapse import half_area
from sightray.mathlib.lanes import load8
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import (
    Table,
    aligned,
    f32_at,
    f32_put,
    f64_at,
    i32_put,
)
from sightray.mathlib.vec import Vec3, cross, dot, vabs, vmax, vmin

SLIVER, FINE, MOST, GROWTH = 8.0, 2.0, 64, 2.0
FEWEST = 128  # triangles of a mesh for which no tree is walked
ROUNDS = 12  # of narrowing down how fine triangles may be cut


class Pieces(NamedTuple):
    """What a tree is built over where triangles are cut."""

    counts: np.ndarray  # (n,) int32: into how many pieces each triangle is cut
    edges: np.ndarray  # (n,) int32: along which edge
    boxes: np.ndarray  # (r, 8) float32, as the builder wants them; those of a triangle follow one another
    triangle: np.ndarray  # (r,) int32: whose pieces they are


def cut_slivers(vertices: np.ndarray, faces: np.ndarray, frame: np.ndarray, boxes: np.ndarray) -> Pieces | None:
    """Cut the slivers among triangles, whose boxes in the unit frame are given; None if there are none."""
    n = len(faces)
    if n <= FEWEST:
        return None
    shown, edges = aligned(n, np.float32), aligned(n, np.int32)
    inputs = Table(vertices), Table(faces), Table(frame), Table(boxes)
    if not native(measure_triangles)(*inputs, n, Table(shown), Table(edges)):
        return None
    counts = share_out(boxes, shown)
    return cut_pieces(vertices, faces, frame, counts, edges) if counts.max() > 1 else None


def share_out(boxes: np.ndarray, shown: np.ndarray) -> np.ndarray:
    """Into how many pieces each triangle is to be cut, (n,) int32."""
    n, run, counts = len(shown), native(count_pieces), aligned(len(shown), np.int32)
    arguments, most = (Table(boxes), Table(shown), n, Table(counts)), min(int(GROWTH * n), MAX_ITEMS)
    fine, coarse = max(FINE * float(shown.mean(dtype=np.float64)), 1e-9), 16.0  # than which no box is larger
    if run(*arguments, fine) > most:
        for _ in range(ROUNDS):
            middle = math.sqrt(fine * coarse)
            if run(*arguments, middle) > most:
                fine = middle
            else:
                coarse = middle
        run(*arguments, coarse)
    return counts


def cut_pieces(
    vertices: np.ndarray, faces: np.ndarray, frame: np.ndarray, counts: np.ndarray, edges: np.ndarray
) -> Pieces:
    """Cut triangles into given numbers of pieces along given edges."""
    boxes = aligned((int(counts.sum(dtype=np.int64)), 8), np.float32)
    inputs = Table(vertices), Table(faces), Table(frame), len(faces), Table(counts), Table(edges)
    native(cut_triangles)(*inputs, Table(boxes))
    return Pieces(counts, edges, boxes, np.repeat(np.arange(len(faces), dtype=np.int32), counts))


# ------------------------------------------------------------------------------------------------------------- kernels


@kernel
def unit_corner(vertices: Table, frame: Table, vertex: i64) -> Vec3:
    """A vertex in the unit frame."""
    p = Vec3(f64_at(vertices, 3 * vertex), f64_at(vertices, 3 * vertex + 1), f64_at(vertices, 3 * vertex + 2))
    return (p - Vec3(f64_at(frame, 0), f64_at(frame, 1), f64_at(frame, 2))) * f64_at(frame, 3)


@kernel
def measure_triangles(
    vertices: Table, faces: Table, frame: Table, boxes: Table, n: i64, shown: Table, edges: Table
) -> bool:
    """Twice what each triangle shows along the three axes, in all, and its longest edge; whether any is a sliver."""
    found = False
    for i in range(n):
        a = unit_corner(vertices, frame, int_at(faces, 3 * i))
        b = unit_corner(vertices, frame, int_at(faces, 3 * i + 1))
        c = unit_corner(vertices, frame, int_at(faces, 3 * i + 2))
        ab, bc, ca = b - a, c - b, a - c
        first, second, third = dot(ab, ab), dot(bc, bc), dot(ca, ca)
        surface = dot(vabs(cross(ab, ca)), Vec3(1.0, 1.0, 1.0))
        f32_put(shown, i, surface)
        i32_put(edges, i, 0 if first >= second and first >= third else 1 if second >= third else 2)
        found = found or half_area(load8(boxes, 8 * i)) > SLIVER * surface
    return found


@kernel
def count_pieces(boxes: Table, shown: Table, n: i64, counts: Table, finest: f64) -> i64:
    """Into how many pieces triangles are cut if those have boxes of about the surface `finest`; the number of all."""
    total = 0
    for i in range(n):
        surface, own = half_area(load8(boxes, 8 * i)), float(f32_at(shown, i))
        count = 1
        if surface > SLIVER * own:
            count = max(int(min(math.sqrt(surface / finest), float(MOST))), 1)
        i32_put(counts, i, count)
        total += count
    return total


@kernel
def cut_triangles(
    vertices: Table, faces: Table, frame: Table, n: i64, counts: Table, edges: Table, boxes: Table
) -> None:
    """Cut triangles and find the boxes of the pieces."""
    piece = 0
    for i in range(n):
        edge, count = int_at(edges, i), int_at(counts, i)
        a = unit_corner(vertices, frame, int_at(faces, 3 * i + edge))
        b = unit_corner(vertices, frame, int_at(faces, 3 * i + (edge + 1) % 3))
        c = unit_corner(vertices, frame, int_at(faces, 3 * i + (edge + 2) % 3))
        cut_triangle(a, b, c, count, boxes, piece)
        piece += count


@kernel
def cut_triangle(a: Vec3, b: Vec3, c: Vec3, count: i64, boxes: Table, piece: i64) -> None:
    """Cut a triangle into strips across its edge from a to b, and write their boxes from number `piece` on.

    A strip lies between two values of a linear function that is 0 in a and 1 in b; in c it is in between, whatever has
    become of the triangle since it was first cut. So strips always cover it.
    """
    at = dot(c - a, b - a) / max(dot(b - a, b - a), 1e-300)
    at = min(max(at, 0.0), 1.0)
    near, far = a, a  # where the strip begins on the edge and on the two other edges
    for k in range(count):
        begin, end = float(k) / float(count), float(k + 1) / float(count)
        low, high = vmin(near, far), vmax(near, far)
        if begin <= at <= end:
            low, high = vmin(low, c), vmax(high, c)
        near = a + (b - a) * end
        far = a + (c - a) * (end / at) if end < at else b + (c - b) * ((1.0 - end) / max(1.0 - at, 1e-300))
        if k == count - 1:
            near, far = b, b
        low, high = vmin(low, vmin(near, far)), vmax(high, vmax(near, far))
        put_box(boxes, piece + k, low, high)


@kernel
def put_box(boxes: Table, i: i64, low: Vec3, high: Vec3) -> None:
    """Write a box: the lower corner and 0, the negated upper corner and 0."""
    for k in range(8):
        f32_put(boxes, 8 * i + k, 0.0)
    f32_put(boxes, 8 * i, low.x)
    f32_put(boxes, 8 * i + 1, low.y)
    f32_put(boxes, 8 * i + 2, low.z)
    f32_put(boxes, 8 * i + 4, -high.x)
    f32_put(boxes, 8 * i + 5, -high.y)
    f32_put(boxes, 8 * i + 6, -high.z)
