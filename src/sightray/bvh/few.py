"""Meshes of few triangles: all are asked at once, sixteen by sixteen, and no tree is walked.

A ray that walks a tree waits for one node after the other, and for branches that were guessed wrong. Up to `MOST` triangles
it takes less time to meet all of them, in single precision, and to decide in double what that leaves.

**The filter** is the test by an affine map for each triangle (S. Woop, "A ray tracing hardware architecture for dynamic
scenes", 2004): with the unit normal n, and rows U and V that give the barycentric coordinates of a point, the ray meets the
plane at t = (m - n o) / (n d), and the weights there are U (o + t d) + u. All is multiplied by |n d| instead of divided.
Let e = 2^-24; in the tree's unit frame points of the mesh have coordinates of at most 1, those of o at most O, those of d
at most D, and A is the largest 1-norm of U and V. Inputs are rounded by e, operations by e of their result. To first order
this moves the distance to the plane by 18 e O, the product n d by 11 e D, U o + u by 10 e A O and U d by 6 e A D; so the
weights of the second and third vertex by 91 e A O D, that of the first by 260 e A O D, and the comparison of lengths up to
4 O / D, which no hit exceeds, by 88 e O. 384 and 128 are used as slack. The decision is that of `triangles`, to the bit.

Most rays begin on one of the triangles, and it would have to be decided that they do not meet that one. So the distance to
the plane is found in double precision, and where a ray begins is compared with a slack of 2^-46 O (more than the rounding
of the distance and of the decision), and 16 e D for each t before that.

Rays that come from too far away for this, or have directions too long or too short, walk the tree.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sightray._jit import kernel
from sightray.bvh.bvh8 import CENTER, SCALE
from sightray.bvh.triangles import MESH_WORDS, MeshTree, Shear, any_triangle, axis_of, closest_triangle, decide, shear
from sightray.mathlib.hit import Hit, is_hit, miss
from sightray.mathlib.lanes import (
    F32x16,
    flip16,
    least16,
    load16,
    load16d,
    lowest_bit,
    mask16,
    movemask16,
    round16,
    select16,
    splat16,
    splat16d,
    vmin16,
)
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Space, Table, aligned, f64_at, i64_at, is_null, link, table_at, vec3_at
from sightray.mathlib.tally import TESTS, tally
from sightray.mathlib.vec import Vec3, max3, vabs

MOST = 128  # triangles for which no tree is walked

# Words of a mesh row behind those of the tree and its triangles.
SIXTEENS = MESH_WORDS  # pointer to blocks of sixteen triangles, or none
SIXTEEN_COUNT = MESH_WORDS + 1
CORNERS = MESH_WORDS + 2  # pointer to twelve doubles a triangle: three corners' x and one more, their y, their z
FEW_WORDS = MESH_WORDS + 3

# Of a block, sixteen of each: n and m as doubles; n, U and u, V and v, and the slack that is in proportion to A as floats.
SIXTEEN_WORDS = 160
NORMAL, SECOND, THIRD, SLACK = 128, 176, 240, 304
SIDE, ALONG, BEGIN, BEFORE = 384 * 2.0**-24, 128 * 2.0**-24, 2.0**-46, 16 * 2.0**-24
FARTHEST, FASTEST = 8.0, 1e15


def pack_few(space: Space, row: Table, mesh: MeshTree) -> None:
    """Fill the words from `SIXTEENS` on; with nothing, if the mesh has too many triangles."""
    link(row, SIXTEENS, None)
    if len(mesh.faces) > MOST:
        return
    corners = mesh.vertices[mesh.faces]
    link(row, SIXTEENS, space.array(filter_blocks((corners - mesh.tree.center) * mesh.tree.scale)))
    row.view(np.int64)[SIXTEEN_COUNT] = -(-len(corners) // 16)
    exact = aligned((len(corners), 3, 4), np.float64)
    exact[:, :, :3] = corners.transpose(0, 2, 1)
    link(row, CORNERS, space.array(exact))


def filter_blocks(corners: np.ndarray) -> np.ndarray:
    """Blocks for the filter, (b, 160) float64, of triangles (n, corner, axis) in the unit frame.

    Triangles without area pass the filter always, empty lanes never.
    """
    a, e1, e2 = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    n = np.cross(e1, e2)
    with np.errstate(all="ignore"):
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        second, third = np.cross(e2, n), np.cross(n, e1)
        second /= (e1 * second).sum(axis=1, keepdims=True)
        third /= (e2 * third).sum(axis=1, keepdims=True)
        slack = SIDE * np.maximum(np.abs(second).sum(axis=1), np.abs(third).sum(axis=1))
        rows = [n, (n * a).sum(axis=1), n, second, -(second * a).sum(axis=1), third, -(third * a).sum(axis=1), slack]
        values = np.column_stack(rows)
        flat = ~np.isfinite(values.astype(np.float32)).all(axis=1)
    values[flat] = 0.0
    values[flat, -1] = np.inf
    blocks = aligned((-(-len(values) // 16), SIXTEEN_WORDS), np.float64)
    padded = np.full((len(blocks) * 16, values.shape[1]), np.nan)
    padded[: len(values)] = values
    lanes = padded.reshape(len(blocks), 16, -1).transpose(0, 2, 1)
    blocks[:, : NORMAL // 2] = lanes[:, :4].reshape(len(blocks), -1)
    blocks.view(np.float32)[:, NORMAL:] = lanes[:, 4:].reshape(len(blocks), -1)
    return blocks


class FewRay(NamedTuple):
    """A ray in the unit frame, as the filter wants it; t is the ray's own."""

    o: Vec3
    ox: F32x16
    oy: F32x16
    oz: F32x16
    dx: F32x16
    dy: F32x16
    dz: F32x16
    side: F32x16  # what to multiply a block's slack by
    along: F32x16  # slack of lengths
    begin: F32x16  # the same where the ray begins
    low: F32x16  # t there
    end: f64  # and where it ends
    fits: bool


