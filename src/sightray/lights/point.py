"""A light without extent."""

from __future__ import annotations

from typing import Any

from sightray._jit import implements
from sightray.errors import SceneError
from sightray.fields import Color, Point, color, derived_vector, vector
from sightray.lights.base import LightBounds, LightSample, LightSample8, around, illuminate, illuminate_eight
from sightray.lights.lit import _Lit
from sightray.mathlib.eights import F64x8, Vec3x8, dot8, splat8d, splat8v, sqrt8d
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, vec3_at
from sightray.mathlib.vec import Vec3, length


class PointLight(_Lit):
    """Sends `intensity` equally in all directions.

    What arrives at distance r is ``intensity / (c + l r + q r²)``: the inverse square law by default, or the constant,
    linear and quadratic attenuation of older graphics systems.
    """

    position: Point = vector("where it stands", unit="m")
    intensity: Color = color("radiant intensity", default=1.0, unit="W/sr")
    attenuation: Point = vector("constant, linear and quadratic coefficient", default=(0.0, 0.0, 1.0))
    _shown: Any = derived_vector("intensity in RGB", lambda light: light.shown())

    def color_of_light(self) -> Any:
        return self.intensity

    def check(self) -> None:
        if min(self.attenuation) < 0 or max(self.attenuation) <= 0:
            raise SceneError(f"PointLight.attenuation: got {self.attenuation}; allowed: numbers >= 0, not all zero")

    def bounds(self) -> LightBounds:
        return around(self.position, 0.0, self.intensity)


POSITION, _, ATTENUATION, INTENSITY = PointLight.offsets()[1:]


@implements(illuminate, PointLight)
def illuminate_from_point(light: Table, p: Vec3, cell: i64, u: f64, v: f64) -> LightSample:
    to_light = vec3_at(light, POSITION) - p
    r = length(to_light)
    c = vec3_at(light, ATTENUATION)
    return LightSample(to_light / r, r, vec3_at(light, INTENSITY) / (c.x + c.y * r + c.z * r * r), 0.0)


@implements(illuminate_eight, PointLight)
def illuminate_eight_from_point(light: Table, p: Vec3x8, u: F64x8, v: F64x8) -> LightSample8:
    to_light, c = splat8v(vec3_at(light, POSITION)) - p, vec3_at(light, ATTENUATION)
    r2 = dot8(to_light, to_light)
    r = sqrt8d(r2)
    share = 1.0 / (c.x + c.y * r + c.z * r2)
    return LightSample8(to_light * (1.0 / r), r, splat8v(vec3_at(light, INTENSITY)) * share, splat8d(0.0))
