"""Eight rays against the pieces of a scene: all pieces, one after the other.

Flat pieces are met in single precision, by the affine maps of `bvh/few.py`, for eight rays together. With the bounds of its
rounding errors that filter says of most rays for sure which piece is the nearest, or that something is in the way; where it
is not sure, a ray is asked once more, alone and exactly. Balls are met in doubles. A ray that leaves a flat piece does not
meet that piece again, and one that leaves a ball only its other side.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.mathlib.eight_paths import gather8v
from sightray.mathlib.eights import (
    F64x8,
    I64x8,
    Vec3x8,
    abs8d,
    dot8,
    gather8d,
    mask8,
    not8,
    round8d,
    select8d,
    select8v,
    splat8d,
    splat8v,
    sqrt8d,
    vmax8d,
    whole8d,
    whole8i,
)
from sightray.mathlib.lanes import F32x8, Mask8, load8, lowest_bit, movemask8, select8, splat8, store8, vmin8
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, advance, f32_at, f64_at, i64_at, i64_put, scratch, table_at, vec3_at
from sightray.scene.pieces import (
    BALLS,
    CENTER,
    F_FOURTH,
    F_NORMAL,
    F_SIDE,
    F_THIRD,
    F_U,
    F_V,
    FLATS,
    MOST,
    NORMAL,
    OFFSET,
    PIECE_WORDS,
    REACH,
    ROWS,
)

ALONG = 128 * 2.0**-24  # slack of distances to planes, see bvh/few.py
NOTE_WORDS = 8  # of what is noted of a piece: eight distances and slopes as floats; and one for which rays hit it
MASKS = NOTE_WORDS * MOST
assert MASKS + MOST == 432  # as `meet8` has it
FAR = 1e30  # farther than all pieces


class Start8(NamedTuple):
    """Where eight rays begin, as floats about the centre of the scene."""

    x: F32x8
    y: F32x8
    z: F32x8
    size: F32x8  # how large coordinates are
    far: F32x8  # slack of distances to planes
    near: F32x8  # the same, negative
    own: F32x8  # the piece that the ray leaves, or -1


class Way8(NamedTuple):
    """Where they go."""

    x: F32x8
    y: F32x8
    z: F32x8


class Candidate8(NamedTuple):
    """A flat piece that some of eight rays may hit."""

    t: F32x8
    margin: F32x8  # slack of t
    maybe: Mask8
    sure: Mask8


class Best8(NamedTuple):
    """The nearest hits so far that are sure."""

    t: F32x8
    high: F32x8  # where the hit is at most
    piece: F32x8  # or -1
    doubt: F32x8  # where something else may have been hit, at least


class Met8(NamedTuple):
    """The nearest piece for each ray."""

    piece: I64x8  # or -1
    unsure: Mask8


class Shade8(NamedTuple):
    """Which rays have something before their light."""

    blocked: Mask8
    unsure: Mask8


class Spot8(NamedTuple):
    """Where rays meet pieces."""

    t: F64x8
    p: Vec3x8
    normal: Vec3x8  # unit, outward


@kernel
def start8(pieces: Table, o: Vec3x8, own: I64x8) -> Start8:
    """Prepare where rays begin for the filter."""
    q = o - splat8v(vec3_at(pieces, CENTER))
    far = vmax8d(vmax8d(abs8d(q.x), abs8d(q.y)), abs8d(q.z))
    size = round8d(vmax8d(far, splat8d(f64_at(pieces, REACH))))
    return Start8(
        round8d(q.x), round8d(q.y), round8d(q.z), size, size * splat8(ALONG), size * splat8(-ALONG), round8d(whole8d(own))
    )  # fmt: skip


@kernel
def way8(d: Vec3x8) -> Way8:
    """Prepare where they go."""
    return Way8(round8d(d.x), round8d(d.y), round8d(d.z))


@kernel
def number8(row: Table, index: i64) -> F32x8:
    """One of a piece's floats, for all rays."""
    return splat8(float(f32_at(row, index)))


