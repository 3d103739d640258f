"""The kernel that runs programs of `mathlib.expression` on spans."""

from __future__ import annotations

from sightray._jit import kernel
from sightray.mathlib.expression import (
    ABSOLUTE,
    ADD,
    CONSTANT,
    COPY,
    EXPONENTIAL,
    FIRST_BINARY,
    FIRST_UNARY,
    HYPERBOLIC_TANGENT,
    LARGER,
    LOGARITHM,
    MULTIPLY,
    NEGATE,
    POWER,
    RECIPROCAL,
    ROOT,
    SINE,
    TANGENT,
    X,
    Y,
)
from sightray.mathlib.intervals import (
    absolute_of,
    angle_of,
    arctangent_of,
    exponential_of,
    hyperbolic_tangent_of,
    larger_of,
    logarithm_of,
    multiply,
    negate,
    outward,
    power_of,
    reciprocal_of,
    root_of,
    sine_of,
    tangent_of,
)
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, i64_at, scratch, vec3_at, vec3_put
from sightray.mathlib.vec import Vec3, vabs, vmax, vmin


@kernel
def bound_on_ray(program: Table, count: i64, o: Vec3, d: Vec3, a: f64, b: f64) -> Vec3:
    """Span of the expression over the points o + s d with a <= s <= b; [1, 1] where it is defined nowhere."""
    p, q = o + d * a, o + d * b
    slack = (vabs(o) + vabs(p) + vabs(q)) * 2.0**-52
    lower, upper = vmin(p, q) - slack, vmax(p, q) + slack
    stack = scratch(132)  # MAX_STACK spans and one more
    top = -4
    for i in range(count):
        code = i64_at(program, 2 * i)
        if code < FIRST_BINARY:
            top += 4
            if code == CONSTANT:
                c = f64_at(program, 2 * i + 1)
                vec3_put(stack, top, Vec3(c, c, 0.0, 0.0))
            elif code == COPY:
                vec3_put(stack, top, vec3_at(stack, top - 4))
            elif code == X:
                vec3_put(stack, top, Vec3(lower.x, upper.x, d.x, d.x))
            elif code == Y:
                vec3_put(stack, top, Vec3(lower.y, upper.y, d.y, d.y))
            else:
                vec3_put(stack, top, Vec3(lower.z, upper.z, d.z, d.z))
        elif code < FIRST_UNARY:
            top -= 4
            vec3_put(stack, top, apply_binary(code, vec3_at(stack, top), vec3_at(stack, top + 4)))
        else:
            argument = vec3_at(stack, top)
            if argument.y < 0.0 and code in (ROOT, LOGARITHM):
                return Vec3(1.0, 1.0, 0.0, 0.0)
            vec3_put(stack, top, apply_unary(code, argument, f64_at(program, 2 * i + 1)))
    return vec3_at(stack, 0)


@kernel
def apply_binary(code: i64, a: Vec3, b: Vec3) -> Vec3:
    """One of the operations on two spans."""
    if code == ADD:
        return outward(a + b, 1.0)
    if code == MULTIPLY:
        return multiply(a, b)
    if code == LARGER:
        return larger_of(a, b)
    return angle_of(a, b)


@kernel
def apply_unary(code: i64, a: Vec3, operand: f64) -> Vec3:
    """One of the functions of a span."""
    if code == NEGATE:
        return negate(a)
    if code == POWER:
        return power_of(a, int(operand))
    if code == RECIPROCAL:
        return reciprocal_of(a)
    if code == SINE:
        return sine_of(a)
    if code == ROOT:
        return root_of(a)
    if code == ABSOLUTE:
        return absolute_of(a)
    if code == EXPONENTIAL:
        return exponential_of(a)
    if code == LOGARITHM:
        return logarithm_of(a)
    if code == TANGENT:
        return tangent_of(a)
    if code == HYPERBOLIC_TANGENT:
        return hyperbolic_tangent_of(a)
    return arctangent_of(a)
