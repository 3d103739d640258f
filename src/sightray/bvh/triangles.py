"""Triangles of a mesh: four at a time in single precision to find candidates, one at a time in double to decide.

A **block** holds the four triangles of a leaf, 192 bytes or three cache lines, each number four times in a row: as floats
x y z of the first vertices (0-11), of the edges to the second (12-23) and to the third vertices (24-35), all NaN in empty
lanes; then, as 32-bit integers, which vertices of the mesh these are (36-47).

**The filter** is Möller and Trumbore's test in the tree's unit frame, multiplied by the determinant instead of divided,
with slack. Let u = 2^-24 and L the larger 1-norm of a triangle's two edges. Coordinates are at most 1 and differences at
most 2, inputs are rounded by u (directions by 2 u), operations by u of their result. To first order this moves the two
barycentric numerators by 42 u L and 38 u L, the determinant by 10 u L^2 and the numerator of the length by 17 u L^2. With
L <= 6, comparing the sum of the weights with the determinant needs 148 u L of slack, comparing lengths 43 u L^2, and both
cover determinants so small that their sign is in doubt. A ray's `slack` (see `bvh8`) is at least 16 u: `SIDES` and `ALONGS`
times that are used. What lies inside by as much is surely hit, which is all that shadow rays ask.

**The decision** is the watertight test of Woop, Benthin and Wald on the mesh's own double-precision vertices. The ray's
largest component becomes z; all vertices are sheared so that the ray runs along z through the origin; the signs of three
2D edge functions decide. Two triangles compute the function of a shared edge from the same numbers and find exactly
opposite values, because rounding is monotone and symmetric (and no multiply-add is fused), so no ray passes between them.

References: T. Möller, B. Trumbore, "Fast, minimum storage ray/triangle intersection" (JGT 1997); S. Woop, C. Benthin,
I. Wald, "Watertight ray/triangle intersection" (JCGT 2013).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from sightray._compilers import compile_missing
from sightray._jit import enabled, kernel
from sightray.bvh.binned_sah import FEW, MOVED_FROM, Bvh8, build_tree, divide, pack_tree, runnable, unit_frame
from sightray.bvh.bvh8 import (
    BOTTOM,
    CHILD,
    CHILDREN,
    LEAF,
    NODE_FLOATS,
    NODES,
    STACK_WORDS,
    TREE_WORDS,
    UnitRay,
    box_ray,
    int_at,
    push_children,
    unit_ray,
    visit_last,
)
from sightray.bvh.collapse import collapse, plan_ranges
from sightray.bvh.reinsertion import reinsert
from sightray.bvh.shadow_order import order_children
from sightray.bvh.slivers import FEWEST, count_pieces, cut_slivers, measure_triangles, put_box, unit_corner
from sightray.mathlib.cores import core_count
from sightray.mathlib.hit import Hit, is_hit, miss
from sightray.mathlib.lanes import (
    F32x4,
    flip4,
    load4,
    lowest_bit,
    movemask4,
    sort_key,
    splat4,
    vmax4,
    vmin4,
)
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import (
    Space,
    Table,
    aligned,
    f32_put,
    f64_at,
    i32_put,
    i64_at,
    i64_put,
    link,
    scratch,
    table_at,
)
from sightray.mathlib.tally import TESTS, tally
from sightray.mathlib.vec import Vec3, rounded_cross, rounded_product, vmax, vmin

BLOCK_FLOATS, EDGES, INDICES = 48, 12, 36
SIDES, ALONGS = 10.0, 3.0  # slacks that the filter allows

# A mesh row, after the head of its tree.
BLOCKS = TREE_WORDS  # pointer to the blocks
NUMBERS = TREE_WORDS + 1  # pointer to the numbers of the triangles in the blocks: int32
VERTICES = TREE_WORDS + 2  # pointer to float64 x, y, z
FACES = TREE_WORDS + 3  # pointer to three int32 a triangle
SIZE = TREE_WORDS + 4  # `TINY`, `SMALL` or `LARGE`
MESH_WORDS = TREE_WORDS + 5
TINY, SMALL, LARGE = 0, 1, 2  # trees that near caches hold; that farther ones hold; that rays wait for memory in
TINY_BLOCKS, SMALL_BLOCKS = 1 << 13, 1 << 16  # that these have at most


class Cuts(NamedTuple):
    """What refitting needs of a mesh whose slivers are cut (see `slivers`)."""

    counts: np.ndarray  # (m,) int32: into how many pieces each triangle is cut
    edges: np.ndarray  # (m,) int32: along which edge
    pieces: np.ndarray  # (leaves, 4) int32: the piece in each lane of a block, -1 for none


class MeshTree(NamedTuple):
    """All that rays need of a mesh."""

    tree: Bvh8
    blocks: np.ndarray  # (leaves, 48) float32 on a cache line
    numbers: np.ndarray  # (leaves, 4) int32: the triangle in each lane of a block, -1 for none
    vertices: np.ndarray  # (n, 3) float64
    faces: np.ndarray  # (m, 3) int32
    cuts: Cuts | None = None  # if triangles are cut; then some stand in several blocks


def build_mesh(vertices: np.ndarray, faces: np.ndarray) -> MeshTree:
    """The tree and the packed triangles of a mesh: vertices (n, 3) float64, faces (m, 3) int32; neither is copied."""
    vertices = np.ascontiguousarray(vertices, np.float64)
    faces = np.ascontiguousarray(faces, np.int32)
    n = len(faces)
    if enabled():
        compile_missing(builders(n), core_count())
    corners = (vertices.min(axis=0), vertices.max(axis=0)) if len(vertices) else (np.zeros(3), np.zeros(3))
    center, half, scale = unit_frame(*corners)
    frame = np.array([*center, scale])
    boxes = aligned((n, 8), np.float32)
    inputs = (Table(vertices), Table(faces), Table(frame))
    runnable(bound_triangles, n)(*inputs, n, Table(boxes))
    cut = cut_slivers(vertices, faces, frame, boxes)
    nodes, order = build_tree(boxes if cut is None else cut.boxes, 4)
    leaves = int(np.count_nonzero(nodes.view(np.int32)[:, CHILDREN : CHILDREN + 8] >= LEAF))
    blocks, pieces = aligned((leaves, BLOCK_FLOATS), np.float32), aligned((leaves, 4), np.int32)
    runnable(name_blocks, n)(Table(nodes), len(nodes), Table(order), Table(pieces))
    numbers = pieces if cut is None else np.where(pieces < 0, np.int32(-1), cut.triangle[pieces])
    runnable(pack_blocks, n)(*inputs, Table(numbers), leaves, Table(blocks))
    worth = aligned((len(nodes), 2), np.float64)
    runnable(order_children, n)(Table(nodes), len(nodes), Table(blocks), BLOCK_FLOATS, Table(worth))
    cuts = None if cut is None else Cuts(cut.counts, cut.edges, pieces)
    tree = Bvh8(nodes, np.empty(0, np.int32), center, half, scale)  # leaves name blocks: no order is needed any more
    return MeshTree(tree, blocks, numbers, vertices, faces, cuts)


def builders(n: int) -> list[Callable]:
    """The kernels that make a tree over n triangles."""
    if n <= FEW:
        return []
    kernels: list[Callable] = [bound_triangles, divide, plan_ranges, collapse, name_blocks, pack_blocks, order_children]
    if n > FEWEST:
        kernels += [measure_triangles, count_pieces]
    return [*kernels, reinsert] if n >= MOVED_FROM else kernels


def pack_mesh(space: Space, row: Table, mesh: MeshTree) -> None:
    """Fill the first `MESH_WORDS` words of a row, but for its methods."""
    pack_tree(space, row, mesh.tree)
    link(row, BLOCKS, space.array(mesh.blocks))
    link(row, NUMBERS, space.array(mesh.numbers))
    link(row, VERTICES, space.array(mesh.vertices))
    link(row, FACES, space.array(mesh.faces))
    blocks = len(mesh.blocks)
    row.view(np.int64)[SIZE] = TINY if blocks <= TINY_BLOCKS else SMALL if blocks <= SMALL_BLOCKS else LARGE


# ------------------------------------------------------------------------------------------------------------ building


@kernel
def unit_vertex(vertices: Table, frame: Table, vertex: i64, axis: i64) -> f64:
    """One coordinate of a vertex in the unit frame."""
    return (f64_at(vertices, 3 * vertex + axis) - f64_at(frame, axis)) * f64_at(frame, 3)


@kernel
def bound_triangles(vertices: Table, faces: Table, frame: Table, n: i64, boxes: Table) -> None:
    """Boxes of triangles as the builder wants them."""
    for i in range(n):
        a = unit_corner(vertices, frame, int_at(faces, 3 * i))
        b = unit_corner(vertices, frame, int_at(faces, 3 * i + 1))
        c = unit_corner(vertices, frame, int_at(faces, 3 * i + 2))
        put_box(boxes, i, vmin(vmin(a, b), c), vmax(vmax(a, b), c))


@kernel
def name_blocks(nodes: Table, n_nodes: i64, order: Table, pieces: Table) -> None:
    """Let leaves name blocks instead of ranges, and note which of the items stands in each lane of a block."""
    block = 0
    for child in range(8 * n_nodes):
        at = child // 8 * NODE_FLOATS + CHILDREN + child % 8
        code = int_at(nodes, at)
        if code >= LEAF:
            first, count = (code - LEAF) >> 3, code & 7
            for lane in range(4):
                i32_put(pieces, 4 * block + lane, int_at(order, first + lane) if lane < count else -1)
            i32_put(nodes, at, LEAF + block)
            block += 1


@kernel
def pack_blocks(vertices: Table, faces: Table, frame: Table, numbers: Table, n_blocks: i64, blocks: Table) -> None:
    """Pack the triangles of all leaves."""
    for block in range(n_blocks):
        for lane in range(4):
            number = int_at(numbers, 4 * block + lane)
            pack_triangle(vertices, faces, frame, number, blocks, block * BLOCK_FLOATS + lane)


@kernel
def pack_triangle(vertices: Table, faces: Table, frame: Table, number: i64, blocks: Table, at: i64) -> None:
    """Write one lane of a block; an empty one for the triangle -1."""
    for axis in range(3):
        a, b, c = math.nan, math.nan, math.nan
        if number >= 0:
            a = unit_vertex(vertices, frame, int_at(faces, 3 * number), axis)
            b = unit_vertex(vertices, frame, int_at(faces, 3 * number + 1), axis)
            c = unit_vertex(vertices, frame, int_at(faces, 3 * number + 2), axis)
            i32_put(blocks, at + INDICES + 4 * axis, int_at(faces, 3 * number + axis))
        f32_put(blocks, at + 4 * axis, a)
        f32_put(blocks, at + EDGES + 4 * axis, b - a)
        f32_put(blocks, at + 2 * EDGES + 4 * axis, c - a)


# ------------------------------------------------------------------------------------------------------------- tracing


class TriangleRay(NamedTuple):
    """What meets the blocks: the ray in the unit frame, four copies each."""

    ox: F32x4
    oy: F32x4
    oz: F32x4
    dx: F32x4
    dy: F32x4
    dz: F32x4
    side: F32x4  # slack of the barycentric numerators for each unit of an edge's length
    along: F32x4  # slack of the length's numerator for each unit of its square


@kernel
def triangle_ray(ray: UnitRay) -> TriangleRay:
    """Prepare a ray for the blocks."""
    return TriangleRay(
        splat4(ray.o.x), splat4(ray.o.y), splat4(ray.o.z), splat4(ray.d.x), splat4(ray.d.y), splat4(ray.d.z),
        splat4(SIDES * ray.slack), splat4(ALONGS * ray.slack),
    )  # fmt: skip


class Filtered(NamedTuple):
    """Triangles of a block, one bit each."""

    maybe: i64  # those that the ray may meet: all that it meets are among them
    surely: i64  # those that it meets, whatever the rounding


@kernel
def filter_block(blocks: Table, at: i64, ray: TriangleRay, reach: f64) -> Filtered:
    """Test the triangles of a block in single precision (Möller and Trumbore, 1997)."""
    tally(TESTS)  # one for all four
    ax, ay, az = load4(blocks, at), load4(blocks, at + 4), load4(blocks, at + 8)
    bx, by, bz = load4(blocks, at + EDGES), load4(blocks, at + EDGES + 4), load4(blocks, at + EDGES + 8)
    cx, cy, cz = load4(blocks, at + 2 * EDGES), load4(blocks, at + 2 * EDGES + 4), load4(blocks, at + 2 * EDGES + 8)
    px, py, pz = ray.dy * cz - ray.dz * cy, ray.dz * cx - ray.dx * cz, ray.dx * cy - ray.dy * cx  # d x c
    sx, sy, sz = ray.ox - ax, ray.oy - ay, ray.oz - az
    qx, qy, qz = sy * bz - sz * by, sz * bx - sx * bz, sx * by - sy * bx  # s x b
    signed = bx * px + by * py + bz * pz
    det = flip4(signed, signed)
    u = flip4(sx * px + sy * py + sz * pz, signed)
    v = flip4(ray.dx * qx + ray.dy * qy + ray.dz * qz, signed)
    t = flip4(cx * qx + cy * qy + cz * qz, signed)
    size = vmax4(flip4(bx, bx) + flip4(by, by) + flip4(bz, bz), flip4(cx, cx) + flip4(cy, cy) + flip4(cz, cz))
    side, along = size * ray.side, size * size * ray.along
    # What is NaN (empty lanes, senseless rays) stays so: vmin4 gives the second where it cannot compare.
    inside, ahead = vmin4(vmin4(u, v), det - (u + v)), vmin4(t, det * splat4(reach) - t)
    zero = splat4(0.0)
    maybe = (inside + side >= zero) & (ahead + along >= zero)
    return Filtered(movemask4(maybe), movemask4((inside > side) & (ahead > along)))


class Shear(NamedTuple):
    """Axes renamed such that z is the largest of a ray's direction, and the shear that lets the ray run along z."""

    kx: i64  # which axes of space are x, y and z
    ky: i64
    kz: i64
    sx: f64  # what to subtract of x and y for each z, and t for each z
    sy: f64
    sz: f64


