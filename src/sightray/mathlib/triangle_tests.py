"""Three ways to meet a ray with a triangle: two as lectures derive them, and the one that programs use.

All take the corners a, b, c and the ray o + t d, and give t with the weights u of b and v of c: the point is
``(1 - u - v) a + u b + v c``. t may be negative, and is infinite where the ray's line misses. Points on edges count.
`tests/families/test_triangle_tests.py` shows that they agree.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.mathlib.scalars import f64
from sightray.mathlib.vec import Vec3, cross, dot


class TriangleHit(NamedTuple):
    """Ray parameter and barycentric weights of b and c."""

    t: f64
    u: f64
    v: f64


@kernel
def no_triangle() -> TriangleHit:
    """A miss."""
    return TriangleHit(math.inf, 0.0, 0.0)


@kernel
def determinant(p: Vec3, q: Vec3, r: Vec3) -> f64:
    """Determinant of the matrix with columns p, q, r: the volume they span."""
    return dot(cross(p, q), r)


@kernel
def triangle_by_linear_system(a: Vec3, b: Vec3, c: Vec3, o: Vec3, d: Vec3) -> TriangleHit:
    """Solve G (u, v, t) = g with columns G = [b - a, c - a, -d] and g = o - a by Cramer's rule (1750)."""
    g1, g2, g3, g = b - a, c - a, -d, o - a
    det = determinant(g1, g2, g3)
    if det == 0.0:
        return no_triangle()

    # Replace one column after the other by the right-hand side.
    u = determinant(g, g2, g3) / det
    v = determinant(g1, g, g3) / det
    t = determinant(g1, g2, g) / det
    if u >= 0.0 and v >= 0.0 and u + v <= 1.0:
        return TriangleHit(t, u, v)
    return no_triangle()


@kernel
def triangle_by_plane_and_edges(a: Vec3, b: Vec3, c: Vec3, o: Vec3, d: Vec3) -> TriangleHit:
    """Meet the triangle's plane, then ask of each edge whether the point lies on its inner side."""
    n = cross(b - a, c - a)
    slope = dot(n, d)
    if slope == 0.0:
        return no_triangle()
    t = dot(n, a - o) / slope
    p = o + d * t

    # Each triple product is an area: of the triangle that the point makes with one edge.
    area_c = dot(n, cross(b - a, p - a))
    area_a = dot(n, cross(c - b, p - b))
    area_b = dot(n, cross(a - c, p - c))
    if area_a >= 0.0 and area_b >= 0.0 and area_c >= 0.0:
        return TriangleHit(t, area_b / dot(n, n), area_c / dot(n, n))
    return no_triangle()


@kernel
def moeller_trumbore(a: Vec3, b: Vec3, c: Vec3, o: Vec3, d: Vec3) -> TriangleHit:
    """Cramer's rule with shared products and early outs (T. Möller, B. Trumbore, "Fast, minimum storage ...", 1997)."""
    e1, e2 = b - a, c - a
    p = cross(d, e2)
    det = dot(e1, p)
    if det == 0.0:
        return no_triangle()
    s = o - a
    u = dot(s, p) / det
    if not 0.0 <= u <= 1.0:
        return no_triangle()
    q = cross(s, e1)
    v = dot(d, q) / det
    if v >= 0.0 and u + v <= 1.0:
        return TriangleHit(dot(e2, q) / det, u, v)
    return no_triangle()
