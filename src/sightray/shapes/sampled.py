"""How `Implicit` meets a user's own function, of which nothing is known: by looking at many points of the ray."""

from __future__ import annotations

import math
import types
from collections.abc import Callable

from sightray._jit import kernel, method
from sightray.errors import SceneError
from sightray.mathlib.hit import Hit, miss
from sightray.mathlib.rays import is_ray
from sightray.mathlib.scalars import f64
from sightray.mathlib.slabs import box_span
from sightray.mathlib.table import Table, i64_at, vec3_at
from sightray.mathlib.vec import Vec3, length
from sightray.shapes.base import Surface, intersect, surface
from sightray.shapes.implicit import LOWER, SAMPLES, UPPER, surface_in_box

_STEP = 1e-5  # of the box's diagonal: balances truncation and rounding of central differences


@method(3)
def value_at(shape: Table, x: f64, y: f64, z: f64) -> f64:
    """The user's function."""
    raise NotImplementedError


def _value(shape: Table, x: f64, y: f64, z: f64) -> f64:
    return user_function(x, y, z)  # type: ignore[name-defined]  # noqa: F821  put in below, for each function


def kernels_for(function: Callable) -> dict[Callable, Callable]:
    """The kernels of a shape that samples `function`."""
    if function.__closure__:
        names = ", ".join(function.__code__.co_freevars)
        raise SceneError(f"Implicit.function: got a kernel that uses outer variables ({names}); allowed: globals only")
    if function.__code__.co_argcount != 3:
        raise SceneError("Implicit.function: allowed: a kernel of three numbers, f(x: f64, y: f64, z: f64) -> f64")
    scope = {**_value.__globals__, "user_function": function}
    value = types.FunctionType(_value.__code__, scope, f"value_of_{function.__name__}")
    value.__annotations__ = _value.__annotations__
    return {intersect: intersect_sampled, surface: surface_of_sampled, value_at: kernel(value)}


@kernel
def value_on_ray(shape: Table, o: Vec3, d: Vec3, s: f64) -> f64:
    """The function at o + s d."""
    p = o + d * s
    return value_at(shape, p.x, p.y, p.z)


@kernel
def halve_to_root(shape: Table, o: Vec3, d: Vec3, a: f64, b: f64, rising: bool) -> f64:
    """Where the sign changes between a and b; NaN at a pole, where values grow toward the change."""
    limit = max(abs(value_on_ray(shape, o, d, a)), abs(value_on_ray(shape, o, d, b)))
    for _ in range(100):
        m = 0.5 * (a + b)
        if m <= a or m >= b:
            break
        if (value_on_ray(shape, o, d, m) < 0.0) == rising:
            a = m
        else:
            b = m
    return b if abs(value_on_ray(shape, o, d, b)) <= limit else math.nan


@kernel
def intersect_sampled(shape: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> Hit:
    span = box_span(vec3_at(shape, LOWER), vec3_at(shape, UPPER), o, d)
    if not (span.near <= span.far and is_ray(o, d)):
        return miss()
    p, start, end, n = o + d * span.near, span.near, span.far - span.near, i64_at(shape, SAMPLES)

    # The samples do not depend on t_min: a root is the same number for all rays that continue one another.
    first = min(max(0, int((t_min - start) / end * n) - 1), n) if t_min > start and end > 0.0 else 0
    before = value_on_ray(shape, p, d, end * first / n)
    for i in range(first, n):
        a, b = end * i / n, end * (i + 1) / n
        if start + a >= t_max:
            break
        after = value_on_ray(shape, p, d, b)
        if (before < 0.0 <= after) or (after < 0.0 <= before):
            t = start + halve_to_root(shape, p, d, a, b, before < 0.0)
            if t_min < t < t_max:
                return Hit(t, 0, 0.0, 0.0)
        before = after
    return miss()


@kernel
def surface_of_sampled(shape: Table, hit: Hit, p: Vec3) -> Surface:
    h = _STEP * length(vec3_at(shape, UPPER) - vec3_at(shape, LOWER))
    x = value_at(shape, p.x + h, p.y, p.z) - value_at(shape, p.x - h, p.y, p.z)
    y = value_at(shape, p.x, p.y + h, p.z) - value_at(shape, p.x, p.y - h, p.z)
    z = value_at(shape, p.x, p.y, p.z + h) - value_at(shape, p.x, p.y, p.z - h)
    return surface_in_box(shape, p, Vec3(x, y, z))