@kernel
def shear(d: Vec3) -> Shear:
    """The largest component of the direction becomes z; the other axes follow in cyclic order."""
    x, y, z = abs(d.x), abs(d.y), abs(d.z)
    if z >= x and z >= y:
        sz = 1.0 / d.z
        return Shear(0, 1, 2, d.x * sz, d.y * sz, sz)
    if y >= x:
        sz = 1.0 / d.y
        return Shear(2, 0, 1, d.z * sz, d.x * sz, sz)
    sz = 1.0 / d.x
    return Shear(1, 2, 0, d.y * sz, d.z * sz, sz)


@kernel
def axis_of(a: Vec3, axis: i64) -> f64:
    """A component by its number."""
    return a.x if axis == 0 else a.y if axis == 1 else a.z


@kernel
def corners(vertices: Table, blocks: Table, at: i64, axis: i64) -> Vec3:
    """One coordinate of the three vertices of a triangle."""
    a, b, c = int_at(blocks, at), int_at(blocks, at + 4), int_at(blocks, at + 8)
    return Vec3(f64_at(vertices, 3 * a + axis), f64_at(vertices, 3 * b + axis), f64_at(vertices, 3 * c + axis))


@kernel(exact=True)
def edge_functions(x: Vec3, y: Vec3) -> Vec3:
    """On which side of each edge the origin lies; for a shared edge exactly opposite to what its other triangle finds."""
    return rounded_cross(y, x)


