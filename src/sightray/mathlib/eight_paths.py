"""For eight paths at once: the warps of `warp`, and the frames and laws of `frame`."""

from __future__ import annotations

from typing import NamedTuple

from sightray._jit import kernel
from sightray.mathlib.eights import (
    F64x8,
    I64x8,
    Vec3x8,
    abs8d,
    cosine_of_octant8,
    cross8,
    dot8,
    gather8d,
    load8d,
    select8d,
    sign8d,
    sine_of_octant8,
    splat8d,
    sqrt8d,
    store8d,
    vmax8d,
)
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, f64_put
from sightray.mathlib.vec import Vec3


class Frame8(NamedTuple):
    """Three unit vectors at right angles, for each path."""

    s: Vec3x8
    t: Vec3x8
    n: Vec3x8


@kernel
def grey8(value: f64) -> Vec3x8:
    """The same value everywhere."""
    lanes = splat8d(value)
    return Vec3x8(lanes, lanes, lanes)


@kernel
def brightest8(a: Vec3x8) -> F64x8:
    """The largest of red, green and blue."""
    return vmax8d(vmax8d(a.x, a.y), a.z)


@kernel
def plus8(a: Vec3x8, value: F64x8) -> Vec3x8:
    """The same value added to red, green and blue."""
    return Vec3x8(a.x + value, a.y + value, a.z + value)


@kernel
def quotient8(a: Vec3x8, b: Vec3x8) -> Vec3x8:
    """Quotients of each component."""
    return Vec3x8(a.x / b.x, a.y / b.y, a.z / b.z)


@kernel
def normalize8(a: Vec3x8) -> Vec3x8:
    """Vectors of length 1."""
    return a * (1.0 / sqrt8d(dot8(a, a)))


@kernel
def gather8v(table: Table, index: I64x8) -> Vec3x8:
    """The vectors in three words each."""
    return Vec3x8(gather8d(table, index), gather8d(table, index + 1), gather8d(table, index + 2))


@kernel
def lines_at(table: Table, index: i64, line: i64) -> Vec3x8:
    """Eight vectors, whose x, y and z are `line` words apart."""
    return Vec3x8(load8d(table, index), load8d(table, index + line), load8d(table, index + 2 * line))


@kernel
def put_lines(table: Table, index: i64, line: i64, a: Vec3x8) -> None:
    """Write eight vectors in that order."""
    store8d(table, index, a.x)
    store8d(table, index + line, a.y)
    store8d(table, index + 2 * line, a.z)


@kernel
def load8v(table: Table, index: i64) -> Vec3x8:
    """Eight vectors, from word `index` on all x, then all y and all z."""
    return lines_at(table, index, 8)


@kernel
def store8v(table: Table, index: i64, a: Vec3x8) -> None:
    """Write eight vectors in that order."""
    put_lines(table, index, 8, a)


@kernel
def lane_at(table: Table, index: i64) -> Vec3:
    """One of eight vectors: `index` is that of the first plus its number."""
    return Vec3(f64_at(table, index), f64_at(table, index + 8), f64_at(table, index + 16))


@kernel
def put_lane(table: Table, index: i64, a: Vec3) -> None:
    """Write one of eight vectors."""
    f64_put(table, index, a.x)
    f64_put(table, index + 8, a.y)
    f64_put(table, index + 16, a.z)


@kernel
def concentric8(u: F64x8, v: F64x8) -> tuple[F64x8, F64x8]:
    """`warp.concentric`."""
    a, b = 2.0 * u - 1.0, 2.0 * v - 1.0
    wide = abs8d(a) > abs8d(b)
    long, short = select8d(wide, a, b), select8d(wide, b, a)
    q = short / select8d(abs8d(long) > 0.0, long, splat8d(1.0))
    along, across = long * cosine_of_octant8(q), long * sine_of_octant8(q)
    return select8d(wide, along, across), select8d(wide, across, along)


@kernel
def cosine_hemisphere8(u: F64x8, v: F64x8) -> Vec3x8:
    """`warp.cosine_hemisphere`."""
    x, y = concentric8(u, v)
    return Vec3x8(x, y, sqrt8d(vmax8d(splat8d(0.0), 1.0 - x * x - y * y)))


@kernel
def frame_about8(n: Vec3x8) -> Frame8:
    """Frames whose third axes are the unit vectors `n`; see `frame.perpendicular`."""
    sign = sign8d(n.z)
    a = -1.0 / (sign + n.z)
    s = Vec3x8(1.0 + sign * n.x * n.x * a, sign * n.x * n.y * a, -(sign * n.x))
    return Frame8(s, cross8(n, s), n)


@kernel
def into8(frame: Frame8, v: Vec3x8) -> Vec3x8:
    """World vectors in a frame."""
    return Vec3x8(dot8(frame.s, v), dot8(frame.t, v), dot8(frame.n, v))


@kernel
def out_of8(frame: Frame8, v: Vec3x8) -> Vec3x8:
    """Vectors of a frame in the world."""
    return frame.s * v.x + frame.t * v.y + frame.n * v.z


@kernel
def fresnel8(cos_i: F64x8, eta: F64x8) -> F64x8:
    """`frame.fresnel`."""
    sin2_t = eta * eta * vmax8d(splat8d(0.0), 1.0 - cos_i * cos_i)
    cos_t = sqrt8d(vmax8d(splat8d(0.0), 1.0 - sin2_t))
    r_s = (eta * cos_i - cos_t) / (eta * cos_i + cos_t)
    r_p = (cos_i - eta * cos_t) / (cos_i + eta * cos_t)
    return select8d(sin2_t >= 1.0, splat8d(1.0), 0.5 * (r_s * r_s + r_p * r_p))


@kernel
def refract8(wo: Vec3x8, eta: F64x8) -> Vec3x8:
    """Where light comes from that goes on along `wo` on the other side of the plane z = 0; see `frame.refract`."""
    cos_i = abs8d(wo.z)
    cos_t = sqrt8d(vmax8d(splat8d(0.0), 1.0 - eta * eta * (1.0 - cos_i * cos_i)))
    way = Vec3x8(-(wo.x * eta), -(wo.y * eta), -(sign8d(wo.z) * cos_t))
    return way * (1.0 / sqrt8d(dot8(way, way)))
