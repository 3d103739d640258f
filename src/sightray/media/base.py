"""The contract of participating media: what light meets between surfaces.

Along a way through a medium light is absorbed and scattered out. With the extinction coefficient s_t (per metre), the
sum of absorption and scattering, what is left after a way d is ``exp(-integral of s_t)`` (Bouguer, 1729; Beer, 1852).

A path tracer asks `sample_distance` whether and where, before `t_max`, light scatters; the answer's weight is the
transmittance (times the scattering coefficient, if it did) over the density of that choice. Shadow rays ask
`transmittance`. `phase` is the density of the cosine between the way in and the way out, per solid angle, and
`sample_phase` chooses a direction with exactly that density.

Media know their place in the world: `o` and `d` are in world space, and d has unit length.
"""

from __future__ import annotations

from typing import NamedTuple

from sightray._jit import method
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table
from sightray.mathlib.vec import Vec3
from sightray.registry import Member
from sightray.samplers.base import Draws


class MediumSample(NamedTuple):
    """How far light went."""

    t: f64  # where it scattered; t_max if it did not
    weight: Vec3
    scattered: bool


class PhaseSample(NamedTuple):
    """A direction that light goes on in."""

    direction: Vec3  # unit
    density: f64  # per solid angle


class Medium(Member, family="media"):
    """Base of all media."""


@method(0)
def transmittance(medium: Table, o: Vec3, d: Vec3, t_max: f64, bands: Table, draws: Draws) -> Vec3:
    """Share of light that is left after the way from o to o + t_max d; an unbiased estimate of it."""
    raise NotImplementedError


@method(1)
def sample_distance(
    medium: Table, o: Vec3, d: Vec3, t_max: f64, beta: Vec3, bands: Table, draws: Draws
) -> MediumSample:
    """Go from o along d until light scatters, at most to t_max; `beta`, what each lane weighs, says for which to choose."""
    raise NotImplementedError


@method(2)
def phase(medium: Table, cosine: f64) -> f64:
    """Phase function, per solid angle; `cosine` is 1 for light that goes straight on."""
    raise NotImplementedError


@method(3)
def sample_phase(medium: Table, d: Vec3, u: f64, v: f64) -> PhaseSample:
    """Choose where light that travelled along d goes on, with the density `phase`."""
    raise NotImplementedError