@kernel(exact=True)
def times(a: Vec3, factor: f64) -> Vec3:
    """a * factor, rounded before anything is added: single rays and packets shall find the same to the last bit."""
    return rounded_product(a, factor)


@kernel(exact=True)
def depth_of(e: Vec3, z: Vec3, sz: f64, det: f64) -> f64:
    """t of a hit from the edge functions and their sum."""
    return (e.x * z.x + e.y * z.y + e.z * z.z) * sz / det


@kernel
def meet_triangle(mesh: Table, block: i64, lane: i64, o: Vec3, s: Shear, t_min: f64, t_max: f64) -> Hit:
    """The hit of the triangle in one lane of a block, decided in double precision (Woop, Benthin and Wald, 2013)."""
    vertices, blocks, at = table_at(mesh, VERTICES), table_at(mesh, BLOCKS), block * BLOCK_FLOATS + INDICES + lane
    z = corners(vertices, blocks, at, s.kz) - axis_of(o, s.kz)
    x = corners(vertices, blocks, at, s.kx) - axis_of(o, s.kx)
    y = corners(vertices, blocks, at, s.ky) - axis_of(o, s.ky)
    return decide(int_at(table_at(mesh, NUMBERS), 4 * block + lane), x, y, z, s, t_min, t_max)


