"""A rectangle as a point sees it: its solid angle, and points of it that are even in solid angle.

References: C. Ureña, M. Fajardo, A. King, "An area-preserving parametrization for spherical rectangles", Computer
Graphics Forum 32(4), 2013.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.mathlib.eight_functions import atan2_8, circle8
from sightray.mathlib.eights import (
    F64x8,
    Vec3x8,
    abs8d,
    dot8,
    select8d,
    sign8d,
    splat8d,
    splat8v,
    sqrt8d,
    vmax8d,
    vmin8d,
)
from sightray.mathlib.scalars import f64
from sightray.mathlib.vec import Vec3, cross, dot, length

NEAR = 1.0  # area over squared distance, from where on it pays: nearer, areas leave much noise
FLAT = 1e-14  # squared height over area, below which a point counts as on the rectangle, and sees nothing of it
LEAST = 1e-6  # solid angle, below which the sum of angles that it is has cancelled


class Window(NamedTuple):
    """A rectangle in the frame of a point: x0 to x1 and y0 to y1 at the depth z < 0."""

    x_axis: Vec3
    y_axis: Vec3
    z_axis: Vec3
    x0: f64
    y0: f64
    x1: f64
    y1: f64
    z: f64
    b0: f64  # cosines of the planes through the edges at y0 and y1
    b1: f64
    k: f64
    solid_angle: f64  # 0 where areas are the better measure: far away, and in the rectangle's plane


@kernel
def no_window() -> Window:
    """A rectangle that is better measured by its area."""
    none = Vec3(0.0, 0.0, 0.0)
    return Window(none, none, none, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def window_of(p: Vec3, corner: Vec3, edge_u: Vec3, edge_v: Vec3, area: f64) -> Window:
    """How a rectangle, whose edges are at right angles, is seen from p."""
    d = corner - p
    middle = d + edge_u * 0.5 + edge_v * 0.5
    if area < NEAR * dot(middle, middle):
        return no_window()
    w, h = length(edge_u), length(edge_v)
    x_axis, y_axis = edge_u / w, edge_v / h
    z_axis = cross(x_axis, y_axis)
    x0, y0, z = dot(d, x_axis), dot(d, y_axis), dot(d, z_axis)
    if z > 0.0:
        z_axis, z = -z_axis, -z
    x1, y1 = x0 + w, y0 + h
    if z * z <= FLAT * area:
        return no_window()

    # The planes through p and each edge meet at the angles of the spherical rectangle (section 3.1).
    b0, c1 = -y0 / math.sqrt(z * z + y0 * y0), x1 / math.sqrt(z * z + x1 * x1)
    b1, c0 = y1 / math.sqrt(z * z + y1 * y1), -x0 / math.sqrt(z * z + x0 * x0)
    g0, g1, g2, g3 = math.acos(-b0 * c1), math.acos(-c1 * b1), math.acos(-b1 * c0), math.acos(-c0 * b0)
    k = 2.0 * math.pi - g2 - g3
    solid_angle = g0 + g1 - k
    if solid_angle < LEAST:
        return no_window()
    return Window(x_axis, y_axis, z_axis, x0, y0, x1, y1, z, b0, b1, k, solid_angle)


@kernel
def in_window(window: Window, u: f64, v: f64) -> Vec3:
    """From p to the rectangle's point for two uniform numbers, even in solid angle (section 3.2)."""
    z = window.z
    angle = u * window.solid_angle + window.k
    f = (math.cos(angle) * window.b0 - window.b1) / math.sin(angle)
    c = min(1.0, max(-1.0, math.copysign(1.0, f) / math.sqrt(f * f + window.b0 * window.b0)))
    x = -c * z / math.sqrt(max(1.0 - c * c, 1e-300))
    x = min(max(x, window.x0), window.x1)
    d2 = x * x + z * z
    h0, h1 = window.y0 / math.sqrt(d2 + window.y0 * window.y0), window.y1 / math.sqrt(d2 + window.y1 * window.y1)
    height = h0 + v * (h1 - h0)
    y = height * math.sqrt(d2 / max(1.0 - height * height, 1e-300))
    y = min(max(y, window.y0), window.y1)
    return window.x_axis * x + window.y_axis * y + window.z_axis * z


# ---------------------------------------------------------------------------------------------------- for eight paths


class Glimpse8(NamedTuple):
    """Ways from eight points to one of a rectangle's each, even in solid angle, and that solid angle."""

    way: Vec3x8
    solid_angle: F64x8  # 0 as in `Window`


@kernel
def angle8(cosine: F64x8) -> F64x8:
    """Angles of these cosines."""
    return atan2_8(sqrt8d(vmax8d(splat8d(0.0), (1.0 - cosine) * (1.0 + cosine))), cosine)


@kernel
def glimpse8(to_corner: Vec3x8, edge_u: Vec3, edge_v: Vec3, area: f64, u: F64x8, v: F64x8) -> Glimpse8:
    """`window_of` and `in_window` for eight points, from which a corner is at `to_corner`."""
    w, h = length(edge_u), length(edge_v)
    x_axis, y_axis, z_axis = splat8v(edge_u / w), splat8v(edge_v / h), splat8v(cross(edge_u, edge_v) / (w * h))
    x0, y0, z = dot8(to_corner, x_axis), dot8(to_corner, y_axis), dot8(to_corner, z_axis)
    x1, y1, z2 = x0 + w, y0 + h, z * z
    b0, b1 = -(y0 / sqrt8d(z2 + y0 * y0)), y1 / sqrt8d(z2 + y1 * y1)
    c0, c1 = -(x0 / sqrt8d(z2 + x0 * x0)), x1 / sqrt8d(z2 + x1 * x1)
    k = 2.0 * math.pi - angle8(-(b1 * c0)) - angle8(-(c0 * b0))
    solid_angle = angle8(-(b0 * c1)) + angle8(-(c1 * b1)) - k
    middle = to_corner + splat8v((edge_u + edge_v) * 0.5)
    near = (dot8(middle, middle) * NEAR <= area) & (z2 > FLAT * area) & (solid_angle >= LEAST)

    cosine, sine = circle8((u * solid_angle + k) * (0.5 / math.pi))
    f = (cosine * b0 - b1) / sine
    c = vmin8d(splat8d(1.0), vmax8d(splat8d(-1.0), sign8d(f) / sqrt8d(f * f + b0 * b0)))
    x = c * abs8d(z) / sqrt8d(vmax8d(1.0 - c * c, splat8d(1e-300)))
    x = vmin8d(vmax8d(x, x0), x1)
    d2 = x * x + z2
    h0, h1 = y0 / sqrt8d(d2 + y0 * y0), y1 / sqrt8d(d2 + y1 * y1)
    height = h0 + v * (h1 - h0)
    y = height * sqrt8d(d2 / vmax8d(1.0 - height * height, splat8d(1e-300)))
    y = vmin8d(vmax8d(y, y0), y1)
    return Glimpse8(x_axis * x + y_axis * y + z_axis * z, select8d(near, solid_angle, splat8d(0.0)))
