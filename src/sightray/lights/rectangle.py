"""A window or a lamp panel: a parallelogram that shines."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import implements, kernel
from sightray.errors import SceneError
from sightray.fields import Point, derived_integer, derived_number, derived_vector, flag, vector
from sightray.lights.area import (
    GRID,
    RADIANCE,
    VISIBLE,
    _AreaLight,
    cut,
    flat_density,
    from_piece,
    from_pieces8,
    place_in_cells,
)
from sightray.lights.base import (
    LightBounds,
    LightPolygon,
    LightSample,
    LightSample8,
    direction_density,
    flat,
    illuminate,
    illuminate_eight,
    polygon,
)
from sightray.lights.window import NEAR, Window, glimpse8, in_window, window_of
from sightray.mathlib.eight_paths import grey8
from sightray.mathlib.eights import (
    F64x8,
    Vec3x8,
    dot8,
    select8d,
    select8v,
    splat8d,
    splat8v,
    sqrt8d,
)
from sightray.mathlib.lanes import movemask8
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, i64_at, vec3_at
from sightray.mathlib.vec import Vec3, dot, grey, length


class RectangleLight(_AreaLight):
    """A flat light with corners ``corner``, ``corner + edge_u``, ``corner + edge_v`` and ``corner + edge_u + edge_v``.

    It shines to the side to which ``edge_u x edge_v`` points, or to both if `two_sided`. The irradiance of a point is
    the integral of L cos_light cos_receiver / r² over the area A; each of the grid's cells contributes
    ``L A/grid² cos_light / r²`` at a jittered point. Without obstacles the sum tends to Lambert's formula for polygons,
    L/2 sum theta_i (n . gamma_i) (J. H. Lambert, Photometria, 1760; J. Arvo, SIGGRAPH 1995).

    Where it is large and near, and its edges are at right angles, cells divide the solid angle instead of the area, and
    each brings ``L Omega/grid²`` from its direction (C. Ureña, M. Fajardo, A. King, CGF 32(4), 2013): no noise is left
    but that of the receiver's cosine. The edges may also slant.
    """

    corner: Point = vector("a corner", unit="m")
    edge_u: Point = vector("from the corner along one side", unit="m", nonzero=True)
    edge_v: Point = vector("from the corner along the other side", unit="m", nonzero=True)
    two_sided: bool = flag("whether it shines to both sides", default=False)
    _normal: Any = derived_vector("unit normal, on the side that shines", lambda r: r.area_vector() / r.area)
    _area: Any = derived_number("area", lambda r: r.area)
    _upright: Any = derived_integer("whether the edges are at right angles", lambda r: int(r.upright()))

    def area_vector(self) -> np.ndarray:
        """``edge_u x edge_v``, (3,) float64: as long as the area, m²."""
        return np.cross(self.edge_u, self.edge_v)

    @property
    def area(self) -> float:
        """Area of one side, m²."""
        return float(np.linalg.norm(self.area_vector()))

    def upright(self) -> bool:
        """Whether the edges are at right angles."""
        return abs(float(np.dot(self.edge_u, self.edge_v))) <= 1e-9 * self.area

    def check(self) -> None:
        if not self.area > 1e-12 * np.linalg.norm(self.edge_u) * np.linalg.norm(self.edge_v):
            edges = f"edge_u {self.edge_u} and edge_v {self.edge_v}"
            raise SceneError(f"RectangleLight: {edges} are parallel; allowed: edges that span an area")

    def bounds(self) -> LightBounds:
        q, u, v = (np.array(part) for part in (self.corner, self.edge_u, self.edge_v))
        normal, radiant = self.area_vector() / self.area, np.multiply(self.radiance, self.area)
        return flat([q, q + u, q + v, q + u + v], normal, self.two_sided, radiant)

    def shape(self) -> Any | None:
        """The shining `Rectangle`, if `visible`."""
        from sightray.materials.emitter import Emitter
        from sightray.shapes.rectangle import Rectangle

        if not self.visible:
            return None
        material = Emitter(radiance=self.radiance, spectrum=self.spectrum, two_sided=self.two_sided)
        return Rectangle(corner=self.corner, edge_u=self.edge_u, edge_v=self.edge_v, material=material)


CORNER, EDGE_U, EDGE_V, TWO_SIDED, NORMAL, AREA, UPRIGHT = RectangleLight.offsets()[5:]


@kernel
def window_from(light: Table, p: Vec3) -> Window:
    """The light as it is seen from p."""
    return window_of(
        p, vec3_at(light, CORNER), vec3_at(light, EDGE_U), vec3_at(light, EDGE_V), f64_at(light, AREA)
    )  # fmt: skip


@implements(illuminate, RectangleLight)
def illuminate_from_rectangle(light: Table, p: Vec3, cell: i64, u: f64, v: f64) -> LightSample:
    n = cut(i64_at(light, GRID), cell)
    s = place_in_cells(n, cell, u, v)
    if i64_at(light, UPRIGHT) != 0:
        window = window_from(light, p)
        if window.solid_angle > 0.0:
            to_light = in_window(window, s.x, s.y)
            r = length(to_light)
            lit = dot(to_light, vec3_at(light, NORMAL)) < 0.0 or i64_at(light, TWO_SIDED) != 0
            share = window.solid_angle / (n * n) if lit else 0.0
            density = 1.0 / window.solid_angle if i64_at(light, VISIBLE) != 0 else 0.0
            return LightSample(to_light / r, r, vec3_at(light, RADIANCE) * share, density)
    q = vec3_at(light, CORNER) + vec3_at(light, EDGE_U) * s.x + vec3_at(light, EDGE_V) * s.y
    both = i64_at(light, TWO_SIDED) != 0
    return from_piece(light, p, q, vec3_at(light, NORMAL), f64_at(light, AREA), n * n, both)


@implements(illuminate_eight, RectangleLight)
def illuminate_eight_from_rectangle(light: Table, p: Vec3x8, u: F64x8, v: F64x8) -> LightSample8:
    area = f64_at(light, AREA)
    edge_u, edge_v = splat8v(vec3_at(light, EDGE_U)), splat8v(vec3_at(light, EDGE_V))
    to_corner = splat8v(vec3_at(light, CORNER)) - p
    to_light = to_corner + edge_u * u + edge_v * v
    found = from_pieces8(light, to_light, vec3_at(light, NORMAL), area, i64_at(light, TWO_SIDED) != 0)
    to_middle = to_corner + (edge_u + edge_v) * 0.5
    if i64_at(light, UPRIGHT) == 0 or movemask8(dot8(to_middle, to_middle) * NEAR <= splat8d(area)) == 0:
        return found
    glimpse = glimpse8(to_corner, vec3_at(light, EDGE_U), vec3_at(light, EDGE_V), area, u, v)
    r, solid_angle = sqrt8d(dot8(glimpse.way, glimpse.way)), glimpse.solid_angle
    lit = dot8(glimpse.way, splat8v(vec3_at(light, NORMAL))) < (math.inf if i64_at(light, TWO_SIDED) != 0 else 0.0)
    irradiance = select8v(lit, splat8v(vec3_at(light, RADIANCE)) * solid_angle, grey8(0.0))
    shown, near = 1.0 if i64_at(light, VISIBLE) != 0 else 0.0, solid_angle > 0.0
    return LightSample8(
        select8v(near, glimpse.way * (1.0 / r), found.direction), select8d(near, r, found.distance),
        select8v(near, irradiance, found.irradiance), select8d(near, shown / solid_angle, found.density),
    )  # fmt: skip


@implements(direction_density, RectangleLight)
def density_of_rectangle(light: Table, p: Vec3, l: Vec3, distance: f64) -> f64:  # noqa: E741
    if i64_at(light, UPRIGHT) != 0 and i64_at(light, VISIBLE) != 0:
        window = window_from(light, p)
        if window.solid_angle > 0.0:
            return 1.0 / window.solid_angle
    return flat_density(light, vec3_at(light, NORMAL), f64_at(light, AREA), l, distance)


@implements(polygon, RectangleLight)
def polygon_of_rectangle(light: Table, p: Vec3) -> LightPolygon:
    a = vec3_at(light, CORNER)
    lit = dot(p - a, vec3_at(light, NORMAL)) > 0.0 or i64_at(light, TWO_SIDED) != 0
    radiance = vec3_at(light, RADIANCE) if lit else grey(0.0)
    return LightPolygon(4, a, vec3_at(light, EDGE_U), vec3_at(light, EDGE_V), radiance)