@kernel
def decide(number: i64, x: Vec3, y: Vec3, z: Vec3, s: Shear, t_min: f64, t_max: f64) -> Hit:
    """Whether a ray meets the triangle of this number, from its corners' coordinates as seen from the ray's origin."""
    x, y = x - times(z, s.sx), y - times(z, s.sy)
    e = edge_functions(x, y)
    det = e.x + e.y + e.z
    if (min(e.x, e.y, e.z) < 0.0 and max(e.x, e.y, e.z) > 0.0) or det == 0.0:
        return miss()
    t = depth_of(e, z, s.sz, det)
    if t_min < t < t_max:
        return Hit(t, number, e.y / det, e.z / det)
    return miss()


@kernel
def closest_triangle(mesh: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> Hit:
    """Nearest hit of the ray o + t d with t_min < t < t_max; u and v weigh the second and third vertex."""
    unit = unit_ray(mesh, o, d, t_min, t_max)
    reach = unit.reach
    best = Hit(t_max, -1, 0.0, 0.0)
    if reach >= 0.0:
        boxes, lanes, s = box_ray(unit), triangle_ray(unit), shear(d)
        nodes, blocks = table_at(mesh, NODES), table_at(mesh, BLOCKS)
        stack = scratch(STACK_WORDS)
        i64_put(stack, 0, 0)  # the root at no distance
        top = 1
        while top > 0:
            top -= 1
            key = i64_at(stack, top)
            if key > sort_key(reach):  # farther than the best hit
                continue
            child = key & CHILD
            if child < LEAF:
                top = push_children(nodes, child, boxes, reach, stack, top)
                continue
            block = child & (LEAF - 1)
            maybe = filter_block(blocks, block * BLOCK_FLOATS, lanes, reach).maybe
            while maybe != 0:
                hit = meet_triangle(mesh, block, lowest_bit(maybe), o, s, t_min, t_max)
                maybe &= maybe - 1
                # Of two triangles at the same place the one with the smaller number counts, whatever the order.
                if hit.t < best.t or (hit.t == best.t and hit.prim < best.prim):
                    best = hit
                    reach = best.t * unit.speed - unit.start + unit.slack
    return best if best.prim >= 0 else miss()


@kernel
def any_triangle(mesh: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> bool:
    """Whether the ray o + t d meets a triangle with t_min < t < t_max."""
    unit = unit_ray(mesh, o, d, t_min, t_max)
    if not unit.reach >= 0.0:
        return False
    boxes, lanes = box_ray(unit), triangle_ray(unit)
    nodes, blocks = table_at(mesh, NODES), table_at(mesh, BLOCKS)
    stack = scratch(STACK_WORDS)
    i64_put(stack, 0, BOTTOM)
    child, top = 0, 1
    while top > 0:
        if child < LEAF:
            next = visit_last(nodes, child, boxes, unit.reach, stack, top)
            if next.met:
                child, top = next.key, next.top
                continue
        else:
            block = child & (LEAF - 1)
            found = filter_block(blocks, block * BLOCK_FLOATS, lanes, unit.reach)
            if found.surely != 0:
                return True
            maybe = found.maybe
            while maybe != 0:
                if is_hit(meet_triangle(mesh, block, lowest_bit(maybe), o, shear(d), t_min, t_max)):
                    return True
                maybe &= maybe - 1
        top -= 1
        child = i64_at(stack, top)
    return False
