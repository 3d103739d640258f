"""A medium that is the same everywhere: clear fog, stained glass, milk, marble."""

from __future__ import annotations

import math
from typing import Any

from sightray._jit import implements, kernel
from sightray.fields import Color, color, number
from sightray.mathlib.bands import as_reflectance
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, vec3_at
from sightray.mathlib.vec import Vec3, max4, mean4, vexp
from sightray.media.base import (
    Medium,
    MediumSample,
    PhaseSample,
    phase,
    sample_distance,
    sample_phase,
    transmittance,
)
from sightray.media.henyey_greenstein import henyey_greenstein, sample_henyey_greenstein
from sightray.samplers.base import Draws, pair


class HomogeneousMedium(Medium):
    """Absorbs and scatters light alike at every place, with the phase function of Henyey and Greenstein.

    Distances are chosen for one of the lanes of colour, taken at random by what it still weighs, and the answer is
    divided by the mean density of all (the balance heuristic), so that none of them can be missed by the others'
    choice. A medium that does not scatter is not sampled: its transmittance ``exp(-absorption * d)`` is exact.
    """

    absorption: Color = color("absorption coefficient", default=0.0, unit="1/m")
    scattering: Color = color("scattering coefficient", default=0.0, unit="1/m")
    g: float = number("mean cosine of scattering: 0 even, towards 1 forward", default=0.0, above=-1, below=1)


ABSORPTION, SCATTERING, G = HomogeneousMedium.offsets()


def clear_or_stained(absorption: Any) -> HomogeneousMedium | None:
    """The inside of a glass: a medium that absorbs, or None if it is clear."""
    return HomogeneousMedium(absorption=absorption) if any(absorption) else None


@kernel
def extinction(medium: Table, bands: Table) -> Vec3:
    """Absorption plus scattering, per metre, in the path's lanes."""
    return as_reflectance(bands, vec3_at(medium, ABSORPTION) + vec3_at(medium, SCATTERING))


@implements(transmittance, HomogeneousMedium)
def transmitted(medium: Table, o: Vec3, d: Vec3, t_max: f64, bands: Table, draws: Draws) -> Vec3:
    return vexp(extinction(medium, bands) * -t_max)


@implements(sample_distance, HomogeneousMedium)
def free_path(
    medium: Table, o: Vec3, d: Vec3, t_max: f64, beta: Vec3, bands: Table, draws: Draws
) -> MediumSample:
    scattering = as_reflectance(bands, vec3_at(medium, SCATTERING))
    total = extinction(medium, bands)
    if max4(scattering) <= 0.0 or not max4(beta) > 0.0:
        return MediumSample(t_max, vexp(total * -t_max), False)
    chances = beta / (4.0 * mean4(beta))
    u = pair(draws, 0)
    rate = chosen_lane(total, chances, u.v)
    t = -math.log(1.0 - u.u) / rate if rate > 0.0 else math.inf
    if t < t_max:
        left = vexp(total * -t)
        return MediumSample(t, scattering * left / (4.0 * mean4(chances * total * left)), True)
    left = vexp(total * -t_max)
    return MediumSample(t_max, left / (4.0 * mean4(chances * left)), False)


@kernel
def chosen_lane(v: Vec3, chances: Vec3, u: f64) -> f64:
    """One of the four lanes of v, by their chances."""
    if u < chances.x:
        return v.x
    if u < chances.x + chances.y:
        return v.y
    if u < chances.x + chances.y + chances.z or chances.w <= 0.0:
        return v.z if chances.z > 0.0 else (v.y if chances.y > 0.0 else v.x)
    return v.w


@implements(phase, HomogeneousMedium)
def phase_of_homogeneous(medium: Table, cosine: f64) -> f64:
    return henyey_greenstein(f64_at(medium, G), cosine)


@implements(sample_phase, HomogeneousMedium)
def sample_phase_of_homogeneous(medium: Table, d: Vec3, u: f64, v: f64) -> PhaseSample:
    return sample_henyey_greenstein(f64_at(medium, G), d, u, v)