@kernel
def along8(row: Table, index: i64, d: Way8) -> F32x8:
    """Products of three of a piece's floats and directions."""
    return number8(row, index) * d.x + number8(row, index + 1) * d.y + number8(row, index + 2) * d.z


@kernel
def from8(row: Table, index: i64, o: Start8) -> F32x8:
    """Products of three of a piece's floats and points, and a fourth."""
    x, y, z = number8(row, index) * o.x, number8(row, index + 1) * o.y, number8(row, index + 2) * o.z
    return number8(row, index + 3) + x + y + z


@kernel
def place8(row: Table, index: i64, o: Start8, d: Way8, slope: F32x8, s: F32x8) -> F32x8:
    """A coordinate of where rays meet the plane, times `slope`."""
    return from8(row, index, o) * slope + along8(row, index, d) * s


@kernel
def edge8(row: Table, index: i64, slope: F32x8, u: F32x8, v: F32x8) -> F32x8:
    """How far within another edge, times `slope`."""
    return number8(row, index) * slope + number8(row, index + 1) * u + number8(row, index + 2) * v


@kernel
def test8(row: Table, piece: f64, o: Start8, d: Way8, note: Table) -> i64:
    """Meet a flat piece, and note distances and slopes; bits of the rays that may hit it, and of those that do for sure.

    All is multiplied by `slope`, the cosine of ray and normal.
    """
    zero, me = splat8(0.0), splat8(piece)
    slope, s = along8(row, F_NORMAL, d), from8(row, F_NORMAL, o)  # the normal is turned round in s
    ahead = slope < zero
    slope, s = select8(ahead, zero - slope, slope), select8(ahead, s, zero - s)
    u, v = place8(row, F_U, o, d, slope, s), place8(row, F_V, o, d, slope, s)
    inner = vmin8(vmin8(u, v), vmin8(edge8(row, F_THIRD, slope, u, v), edge8(row, F_FOURTH, slope, u, v)))
    side = number8(row, F_SIDE) * o.size
    other = (o.own < me) | (o.own > me)
    store8(note, 0, s)
    store8(note, 8, slope)
    maybe = movemask8((inner + side >= zero) & (s > o.near) & other)
    return maybe | movemask8((inner > side) & (s > o.far)) << 8


@kernel
def test_all8(pieces: Table, o: Start8, d: Way8, notes: Table) -> i64:
    """Meet all flat pieces; a bit for each that any of the rays may hit.

    What has to be done for these is done afterwards: a branch for each piece would be guessed wrong too often.
    """
    rows, bits = table_at(pieces, ROWS), 0
    for k in range(i64_at(pieces, FLATS)):
        masks = test8(advance(rows, k * PIECE_WORDS), float(k), o, d, advance(notes, k * NOTE_WORDS))
        i64_put(notes, MASKS + k, masks)
        bits |= i64(masks & 255 != 0) << k
    return bits


@kernel
def candidate8(notes: Table, piece: i64, far: F32x8) -> Candidate8:
    """What was noted of a piece."""
    note, masks = advance(notes, piece * NOTE_WORDS), i64_at(notes, MASKS + piece)
    inverse = splat8(1.0) / load8(note, 8)
    maybe = mask8(masks & 255)
    return Candidate8(load8(note, 0) * inverse, far * inverse, maybe, maybe & mask8(masks >> 8))


@kernel
def better8(best: Best8, piece: f64, found: Candidate8) -> Best8:
    """The best hits, with those of one more piece."""
    nearer = found.sure & (found.t < best.t)
    beaten = select8(nearer, best.t + best.t - best.high, found.t - found.margin)
    doubt = select8(found.maybe, vmin8(best.doubt, beaten), best.doubt)
    return Best8(
        select8(nearer, found.t, best.t), select8(nearer, found.t + found.margin, best.high),
        select8(nearer, splat8(piece), best.piece), doubt,
    )  # fmt: skip


