"""A point light that shines into a cone."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import implements, kernel
from sightray.errors import SceneError
from sightray.fields import Color, Point, color, derived_number, derived_vector, number, vector
from sightray.lights.base import LightBounds, LightSample, LightSample8, illuminate, illuminate_eight
from sightray.lights.lit import _Lit
from sightray.mathlib.axes import unit
from sightray.mathlib.eight_paths import grey8
from sightray.mathlib.eights import F64x8, Vec3x8, dot8, select8d, select8v, splat8d, splat8v, sqrt8d
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, vec3_at
from sightray.mathlib.vec import Vec3, dot, grey, length


def _half(spot: Any) -> float:
    return math.radians(spot.angle) / 2


class SpotLight(_Lit):
    """Stands at `position` and shines towards `target`, into a cone whose full opening angle is `angle`.

    Within ``1 - blend`` of the half-angle it shines with full `intensity`; from there to the cone's surface it fades
    as the smoothstep 3t² - 2t³ of the cosine t between the two cones. Over distance it weakens as a `PointLight`
    does, by ``1 / (c + l r + q r²)``.

    Reference: M. Pharr, W. Jakob, G. Humphreys, Physically Based Rendering, 4th ed. 2023, section 12.2.1.
    """

    position: Point = vector("where it stands", unit="m")
    target: Point = vector("a point on the axis of the cone", unit="m")
    intensity: Color = color("radiant intensity on the axis", default=1.0, unit="W/sr")
    angle: float = number("full opening angle of the cone", default=45.0, above=0, at_most=180, unit="degrees")
    blend: float = number("share of the half-angle over which light fades", default=0.15, at_least=0, at_most=1)
    attenuation: Point = vector("constant, linear and quadratic coefficient", default=(0.0, 0.0, 1.0))
    _axis: Any = derived_vector("unit vector from the light to the target", lambda spot: spot.axis())
    _cos_outer: Any = derived_number("where light ends", lambda spot: math.cos(_half(spot)))
    _cos_inner: Any = derived_number("where it starts to fade", lambda spot: math.cos(_half(spot) * (1 - spot.blend)))
    _shown: Any = derived_vector("intensity in RGB", lambda light: light.shown())

    def color_of_light(self) -> Any:
        return self.intensity

    def axis(self) -> np.ndarray:
        """Unit vector from the light towards its target, (3,) float64."""
        return unit(np.subtract(self.target, self.position))

    def check(self) -> None:
        if self.position == self.target:
            raise SceneError(f"SpotLight: position and target are the same point {self.position}; allowed: two points")
        if min(self.attenuation) < 0 or max(self.attenuation) <= 0:
            raise SceneError(f"SpotLight.attenuation: got {self.attenuation}; allowed: numbers >= 0, not all zero")

    def bounds(self) -> LightBounds:
        at = np.array(self.position)
        return LightBounds(at, at, self.axis(), _half(self), 1e-3, float(np.mean(self.intensity)))


POSITION, _, _, _, _, ATTENUATION, AXIS, COS_OUTER, COS_INNER, INTENSITY = SpotLight.offsets()[1:]


@kernel
def falloff(cosine: f64, outer: f64, inner: f64) -> f64:
    """1 within the inner cone, 0 outside the outer one, smooth between; the cones may coincide."""
    if cosine >= inner:
        return 1.0
    if cosine <= outer:
        return 0.0
    t = (cosine - outer) / (inner - outer)
    return t * t * (3.0 - 2.0 * t)


@implements(illuminate, SpotLight)
def illuminate_from_spot(light: Table, p: Vec3, cell: i64, u: f64, v: f64) -> LightSample:
    to_light = vec3_at(light, POSITION) - p
    r = length(to_light)
    axis = vec3_at(light, AXIS)
    if not r > 0.0:
        return LightSample(-axis, 0.0, grey(0.0), 0.0)
    to_light = to_light / r
    c = vec3_at(light, ATTENUATION)
    share = falloff(-dot(to_light, axis), f64_at(light, COS_OUTER), f64_at(light, COS_INNER))
    return LightSample(to_light, r, vec3_at(light, INTENSITY) * (share / (c.x + c.y * r + c.z * r * r)), 0.0)


@implements(illuminate_eight, SpotLight)
def illuminate_eight_from_spot(light: Table, p: Vec3x8, u: F64x8, v: F64x8) -> LightSample8:
    to_light, axis = splat8v(vec3_at(light, POSITION)) - p, splat8v(vec3_at(light, AXIS))
    c, outer, inner = vec3_at(light, ATTENUATION), f64_at(light, COS_OUTER), f64_at(light, COS_INNER)
    r2 = dot8(to_light, to_light)
    r, apart = sqrt8d(r2), r2 > 0.0
    way = select8v(apart, to_light * (1.0 / r), -axis)
    cosine = -dot8(way, axis)
    t = (cosine - outer) * (1.0 / (inner - outer))
    share = select8d(cosine > outer, t * t * (3.0 - 2.0 * t), splat8d(0.0))
    share = select8d(cosine >= inner, splat8d(1.0), share) / (c.x + c.y * r + c.z * r2)
    light_of = select8v(apart, splat8v(vec3_at(light, INTENSITY)) * share, grey8(0.0))
    return LightSample8(way, r, light_of, splat8d(0.0))
