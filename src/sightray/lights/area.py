"""What the lights with an area have in common: radiance, a grid of cells, a shape that is seen.

The irradiance that a small piece of area A sends to a surface which faces it at distance r is ``L A cos / r²``, with
the cosine between the light's normal and the way to the receiver. A jittered point in each of the grid's cells gives
an unbiased sum (R. Cook, "Stochastic sampling in computer graphics", ACM TOG 5(1), 1986).
"""

from __future__ import annotations

import math
from typing import Any

from sightray._jit import implements, kernel
from sightray.fields import Color, color, derived_vector, flag, integer
from sightray.lights.base import WHOLE, LightSample, LightSample8, cells
from sightray.lights.lit import _Lit
from sightray.mathlib.eight_paths import grey8
from sightray.mathlib.eights import Vec3x8, abs8d, dot8, select8d, select8v, splat8d, splat8v, sqrt8d, vmax8d
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, i64_at, vec3_at
from sightray.mathlib.vec import Vec3, dot, grey

MAX_GRID = 64


class _AreaLight(_Lit):
    """Base of lights with an area: `radiance` in all directions from every point, cut into `grid` x `grid` cells."""

    radiance: Color = color("radiance that it gives off", default=1.0, unit="W/(m² sr)")
    grid: int = integer("cells along a side: grid x grid shadow rays", default=4, at_least=1, at_most=MAX_GRID)
    visible: bool = flag("whether rays of sight see it", default=True)
    _shown: Any = derived_vector("radiance in RGB", lambda light: light.shown())


_, GRID, VISIBLE, RADIANCE = _AreaLight.offsets()[1:]


@implements(cells, _AreaLight)
def square_of_cells(light: Table) -> i64:
    return i64_at(light, GRID) * i64_at(light, GRID)


@kernel
def cut(n: i64, cell: i64) -> i64:
    """Into how many cells a side of the light is cut: n, or 1 if it is asked as a whole."""
    return 1 if cell == WHOLE else n


@kernel
def place_in_cells(n: i64, cell: i64, u: f64, v: f64) -> Vec3:
    """The point (u, v) of one of n x n cells, as x and y in the unit square."""
    if n == 1:
        return Vec3(u, v, 0.0, 0.0)
    return Vec3((cell % n + u) / n, (cell // n + v) / n, 0.0, 0.0)


@kernel
def from_piece(light: Table, p: Vec3, q: Vec3, normal: Vec3, area: f64, parts: i64, two_sided: bool) -> LightSample:
    """Light at `p` from one of the `parts` of a flat light, by a sample at `q`."""
    to_light = q - p
    r2 = dot(to_light, to_light)
    if not r2 > 0.0:
        return LightSample(-normal, 0.0, grey(0.0), 0.0)
    r = math.sqrt(r2)
    to_light = to_light / r
    cosine = -dot(to_light, normal)
    if two_sided:
        cosine = abs(cosine)
    seen = max(cosine, 0.0) * area / r2  # solid angle of the light, if all of it were like this
    density = 1.0 / seen if seen > 0.0 and i64_at(light, VISIBLE) != 0 else 0.0
    return LightSample(to_light, r, vec3_at(light, RADIANCE) * (seen / parts), density)


@kernel
def from_pieces8(light: Table, to_light: Vec3x8, normal: Vec3, area: f64, two_sided: bool) -> LightSample8:
    """`from_piece`, by the whole light, for eight ways from a point to one of the light's."""
    r2, facing = dot8(to_light, to_light), splat8v(normal)
    apart = r2 > 0.0
    r = sqrt8d(r2)
    way = select8v(apart, to_light * (1.0 / r), -facing)
    cosine = -dot8(way, facing)
    if two_sided:
        cosine = abs8d(cosine)
    lit = (cosine > 0.0) & apart
    seen = vmax8d(cosine, splat8d(0.0)) * area / r2
    shown = 1.0 if i64_at(light, VISIBLE) != 0 else 0.0
    irradiance = select8v(lit, splat8v(vec3_at(light, RADIANCE)) * seen, grey8(0.0))
    return LightSample8(way, r, irradiance, select8d(lit, shown / seen, splat8d(0.0)))


@kernel
def flat_density(light: Table, normal: Vec3, area: f64, l: Vec3, distance: f64) -> f64:  # noqa: E741
    """Density per solid angle of a uniformly chosen point of a flat light: distance² / (cos area)."""
    cosine = abs(dot(l, normal))
    if i64_at(light, VISIBLE) == 0 or cosine <= 0.0:
        return 0.0
    return distance * distance / (cosine * area)
