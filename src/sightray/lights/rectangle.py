"""A window or a lamp panel: a parallelogram that shines."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray._jit import implements
from sightray.errors import SceneError
from sightray.fields import Point, derived_number, derived_vector, flag, vector
from sightray.lights.area import GRID, RADIANCE, _AreaLight, flat_density, from_piece, place_in_grid
from sightray.lights.base import LightSample, direction_density, illuminate
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, i64_at, vec3_at
from sightray.mathlib.vec import Vec3


class RectangleLight(_AreaLight):
    """A flat light with corners ``corner``, ``corner + edge_u``, ``corner + edge_v`` and ``corner + edge_u + edge_v``.

    It shines to the side to which ``edge_u x edge_v`` points, or to both if `two_sided`. The irradiance of a point is
    the integral of L cos_light cos_receiver / r² over the area A; each of the grid's cells contributes
    ``L A/grid² cos_light / r²`` at a jittered point. Without obstacles the sum tends to Lambert's formula for polygons,
    L/2 sum theta_i (n . gamma_i) (J. H. Lambert, Photometria, 1760; J. Arvo, SIGGRAPH 1995).

    The edges need not be at right angles.
    """

    corner: Point = vector("a corner", unit="m")
    edge_u: Point = vector("from the corner along one side", unit="m", nonzero=True)
    edge_v: Point = vector("from the corner along the other side", unit="m", nonzero=True)
    two_sided: bool = flag("whether it shines to both sides", default=False)
    _normal: Any = derived_vector("unit normal, on the side that shines", lambda r: r.area_vector() / r.area)
    _area: Any = derived_number("area", lambda r: r.area)

    def area_vector(self) -> np.ndarray:
        """``edge_u x edge_v``, (3,) float64: as long as the area, m²."""
        return np.cross(self.edge_u, self.edge_v)

    @property
    def area(self) -> float:
        """Area of one side, m²."""
        return float(np.linalg.norm(self.area_vector()))

    def check(self) -> None:
        if not self.area > 1e-12 * np.linalg.norm(self.edge_u) * np.linalg.norm(self.edge_v):
            edges = f"edge_u {self.edge_u} and edge_v {self.edge_v}"
            raise SceneError(f"RectangleLight: {edges} are parallel; allowed: edges that span an area")

    def shape(self) -> Any | None:
        """The shining `Rectangle`, if `visible`."""
        from sightray.materials.emitter import Emitter
        from sightray.shapes.rectangle import Rectangle

        if not self.visible:
            return None
        material = Emitter(radiance=self.radiance, two_sided=self.two_sided)
        return Rectangle(corner=self.corner, edge_u=self.edge_u, edge_v=self.edge_v, material=material)


CORNER, EDGE_U, EDGE_V, TWO_SIDED, NORMAL, AREA = RectangleLight.offsets()[3:]


@implements(illuminate, RectangleLight)
def illuminate_from_rectangle(light: Table, p: Vec3, cell: i64, u: f64, v: f64) -> LightSample:
    s = place_in_grid(light, cell, u, v)
    q = vec3_at(light, CORNER) + vec3_at(light, EDGE_U) * s.x + vec3_at(light, EDGE_V) * s.y
    n = i64_at(light, GRID)
    radiant = vec3_at(light, RADIANCE) * (f64_at(light, AREA) / (n * n))
    return from_piece(p, q, vec3_at(light, NORMAL), radiant, i64_at(light, TWO_SIDED) != 0)


@implements(direction_density, RectangleLight)
def density_of_rectangle(light: Table, p: Vec3, l: Vec3, distance: f64) -> f64:  # noqa: E741
    return flat_density(light, vec3_at(light, NORMAL), f64_at(light, AREA), l, distance)
