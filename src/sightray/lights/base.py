"""The contract of lights.

A light is asked in `illuminate` how much of its light would arrive at a point if nothing stood between. Lights with
an area are cut into `cells`, one shadow ray each, so that shadows grow soft (R. Cook, T. Porter, L. Carpenter,
"Distributed ray tracing", SIGGRAPH 1984); lights without one have a single cell. Who sends but one ray asks for the
`WHOLE` light.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from sightray._jit import implements, kernel, method
from sightray.mathlib.bands import as_light
from sightray.mathlib.eight_paths import lane_at, load8v, put_lane, store8v
from sightray.mathlib.eights import F64x8, Vec3x8, load8d, store8d
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, f64_put, is_null, scratch
from sightray.mathlib.vec import Vec3, grey
from sightray.registry import Member

WHOLE = -1  # instead of a cell: the whole light at once


class LightSample(NamedTuple):
    """Light that one cell, or the whole light, sends to a point."""

    direction: Vec3  # unit, from the point to the light
    distance: f64  # metres; infinite for directional lights
    irradiance: Vec3  # on a surface that faces the light
    density: f64  # per solid angle, with which the cells together choose this direction; see `direction_density`


class LightSample8(NamedTuple):
    """`LightSample` for eight paths."""

    direction: Vec3x8
    distance: F64x8
    irradiance: Vec3x8
    density: F64x8


class LightBounds(NamedTuple):
    """Where a light stands, and where its light goes at most: what lights are chosen by when there are many.

    For n lights at once, all have one more dimension in front.
    """

    lower: np.ndarray  # (3,) box around it, metres, world
    upper: np.ndarray
    axis: np.ndarray  # (3,) unit: the middle of the cone of its normals
    normals: Any  # half-angle of that cone, radians; pi for what shines all around
    spread: float  # angle from the nearest normal beyond which there is no light, radians
    intensity: Any  # radiant intensity along a normal, mean of red, green and blue, W/sr


class Light(Member, family="lights"):
    """Base of all lights."""

    def bounds(self) -> LightBounds | None:
        """Where it stands and shines; None for lights without a place, and where nothing is known."""
        return None

    @property
    def infinite(self) -> bool:
        """Whether it is seen where rays meet nothing, in `sky`."""
        return False

    def shape(self) -> Any | None:
        """The emitting surface as a shape, for lights that can be seen; else None."""
        return None


class LightPolygon(NamedTuple):
    """A flat light with three or four corners, as a point sees it that is on the side which shines."""

    corners: i64  # 3: a, a + u, a + v. 4: a, a + u, a + u + v, a + v. 0 for all other lights
    a: Vec3
    u: Vec3
    v: Vec3
    radiance: Vec3  # RGB; 0 from behind


def around(center: Any, radius: float, intensity: Any) -> LightBounds:
    """Bounds of a light that shines to all sides from a ball around a point; `intensity` is a colour."""
    c = np.array(center, np.float64)
    up = np.array([0.0, 1.0, 0.0])
    return LightBounds(c - radius, c + radius, up, math.pi, 0.5 * math.pi, float(np.mean(intensity)))


def flat(corners: Any, normal: Any, two_sided: bool, radiant: Any) -> LightBounds:
    """Bounds of a flat light within the box of `corners`, (n, 3); `radiant` is its radiance, a colour, times its area."""
    half = math.pi if two_sided else 0.0
    lower, upper = np.min(corners, axis=0), np.max(corners, axis=0)
    return LightBounds(lower, upper, np.array(normal), half, 0.5 * math.pi, float(np.mean(radiant)))


@method(0)
def cells(light: Table) -> i64:
    """Number of shadow rays that the light asks for."""
    raise NotImplementedError


@method(1)
def illuminate(light: Table, p: Vec3, cell: i64, u: f64, v: f64) -> LightSample:
    """Light from one cell, or from the `WHOLE`; u, v in [0, 1) place the sample in it."""
    raise NotImplementedError


@method(2)
def direction_density(light: Table, p: Vec3, l: Vec3, distance: f64) -> f64:  # noqa: E741 - the textbook's letter
    """Density per solid angle with which `illuminate`, over all cells, chooses the direction `l` to a point of the light.

    It is 0 for lights that no other ray can meet by chance: those without extent, and those that are not visible.
    """
    raise NotImplementedError


@method(3)
def sky(light: Table, d: Vec3) -> Vec3:
    """Radiance, RGB, that a ray going along the unit vector d finds where it meets nothing; for `infinite` lights."""
    raise NotImplementedError


@method(4)
def polygon(light: Table, p: Vec3) -> LightPolygon:
    """The light as a polygon of even radiance, seen from p: what exact irradiance can be computed of."""
    raise NotImplementedError


@method(5)
def in_lanes(light: Table, bands: Table, rgb: Vec3) -> Vec3:
    """Light that the light sent, and that is known as RGB, at the wavelengths of a spectral path."""
    raise NotImplementedError


@method(6, form_of=(illuminate,))
def illuminate_eight(light: Table, p: Vec3x8, u: F64x8, v: F64x8) -> LightSample8:
    """`illuminate`, by the `WHOLE` light, for eight points."""
    raise NotImplementedError


@implements(illuminate_eight, Light)
def illuminate_one_by_one(light: Table, p: Vec3x8, u: F64x8, v: F64x8) -> LightSample8:
    words = scratch(104)
    store8v(words, 0, p)
    store8d(words, 24, u)
    store8d(words, 32, v)
    for k in range(8):
        found = illuminate(light, lane_at(words, k), WHOLE, f64_at(words, 24 + k), f64_at(words, 32 + k))
        put_lane(words, 40 + k, found.direction)
        put_lane(words, 64 + k, found.irradiance)
        f64_put(words, 88 + k, found.distance)
        f64_put(words, 96 + k, found.density)
    return LightSample8(load8v(words, 40), load8d(words, 88), load8v(words, 64), load8d(words, 96))


@method(7, form_of=(sky,))
def sky_eight(light: Table, d: Vec3x8) -> Vec3x8:
    """`sky` for eight rays."""
    raise NotImplementedError


@method(8, form_of=(direction_density,))
def density_eight(light: Table, p: Vec3x8, l: Vec3x8, distance: F64x8) -> F64x8:  # noqa: E741
    """`direction_density` for eight points."""
    raise NotImplementedError


@implements(sky_eight, Light)
def skies_one_by_one(light: Table, d: Vec3x8) -> Vec3x8:
    words = scratch(48)
    store8v(words, 0, d)
    for k in range(8):
        put_lane(words, 24 + k, sky(light, lane_at(words, k)))
    return load8v(words, 24)


@implements(density_eight, Light)
def densities_one_by_one(light: Table, p: Vec3x8, l: Vec3x8, distance: F64x8) -> F64x8:  # noqa: E741
    words = scratch(56)
    store8v(words, 0, p)
    store8v(words, 24, l)
    store8d(words, 48, distance)
    for k in range(8):
        f64_put(
            words, 48 + k, direction_density(light, lane_at(words, k), lane_at(words, 24 + k), f64_at(words, 48 + k))
        )
    return load8d(words, 48)


@implements(in_lanes, Light)
def up_sampled(light: Table, bands: Table, rgb: Vec3) -> Vec3:
    return as_light(bands, rgb)


@kernel
def light_in(bands: Table, light: Table, rgb: Vec3) -> Vec3:
    """Light that a light sent, in the path's lanes."""
    return rgb if is_null(bands) else in_lanes(light, bands, rgb)


@implements(polygon, Light)
def no_polygon(light: Table, p: Vec3) -> LightPolygon:
    return LightPolygon(0, grey(0.0), grey(0.0), grey(0.0), grey(0.0))


@implements(sky, Light)
def no_sky(light: Table, d: Vec3) -> Vec3:
    return grey(0.0)


@implements(direction_density, Light)
def never_met(light: Table, p: Vec3, l: Vec3, distance: f64) -> f64:  # noqa: E741
    return 0.0


@implements(cells, Light)
def one_cell(light: Table) -> i64:
    return 1
