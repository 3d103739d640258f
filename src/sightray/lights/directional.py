"""The sun: light from infinitely far away."""

from __future__ import annotations

import math
from typing import Any

from sightray._jit import implements
from sightray.fields import Color, Point, color, derived_vector, vector
from sightray.lights.base import LightSample, LightSample8, illuminate, illuminate_eight
from sightray.lights.lit import _Lit
from sightray.mathlib.axes import unit
from sightray.mathlib.eights import F64x8, Vec3x8, splat8d, splat8v
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, vec3_at
from sightray.mathlib.vec import Vec3


class DirectionalLight(_Lit):
    """Parallel light that travels along `direction` and brings the same `irradiance` everywhere.

    `direction` is the way that the light goes, away from the sun, as in the glTF format; formats that state the way
    *towards* the light have the opposite sign. Its length does not matter.
    """

    direction: Point = vector("the way that the light travels", default=(0.0, -1.0, 0.0), nonzero=True)
    irradiance: Color = color("irradiance of a surface that faces the light", default=1.0, unit="W/m²")
    _to_light: Any = derived_vector("unit vector towards the light", lambda light: -unit(light.direction))
    _shown: Any = derived_vector("irradiance in RGB", lambda light: light.shown())

    def color_of_light(self) -> Any:
        return self.irradiance


_, _, TO_LIGHT, IRRADIANCE = DirectionalLight.offsets()[1:]


@implements(illuminate, DirectionalLight)
def illuminate_from_afar(light: Table, p: Vec3, cell: i64, u: f64, v: f64) -> LightSample:
    return LightSample(vec3_at(light, TO_LIGHT), math.inf, vec3_at(light, IRRADIANCE), 0.0)


@implements(illuminate_eight, DirectionalLight)
def illuminate_eight_from_afar(light: Table, p: Vec3x8, u: F64x8, v: F64x8) -> LightSample8:
    to_light, irradiance = splat8v(vec3_at(light, TO_LIGHT)), splat8v(vec3_at(light, IRRADIANCE))
    return LightSample8(to_light, splat8d(math.inf), irradiance, splat8d(0.0))
