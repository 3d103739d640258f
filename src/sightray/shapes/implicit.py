"""Implicit."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from sightray._jit import implements, kernel
from sightray.errors import SceneError
from sightray.fields import Point, derived_array, derived_integer, integer, other, vector
from sightray.mathlib.expression import compile_expression
from sightray.mathlib.hit import Hit, miss
from sightray.mathlib.interpret import bound_on_ray
from sightray.mathlib.isolate import first_root
from sightray.mathlib.rays import is_ray
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.slabs import box_span
from sightray.mathlib.table import Table, i64_at, table_at, vec3_at
from sightray.mathlib.turns import tangent_around_y, turn
from sightray.mathlib.vec import Vec3, dot
from sightray.shapes.base import Shape, Surface, intersect, surface


def _expression(text: Any) -> str:
    if not isinstance(text, str):
        raise SceneError(f"got {text!r:.60}; allowed: a string such as 'x**2 + y**2 + z**2 - 1'")
    if text:
        compile_expression(text)
    return text


def _function(value: Any) -> Callable | None:
    if value is not None and not hasattr(value, "__kernel__"):
        raise SceneError(f"got {value!r:.60}; allowed: a function decorated with sightray's @kernel, or None")
    return value


class Implicit(Shape):
    """Where ``expression``, a formula in x, y and z, is zero, between ``lower`` and ``upper``.

    The formula may have numbers, ``pi tau e``, ``+ - * /``, ``**`` with a constant exponent and the functions
    ``sin cos tan asin acos atan atan2 sinh cosh tanh exp log sqrt abs min max hypot pow``. Text is parsed, never run.

    Roots along a ray are found with interval arithmetic (D. Mitchell, "Robust ray intersection with interval
    arithmetic", 1990; `mathlib.isolate`), so no sheet is too thin to be seen. Where the function touches zero without
    crossing (``(x**2 + y**2 + z**2 - 1)**2``), the root is known to about 1e-8 of the box. Poles and places where the
    function is not defined (``log`` of negative numbers) are no surface.

    Instead of an expression, ``function`` takes a user's kernel ``f(x: f64, y: f64, z: f64) -> f64``. Nothing is known
    about it, so it is sampled at ``samples`` even steps along the ray's way through the box: two sheets closer than a
    step can be missed. Its gradient comes from central differences.

    An open surface where the box cuts it: its outer side is the one where the function is positive.

    Texture coordinates: u runs once around the vertical through the middle of the box, counter-clockwise seen from
    above, starting at +x; v from the bottom of the box (0) to its top (1).
    """

    expression: str = other("formula in x, y, z that is zero on the surface", _expression, default="")
    lower: Point = vector("corner of the box with the smallest coordinates", default=(-1.0, -1.0, -1.0), unit="m")
    upper: Point = vector("corner of the box with the largest coordinates", default=(1.0, 1.0, 1.0), unit="m")
    function: Any = other("kernel of x, y and z, in place of an expression", _function, default=None)
    samples: int = integer("steps along a ray where a function is searched", default=256, at_least=2, at_most=1_000_000)
    count = derived_integer("length of the program", lambda shape: len(shape.program()))
    code = derived_array("program of the expression", lambda shape: shape.program())

    def __new__(cls, **values: Any) -> Implicit:
        """An object whose class carries the user's function, if there is one: kernels belong to classes."""
        function = _function(values.get("function"))
        return object.__new__(cls if function is None else _class_for(function))

    def program(self) -> np.ndarray:
        """The expression as `mathlib.interpret` runs it."""
        return compile_expression(self.expression) if self.expression else np.zeros((0, 2))

    def check(self) -> None:
        if bool(self.expression) == (self.function is not None):
            raise SceneError("Implicit.expression: allowed: either an expression or a function, and not both")
        if not all(p < q for p, q in zip(self.lower, self.upper, strict=True)):
            raise SceneError(f"Implicit.upper: got {self.upper}; allowed: larger than lower {self.lower} on each axis")

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        return np.array(self.lower), np.array(self.upper)


_classes: dict[Callable, type[Implicit]] = {}


def _class_for(function: Callable) -> type[Implicit]:
    """`Implicit` with the kernels that sample one user's function."""
    if function not in _classes:
        from sightray.shapes.sampled import kernels_for

        made: Any = type("_Sampled", (Implicit,), {"__doc__": Implicit.__doc__})
        made.__name__ = made.__qualname__ = "Implicit"
        made.kernels = {**Implicit.kernels, **kernels_for(function)}
        _classes[function] = made
    return _classes[function]


LOWER, UPPER, SAMPLES, COUNT, CODE = Implicit.offsets()


@implements(intersect, Implicit)
def intersect_implicit(shape: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> Hit:
    span = box_span(vec3_at(shape, LOWER), vec3_at(shape, UPPER), o, d)
    if not (span.near <= span.far and is_ray(o, d)):
        return miss()
    start = span.near
    t = first_root(table_at(shape, CODE), i64_at(shape, COUNT), o + d * start, d, start, span.far - start, t_min, t_max)
    return Hit(t, 0, 0.0, 0.0) if t < math.inf else miss()


@kernel
def slope_along(program: Table, count: i64, p: Vec3, axis: Vec3) -> f64:
    """Derivative of the expression at a point along an axis."""
    f = bound_on_ray(program, count, p, axis, 0.0, 0.0)
    return 0.5 * (f.z + f.w)


@implements(surface, Implicit)
def surface_of_implicit(shape: Table, hit: Hit, p: Vec3) -> Surface:
    program, count = table_at(shape, CODE), i64_at(shape, COUNT)
    n = Vec3(slope_along(program, count, p, Vec3(1.0, 0.0, 0.0)), slope_along(program, count, p, Vec3(0.0, 1.0, 0.0)),
             slope_along(program, count, p, Vec3(0.0, 0.0, 1.0)))  # fmt: skip
    return surface_in_box(shape, p, n)


@kernel
def surface_in_box(shape: Table, p: Vec3, n: Vec3) -> Surface:
    """Normal, texture coordinates and tangent at a point where the gradient is `n`."""
    lower, upper = vec3_at(shape, LOWER), vec3_at(shape, UPPER)
    if dot(n, n) == 0.0:  # a touch or a tip, which have no normal
        n = Vec3(0.0, 1.0, 0.0)
    q = p - (lower + upper) * 0.5
    v = min(1.0, max(0.0, (p.y - lower.y) / (upper.y - lower.y)))
    return Surface(n, n, turn(q.x, -q.z), v, tangent_around_y(n, q))