@kernel
def few_ray(mesh: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> FewRay:
    """Prepare a ray for the filter."""
    scale = f64_at(mesh, SCALE)
    o, d = (o - vec3_at(mesh, CENTER)) * scale, d * scale
    far, speed = max(1.0, max3(vabs(o))), max3(vabs(d))
    fits = far <= FARTHEST and 1.0 / FASTEST < speed < FASTEST and t_min < t_max
    most = 4.0 * far / max(speed, 1.0 / FASTEST)
    low = max(t_min, -most)
    return FewRay(
        o, splat16(o.x), splat16(o.y), splat16(o.z), splat16(d.x), splat16(d.y), splat16(d.z),
        splat16(far * speed), splat16(ALONG * far), splat16(BEGIN * far + BEFORE * speed * abs(low)), splat16(low),
        min(t_max, most), fits,
    )  # fmt: skip


class Sixteen(NamedTuple):
    """What the filter finds in a block."""

    maybe: i64  # triangles that the ray may meet, a bit each
    surely: i64  # those that it meets, whatever the rounding
    length: F32x16  # t times `slant`
    slant: F32x16


@kernel
def filter_sixteen(blocks: Table, block: i64, ray: FewRay, end: f64) -> Sixteen:
    """Test the triangles of a block in single precision."""
    tally(TESTS)
    at = block * (2 * SIXTEEN_WORDS)
    nx, ny, nz = load16(blocks, at + NORMAL), load16(blocks, at + NORMAL + 16), load16(blocks, at + NORMAL + 32)
    ux, uy, uz = load16(blocks, at + SECOND), load16(blocks, at + SECOND + 16), load16(blocks, at + SECOND + 32)
    vx, vy, vz = load16(blocks, at + THIRD), load16(blocks, at + THIRD + 16), load16(blocks, at + THIRD + 32)
    signed = nx * ray.dx + ny * ray.dy + nz * ray.dz
    slant, length = flip16(signed, signed), flip16(height_above(blocks, block * SIXTEEN_WORDS, ray.o), signed)
    u = (ux * ray.ox + uy * ray.oy + uz * ray.oz + load16(blocks, at + SECOND + 48)) * slant
    v = (vx * ray.ox + vy * ray.oy + vz * ray.oz + load16(blocks, at + THIRD + 48)) * slant
    u = u + (ux * ray.dx + uy * ray.dy + uz * ray.dz) * length
    v = v + (vx * ray.dx + vy * ray.dy + vz * ray.dz) * length
    slack, zero = load16(blocks, at + SLACK) * ray.side, splat16(0.0)
    inside = vmin16(vmin16(u, v), slant - u - v)
    after, before = length - slant * ray.low, slant * splat16(end) - length
    maybe = (inside + slack >= zero) & (vmin16(after + ray.begin, before + ray.along) >= zero)
    surely = (inside > slack) & (vmin16(after, before) > ray.along)
    return Sixteen(movemask16(maybe), movemask16(surely), length, slant)


@kernel
def height_above(blocks: Table, at: i64, o: Vec3) -> F32x16:
    """How far a point has to go along the normal to each plane of a block."""
    x, y = load16d(blocks, at) * splat16d(o.x), load16d(blocks, at + 16) * splat16d(o.y)
    z = load16d(blocks, at + 32) * splat16d(o.z)
    return round16(load16d(blocks, at + 48) - (x + y + z))


@kernel
def nearest_of(found: Sixteen, maybe: i64) -> i64:
    """Which of the triangles `maybe` is met first, by single precision."""
    if maybe & (maybe - 1) == 0:
        return lowest_bit(maybe)
    t = select16(mask16(maybe) & (found.slant > splat16(0.0)), found.length / found.slant, splat16(-3e38))
    least = least16(select16(mask16(maybe), t, splat16(3.4e38)))
    return lowest_bit(movemask16(t <= splat16(least)) & maybe)


@kernel
def meet_numbered(mesh: Table, prim: i64, o: Vec3, s: Shear, t_min: f64, t_max: f64) -> Hit:
    """The hit of a triangle, decided in double precision as by `triangles.meet_triangle`."""
    corners, at = table_at(mesh, CORNERS), 12 * prim
    z = vec3_at(corners, at + 4 * s.kz) - axis_of(o, s.kz)
    x, y = vec3_at(corners, at + 4 * s.kx) - axis_of(o, s.kx), vec3_at(corners, at + 4 * s.ky) - axis_of(o, s.ky)
    return decide(prim, x, y, z, s, t_min, t_max)


@kernel
def closest_in_mesh(mesh: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> Hit:
    """Nearest hit of the ray o + t d with t_min < t < t_max; u and v weigh the second and third vertex."""
    blocks = table_at(mesh, SIXTEENS)
    if is_null(blocks):
        return closest_triangle(mesh, o, d, t_min, t_max)
    ray = few_ray(mesh, o, d, t_min, t_max)
    if not ray.fits:
        return closest_triangle(mesh, o, d, t_min, t_max)
    s, best = shear(d), Hit(t_max, -1, 0.0, 0.0)
    for block in range(i64_at(mesh, SIXTEEN_COUNT)):
        found = filter_sixteen(blocks, block, ray, min(ray.end, best.t))
        maybe = found.maybe
        while maybe != 0:
            bit = nearest_of(found, maybe)
            maybe &= ~(1 << bit)
            hit = meet_numbered(mesh, 16 * block + bit, o, s, t_min, t_max)
            # Of two triangles at the same place the one with the smaller number counts, whatever the order.
            if hit.t < best.t or (hit.t == best.t and hit.prim < best.prim):
                best = hit
                within = found.slant * splat16(min(ray.end, best.t)) - found.length + ray.along >= splat16(0.0)
                maybe &= movemask16(within)
    return best if best.prim >= 0 else miss()


@kernel
def any_in_mesh(mesh: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> bool:
    """Whether the ray o + t d meets a triangle with t_min < t < t_max."""
    blocks = table_at(mesh, SIXTEENS)
    if is_null(blocks):
        return any_triangle(mesh, o, d, t_min, t_max)
    ray = few_ray(mesh, o, d, t_min, t_max)
    if not ray.fits:
        return any_triangle(mesh, o, d, t_min, t_max)
    for block in range(i64_at(mesh, SIXTEEN_COUNT)):
        found = filter_sixteen(blocks, block, ray, ray.end)
        if found.surely != 0:
            return True
        maybe = found.maybe
        while maybe != 0:
            if is_hit(meet_numbered(mesh, 16 * block + lowest_bit(maybe), o, shear(d), t_min, t_max)):
                return True
            maybe &= maybe - 1
    return False
