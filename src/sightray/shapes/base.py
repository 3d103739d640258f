"""The contract of shapes.

A shape lives in its own object space. Rays come to it by the inverse transform, with a direction that is *not*
normalised, so that the ray parameter t is the same number in both spaces. A shape

- reports in `intersect` the nearest hit with ``t_min < t < t_max``, or `miss()`;
- answers in `occluded` whether there is any (by default through `intersect`);
- describes in `surface` the point that was hit: outward normal, shading normal, texture coordinates, tangent; and may
  give the outward normal alone in `facing`, for those who need no more, or say by `flat` that it is the same all over a
  primitive;
- may answer `closest_in_packets` and `any_in_packets` faster than ray by ray;
- states in `bounds` a box in object space that contains it; infinite for surfaces without end.

Intersections are computed in double precision. A `Hit` carries what `surface` needs beside the point: which
primitive or part was met, and up to two numbers of the shape's own choice.
"""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple

import numpy as np

from sightray._jit import implements, method
from sightray.bvh.bundles import packet_vec3
from sightray.bvh.casting import DIRECTION, END, ORIGIN, PACKET_WORDS, PRIM
from sightray.fields import child, other, text
from sightray.mathlib.hit import Hit, is_hit
from sightray.mathlib.rays import is_ray
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, advance, f64_at, f64_put, i64_at, i64_put
from sightray.mathlib.transform import Transform, as_transform
from sightray.mathlib.vec import Vec3, grey
from sightray.registry import Member


class Surface(NamedTuple):
    """A point of a surface, in the space of the shape; vectors need not be normalised."""

    normal: Vec3  # geometric, outward
    shading: Vec3  # the normal that lighting uses
    u: f64
    v: f64
    tangent: Vec3  # derivative of the point by u


class Shape(Member, family="shapes"):
    """Base of all shapes."""

    material: Any = child("what it is made of; None for a grey matte", "materials", default=None, optional=True,
                          packed=False)  # fmt: skip
    transform: Transform = other(
        "object to world", as_transform, default=None, plain=lambda t: None if t.is_identity else t.matrix.tolist()
    )
    name: str = text("label for people and datasets", default="")
    flat: ClassVar[bool] = False  # whether each primitive has one geometric normal, whatever the point

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper corner of a box around the shape, in object space: two (3,) float64 arrays."""
        raise NotImplementedError(f"{type(self).__name__} does not state its bounds")


@method(0)
def intersect(shape: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> Hit:
    """Nearest hit of the ray o + t d with t_min < t < t_max, in object space."""
    raise NotImplementedError


@method(1)
def occluded(shape: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> bool:
    """Whether the ray o + t d meets the shape with t_min < t < t_max."""
    raise NotImplementedError


@method(2)
def surface(shape: Table, hit: Hit, p: Vec3) -> Surface:
    """The surface at the point p of a hit, in object space."""
    raise NotImplementedError


@method(3)
def rise(shape: Table, hit: Hit, p: Vec3, side: f64) -> Vec3:
    """The way from p, in object space, up to the surface that the shading normals pretend; `side` is 1 outside, else -1.

    It is zero, unless the shape's shading normals differ from its own.
    """
    raise NotImplementedError


@implements(rise, Shape)
def as_round_as_it_is(shape: Table, hit: Hit, p: Vec3, side: f64) -> Vec3:
    return grey(0.0)


@implements(occluded, Shape)
def occluded_through_intersect(shape: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> bool:
    return is_hit(intersect(shape, o, d, t_min, t_max))


@method(4)
def handedness(shape: Table, prim: i64) -> f64:
    """Positive where u, v and the outward normal are right-handed, negative where pictures are seen mirrored."""
    raise NotImplementedError


@implements(handedness, Shape)
def right_handed(shape: Table, prim: i64) -> f64:
    return 1.0


@method(5)
def facing(shape: Table, hit: Hit, p: Vec3) -> Vec3:
    """The geometric normal of `surface` alone, for those who need no more."""
    raise NotImplementedError


@implements(facing, Shape)
def facing_by_surface(shape: Table, hit: Hit, p: Vec3) -> Vec3:
    return surface(shape, hit, p).normal


@method(6)
def closest_in_packets(shape: Table, packets: Table, count: i64, t_min: f64, found: Table, room: Table) -> None:
    """`intersect` for the rays of packets (see `bvh.casting`), in object space, at time 0.

    Where one is met before its end, `END` and `PRIM` tell where and what; bits of these rays are written to `found`, a
    word for each packet. `room` is working memory, see `bvh.packets`.
    """
    raise NotImplementedError


@implements(closest_in_packets, Shape)
def closest_one_by_one(shape: Table, packets: Table, count: i64, t_min: f64, found: Table, room: Table) -> None:
    for p in range(count):
        i64_put(found, p, 0)
        packet = advance(packets, p * PACKET_WORDS)
        for lane in range(16):
            end = f64_at(packet, END + lane)
            o, d = packet_vec3(packet, ORIGIN + lane), packet_vec3(packet, DIRECTION + lane)
            if t_min < end and is_ray(o, d):
                hit = intersect(shape, o, d, t_min, end)
                if hit.t < end:
                    f64_put(packet, END + lane, hit.t)
                    f64_put(packet, PRIM + lane, float(hit.prim))
                    i64_put(found, p, i64_at(found, p) | 1 << lane)


@method(7)
def any_in_packets(shape: Table, packets: Table, count: i64, t_min: f64, found: Table, room: Table) -> None:
    """`occluded` for the rays of packets: bits of those that the shape stops are written to `found`."""
    raise NotImplementedError


@implements(any_in_packets, Shape)
def any_one_by_one(shape: Table, packets: Table, count: i64, t_min: f64, found: Table, room: Table) -> None:
    for p in range(count):
        i64_put(found, p, 0)
        packet = advance(packets, p * PACKET_WORDS)
        for lane in range(16):
            end = f64_at(packet, END + lane)
            o, d = packet_vec3(packet, ORIGIN + lane), packet_vec3(packet, DIRECTION + lane)
            if t_min < end and is_ray(o, d) and occluded(shape, o, d, t_min, end):
                i64_put(found, p, i64_at(found, p) | 1 << lane)
