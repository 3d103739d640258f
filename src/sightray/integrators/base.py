"""The contract of integrators: the light that comes along one ray of sight."""

from __future__ import annotations

from typing import NamedTuple

from sightray._jit import method
from sightray.cameras.base import Ray
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table
from sightray.mathlib.vec import Vec3
from sightray.registry import Member
from sightray.samplers.base import Draws


class Radiance(NamedTuple):
    """What an integrator found out about a ray of sight."""

    color: Vec3
    rays: i64  # how many rays that took


class Integrator(Member, family="integrators"):
    """Base of all integrators."""


@method(0)
def radiance(integrator: Table, world: Table, ray: Ray, draws: Draws) -> Radiance:
    """Light along a ray of sight; `draws` gives its random numbers."""
    raise NotImplementedError
