"""What integrators share: where secondary rays begin, and the frame of a shading point."""

from __future__ import annotations

from typing import NamedTuple

from sightray._jit import kernel
from sightray.accelerators.item import ORIENTED
from sightray.mathlib.frame import perpendicular
from sightray.mathlib.scalars import f64
from sightray.mathlib.vec import Vec3, cross, dot, max3, normalize, vabs
from sightray.scene.world import Point


class Frame(NamedTuple):
    """Three unit vectors at right angles."""

    s: Vec3
    t: Vec3
    n: Vec3


@kernel
def frame_about(n: Vec3) -> Frame:
    """A frame whose third axis is the unit vector `n`."""
    s = perpendicular(n)
    return Frame(s, cross(n, s), n)


@kernel
def frame_of(point: Point) -> Frame:
    """The frame in which a point's material is asked: its x is along the tangent where the material cares."""
    if point.flags & ORIENTED != 0:
        across = cross(point.shading, point.tangent)
        if dot(across, across) > 0.0:
            t = normalize(across)
            return Frame(cross(t, point.shading), t, point.shading)
    return frame_about(point.shading)


@kernel
def into(frame: Frame, v: Vec3) -> Vec3:
    """A world vector in a frame."""
    return Vec3(dot(frame.s, v), dot(frame.t, v), dot(frame.n, v))


@kernel
def out_of(frame: Frame, v: Vec3) -> Vec3:
    """A vector of a frame in the world."""
    return frame.s * v.x + frame.t * v.y + frame.n * v.z


@kernel
def on_true_side(point: Point, d: Vec3, way: Vec3, passes: bool) -> Vec3:
    """A direction moved to the side of the true surface that it is meant for.

    Where the shading normal differs from the true one, light that was reflected by the one may point into the other.
    Mirrored in the true surface it stays outside: nothing leaks through, and no dark fringe is left.
    """
    facing = dot(point.normal, way)
    if (facing * dot(point.normal, d) > 0.0) == passes:
        return way
    return way - point.normal * (2.0 * facing)


@kernel
def first_step(stated: f64, p: Vec3, t: f64) -> f64:
    """Where secondary rays begin, so that they do not meet the surface they leave; `stated` is NaN where it is not."""
    if stated == stated:
        return stated
    return 1e-9 * max(t, max3(vabs(p)))
