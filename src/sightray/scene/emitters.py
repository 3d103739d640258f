"""Surfaces that glow, as lights: whatever shape has a material that gives off light is looked for like a lamp.

Each triangle of a mesh, and each triangle, rectangle and disk, is a *patch*: the points ``q + s e_u + t e_v`` with (s, t)
in a triangle, a square or a disk, wherever transforms have put it. A sphere is seen under a cone, as a `SphereLight` is.
What they give off is asked of the material at the chosen point, so textures glow as they are painted.

Other shapes, surfaces with holes and spheres that were stretched glow all the same, but are only found by chance.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from sightray._jit import METHOD_SLOTS, implements, kernel
from sightray.accelerators.item import MATERIAL, ItemHit, item_surface, normal_in_object, to_object
from sightray.lights.base import (
    Light,
    LightBounds,
    LightPolygon,
    LightSample,
    direction_density,
    illuminate,
    in_lanes,
    polygon,
)
from sightray.lights.disk import concentric
from sightray.lights.sphere import cap_of, is_outside, toward_sphere
from sightray.lights.window import Window, in_window, window_of
from sightray.materials.base import emitted, glow_in_lanes
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, i64_at, no_table, table_at, vec3_at
from sightray.mathlib.vec import Vec3, dot, grey, length
from sightray.shapes.disk import Disk
from sightray.shapes.mesh import Mesh
from sightray.shapes.rectangle import Rectangle
from sightray.shapes.sphere import Sphere
from sightray.shapes.triangle import Triangle
from sightray.textures.base import Where

SQUARE, TRIANGLE, DISK, UPRIGHT = 0, 1, 2, 3  # UPRIGHT: a square whose edges are at right angles in the world

# Rows: the item and the triangle of it, what of the plane it is, its area; a sphere has its centre and radius.
ITEM, PRIM, KIND, AREA = METHOD_SLOTS, METHOD_SLOTS + 1, METHOD_SLOTS + 2, METHOD_SLOTS + 3
CORNER, EDGE_U, EDGE_V, NORMAL = (METHOD_SLOTS + 4 + 4 * k for k in range(4))
CENTER, RADIUS = CORNER, AREA
ROW_WORDS = 32
EVENLY = 0.05  # share of a painted lamp's light that is looked for everywhere on it alike


class _Patch(Light):
    """A flat piece of a surface that glows."""


class _Ball(Light):
    """A sphere that glows."""


class Glowing(NamedTuple):
    """The lights that one item is: n rows."""

    kind: type[Light]
    rows: np.ndarray  # (n, ROW_WORDS) float64, without the item's address
    bounds: LightBounds


def lights_of(item: Any) -> Glowing | None:
    """The lights that an item of a scene is, one for each of its primitives; None if it is none, or cannot be one."""
    glow = item.material.glow
    if not glow > 0.0 or item.material.cutout:
        return None
    if isinstance(item.shape, Sphere):
        return _ball(item.shape, item.transform.matrix, glow)
    found = _flat_pieces(item.shape)
    if found is None:
        return None
    kind, corner, edge_u, edge_v = found
    m = item.transform.matrix[:3, :3]
    corner, edge_u, edge_v = item.transform.point(corner), edge_u @ m.T, edge_v @ m.T
    across = np.cross(edge_u, edge_v) * np.sign(np.linalg.det(m))
    size = np.linalg.norm(across, axis=1)
    normal = across / np.where(size > 0.0, size, 1.0)[:, None]
    area = size * {SQUARE: 1.0, TRIANGLE: 0.5, DISK: math.pi}[kind]
    upright = np.abs((edge_u * edge_v).sum(axis=1)) <= 1e-9 * size

    rows = np.zeros((len(corner), ROW_WORDS))
    words = rows.view(np.int64)
    words[:, PRIM], rows[:, AREA] = np.arange(len(corner)), area
    words[:, KIND] = np.where(upright & (kind == SQUARE), UPRIGHT, kind)
    for at, part in ((CORNER, corner), (EDGE_U, edge_u), (EDGE_V, edge_v), (NORMAL, normal)):
        rows[:, at : at + 3] = part
    if kind == DISK:
        reach = np.sqrt(edge_u**2 + edge_v**2)
        ends = np.stack([corner - reach, corner + reach])
    else:
        ends = np.stack([corner, corner + edge_u, corner + edge_v, corner + (edge_u + edge_v) * (kind == SQUARE)])
    two_sided = getattr(item.material, "two_sided", True)
    half = np.full(len(corner), math.pi if two_sided else 0.0)
    shine = _shine(item, glow, len(corner)) * area
    bounds = LightBounds(ends.min(axis=0), ends.max(axis=0), normal, half, 0.5 * math.pi, shine)
    return Glowing(_Patch, rows, bounds)


def _shine(item: Any, glow: float, count: int) -> np.ndarray:
    """About how much radiance each piece gives off: of a painted mesh, by what is painted on its triangles.

    Some of the mean is added, so that no piece that glows a little is left out.
    """
    painted, shape = item.material.painted_glow, item.shape
    if painted is None or not isinstance(shape, Mesh) or shape.uvs is None:
        return np.full(count, glow)
    return np.asarray(painted.brightness_over(shape.uvs[shape.faces]) * (1.0 - EVENLY) + EVENLY * glow)


def _flat_pieces(shape: Any) -> tuple[int, np.ndarray, np.ndarray, np.ndarray] | None:
    """What flat pieces a shape is made of: a corner and two edges of each, (n, 3), in the space of the shape."""
    if isinstance(shape, Mesh):
        a, b, c = (shape.vertices[shape.faces[:, k]] for k in range(3))
        return TRIANGLE, a, b - a, c - a
    if isinstance(shape, Triangle):
        a, b, c = np.array([[shape.a], [shape.b], [shape.c]])
        return TRIANGLE, a, b - a, c - a
    if isinstance(shape, Rectangle):
        return SQUARE, *np.array([[shape.corner], [shape.edge_u], [shape.edge_v]])
    if isinstance(shape, Disk) and shape.inner_radius == 0.0:
        from sightray.mathlib.axes import axes_across

        u, v, _ = axes_across(shape.normal)
        return DISK, *np.array([[shape.center], [shape.radius * u], [shape.radius * v]])
    return None


def _ball(sphere: Sphere, matrix: np.ndarray, glow: float) -> Glowing | None:
    """A sphere that glows, if it is still one in the world."""
    scale = float(np.cbrt(abs(np.linalg.det(matrix[:3, :3]))))
    if np.abs(matrix[:3, :3].T @ matrix[:3, :3] / scale**2 - np.eye(3)).max() > 1e-9:
        return None
    center, radius = matrix[:3, :3] @ np.array(sphere.center) + matrix[:3, 3], scale * sphere.radius
    row = np.zeros((1, ROW_WORDS))
    row[0, CENTER : CENTER + 3], row[0, RADIUS] = center, radius
    up, turn = np.array([[0.0, 1.0, 0.0]]), np.full(1, math.pi)
    brightness = np.full(1, glow * math.pi * radius**2)
    return Glowing(
        _Ball, row, LightBounds(center[None] - radius, center[None] + radius, up, turn, 0.5 * math.pi, brightness)
    )


@kernel
def glow_at(light: Table, q: Vec3, u: f64, v: f64, cosine: f64) -> Vec3:
    """Radiance, RGB, that the surface gives off at a point, at an angle to its normal."""
    item = table_at(light, ITEM)
    q_object = to_object(item, q)
    s = item_surface(item, ItemHit(0.0, 0, i64_at(light, PRIM), u, v), q_object)
    where = Where(s.u, s.v, q_object, normal_in_object(item, s.normal), 0.0, no_table())
    return emitted(table_at(item, MATERIAL), where, cosine)


@kernel
def window_from(light: Table, p: Vec3) -> Window:
    """An upright patch as it is seen from p."""
    return window_of(
        p, vec3_at(light, CORNER), vec3_at(light, EDGE_U), vec3_at(light, EDGE_V), f64_at(light, AREA)
    )  # fmt: skip


@kernel
def glow_of_patch(light: Table, p: Vec3, way: Vec3, r: f64) -> Vec3:
    """Radiance, RGB, that an upright patch sends to p from where the unit vector `way` meets it after r metres."""
    edge_u, edge_v = vec3_at(light, EDGE_U), vec3_at(light, EDGE_V)
    q = p + way * r
    place = q - vec3_at(light, CORNER)
    s, t = dot(place, edge_u) / dot(edge_u, edge_u), dot(place, edge_v) / dot(edge_v, edge_v)
    return glow_at(light, q, s, t, -dot(way, vec3_at(light, NORMAL)))


@implements(illuminate, _Patch)
def illuminate_from_patch(light: Table, p: Vec3, cell: i64, u: f64, v: f64) -> LightSample:
    kind = i64_at(light, KIND)
    if kind == UPRIGHT:
        window = window_from(light, p)
        if window.solid_angle > 0.0:
            way = in_window(window, u, v)
            r = length(way)
            way = way / r
            glow = glow_of_patch(light, p, way, r)
            return LightSample(way, r, glow * window.solid_angle, 1.0 / window.solid_angle)
    if kind == TRIANGLE:
        root = math.sqrt(u)
        s, t = 1.0 - root, v * root
    elif kind == DISK:
        place = concentric(u, v)
        s, t = place.x, place.y
    else:
        s, t = u, v
    q = vec3_at(light, CORNER) + vec3_at(light, EDGE_U) * s + vec3_at(light, EDGE_V) * t
    to_light = q - p
    r = length(to_light)
    if not r > 0.0:
        return LightSample(vec3_at(light, NORMAL), 0.0, grey(0.0), 0.0)
    to_light = to_light / r
    cosine = -dot(to_light, vec3_at(light, NORMAL))
    radiance = glow_at(light, q, s, t, cosine)
    seen = abs(cosine) * f64_at(light, AREA) / (r * r)
    return LightSample(to_light, r, radiance * seen, 1.0 / seen if seen > 0.0 else 0.0)


@implements(direction_density, _Patch)
def density_of_patch(light: Table, p: Vec3, l: Vec3, distance: f64) -> f64:  # noqa: E741
    if i64_at(light, KIND) == UPRIGHT:
        window = window_from(light, p)
        if window.solid_angle > 0.0:
            return 1.0 / window.solid_angle
    cosine = abs(dot(l, vec3_at(light, NORMAL)))
    return distance * distance / (cosine * f64_at(light, AREA)) if cosine > 0.0 else 0.0


@implements(in_lanes, _Patch)
def patch_in_lanes(light: Table, bands: Table, rgb: Vec3) -> Vec3:
    return glow_in_lanes(table_at(table_at(light, ITEM), MATERIAL), bands, rgb)


@implements(in_lanes, _Ball)
def ball_in_lanes(light: Table, bands: Table, rgb: Vec3) -> Vec3:
    return glow_in_lanes(table_at(table_at(light, ITEM), MATERIAL), bands, rgb)


@implements(polygon, _Patch)
def polygon_of_patch(light: Table, p: Vec3) -> LightPolygon:
    kind, a = i64_at(light, KIND), vec3_at(light, CORNER)
    e_u, e_v = vec3_at(light, EDGE_U), vec3_at(light, EDGE_V)
    if kind == DISK:
        return LightPolygon(0, a, e_u, e_v, grey(0.0))
    middle = 1.0 / 3.0 if kind == TRIANGLE else 0.5  # where a painted glow is taken from
    q = a + (e_u + e_v) * middle
    radiance = glow_at(light, q, middle, middle, dot(p - q, vec3_at(light, NORMAL)) / length(p - q))
    return LightPolygon(3 if kind == TRIANGLE else 4, a, e_u, e_v, radiance)


@implements(illuminate, _Ball)
def illuminate_from_ball(light: Table, p: Vec3, cell: i64, u: f64, v: f64) -> LightSample:
    center, radius = vec3_at(light, CENTER), f64_at(light, RADIUS)
    way = toward_sphere(p, center, radius, u, v)
    if not way.solid_angle > 0.0:
        return LightSample(way.direction, way.distance, grey(0.0), 0.0)
    q = p + way.direction * way.distance
    radiance = glow_at(light, q, 0.0, 0.0, dot(p - q, q - center) / (way.distance * radius))
    return LightSample(way.direction, way.distance, radiance * way.solid_angle, 1.0 / way.solid_angle)


@implements(direction_density, _Ball)
def density_of_ball(light: Table, p: Vec3, l: Vec3, distance: f64) -> f64:  # noqa: E741
    d, radius = length(vec3_at(light, CENTER) - p), f64_at(light, RADIUS)
    return 1.0 / (2.0 * math.pi * cap_of(radius, d)) if is_outside(d, radius) else 0.0
