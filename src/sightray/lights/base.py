"""The contract of lights.

A light is asked in `illuminate` how much of its light would arrive at a point if nothing stood between. Lights with
an area are cut into `cells`, one shadow ray each, so that shadows grow soft (R. Cook, T. Porter, L. Carpenter,
"Distributed ray tracing", SIGGRAPH 1984); lights without one have a single cell.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from sightray._jit import implements, method
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table
from sightray.mathlib.vec import Vec3, grey
from sightray.registry import Member


class LightSample(NamedTuple):
    """Light that one cell sends to a point."""

    direction: Vec3  # unit, from the point to the light
    distance: f64  # metres; infinite for directional lights
    irradiance: Vec3  # on a surface that faces the light


class Light(Member, family="lights"):
    """Base of all lights."""

    @property
    def infinite(self) -> bool:
        """Whether it is seen where rays meet nothing, in `sky`."""
        return False

    def shape(self) -> Any | None:
        """The emitting surface as a shape, for lights that can be seen; else None."""
        return None


@method(0)
def cells(light: Table) -> i64:
    """Number of shadow rays that the light asks for."""
    raise NotImplementedError


@method(1)
def illuminate(light: Table, p: Vec3, cell: i64, u: f64, v: f64) -> LightSample:
    """Light from one cell; u, v in [0, 1) place the sample in the cell."""
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


@implements(sky, Light)
def no_sky(light: Table, d: Vec3) -> Vec3:
    return grey(0.0)


@implements(direction_density, Light)
def never_met(light: Table, p: Vec3, l: Vec3, distance: f64) -> f64:  # noqa: E741
    return 0.0


@implements(cells, Light)
def one_cell(light: Table) -> i64:
    return 1
