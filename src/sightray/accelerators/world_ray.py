"""Rays in the world's own frame and in double precision, as the classic structures use them."""

from __future__ import annotations

from typing import NamedTuple

from sightray._jit import kernel
from sightray.mathlib.scalars import f64
from sightray.mathlib.slabs import Span
from sightray.mathlib.vec import Vec3, grey, max3, vabs, vmax, vmin


class WorldRay(NamedTuple):
    """A ray, and what meets boxes and planes."""

    o: Vec3
    d: Vec3
    r: Vec3  # 1/d, but large and finite at zero: no infinity shall meet a zero
    slack: f64  # bound of the rounding errors that a far origin brings


@kernel
def world_ray(o: Vec3, d: Vec3) -> WorldRay:
    """Prepare a ray for boxes and planes."""
    return WorldRay(o, d, vmax(vmin(1.0 / d, grey(1e300)), grey(-1e300)), 2.0**-48 * max3(vabs(o)))


@kernel
def meet_box(lower: Vec3, upper: Vec3, ray: WorldRay, t_min: f64, t_max: f64) -> Span:
    """Where the ray is in a box, by slabs (Kay and Kajiya, 1986); empty where near > far."""
    a, b = (lower - ray.slack - ray.o) * ray.r, (upper + ray.slack - ray.o) * ray.r
    return Span(max(max3(vmin(a, b)), t_min), min(-max3(-vmax(a, b)), t_max))