@kernel
def meet8(pieces: Table, o: Vec3x8, d: Vec3x8, own: I64x8) -> Met8:
    """The nearest piece for each of eight rays with unit directions that leave the pieces `own`, or none (-1)."""
    notes, start = scratch(432), start8(pieces, o, own)
    bits, far = test_all8(pieces, start, way8(d), notes), start.far
    best = Best8(splat8(FAR), splat8(FAR), splat8(-1.0), splat8(math.inf))
    while bits != 0:
        k = lowest_bit(bits)
        bits &= bits - 1
        best = better8(best, float(k), candidate8(notes, k, far))
    flats = i64_at(pieces, FLATS)
    for k in range(flats, flats + i64_at(pieces, BALLS)):
        row = advance(table_at(pieces, ROWS), k * PIECE_WORDS)
        center, radius = splat8v(vec3_at(row, NORMAL)), splat8d(f64_at(row, OFFSET))
        t = ball8(center, radius, o, d, own == k)
        hit = t > 0.0
        if movemask8(hit) != 0:
            best = better8(best, float(k), Candidate8(round8d(t), far, hit, hit))
    return Met8(whole8i(best.piece), best.doubt <= best.high)


@kernel
def ball8(center: Vec3x8, radius: F64x8, o: Vec3x8, d: Vec3x8, own: Mask8) -> F64x8:
    """Where rays meet a ball, -1 where they do not; those which begin on it meet its other side. See shapes/sphere.py."""
    f = o - center
    b = -dot8(f, d)
    foot = f + d * b
    square = radius * radius - dot8(foot, foot)
    q = sqrt8d(vmax8d(square, splat8d(0.0)))
    t = select8d(own | (b - q <= 0.0), b + q, b - q)
    return select8d((square >= 0.0) & (t > 1e-9 * radius), t, splat8d(-1.0))


@kernel
def spot8(pieces: Table, o: Vec3x8, d: Vec3x8, own: I64x8, piece: I64x8) -> Spot8:
    """Where rays meet pieces, in doubles."""
    rows, at = table_at(pieces, ROWS), piece * PIECE_WORDS
    normal, offset = gather8v(rows, at + NORMAL), gather8d(rows, at + OFFSET)
    t = (offset - dot8(normal, o)) / dot8(normal, d)
    round = piece >= i64_at(pieces, FLATS)
    if movemask8(round) == 0:
        return Spot8(t, o + d * t, normal)
    t = select8d(round, ball8(normal, offset, o, d, not8(own != piece)), t)
    p = o + d * t
    return Spot8(t, p, select8v(round, (p - normal) * (1.0 / offset), normal))


@kernel
def blocked8(pieces: Table, o: Vec3x8, d: Vec3x8, reach: F64x8, own: I64x8, target: I64x8) -> Shade8:
    """Which of eight rays meet a piece, other than the light `target` that they seek, before they have gone `reach` far."""
    notes, start = scratch(432), start8(pieces, o, own)
    bits = test_all8(pieces, start, way8(d), notes)
    end, blocked, doubt = round8d(reach), mask8(0), mask8(0)
    while bits != 0:
        k = lowest_bit(bits)
        bits &= bits - 1
        found, other = candidate8(notes, k, start.far), target != k
        blocked = blocked | (found.sure & (found.t + found.margin < end) & other)
        doubt = doubt | (found.maybe & (found.t - found.margin < end) & other)
    flats = i64_at(pieces, FLATS)
    for k in range(flats, flats + i64_at(pieces, BALLS)):
        row = advance(table_at(pieces, ROWS), k * PIECE_WORDS)
        center, radius = splat8v(vec3_at(row, NORMAL)), splat8d(f64_at(row, OFFSET))
        t = ball8(center, radius, o, d, own == k)
        blocked = blocked | ((t > 0.0) & (t < reach) & (target != k))
    return Shade8(blocked, doubt & not8(blocked))
