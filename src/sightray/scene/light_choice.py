"""Which light to look at next."""

from __future__ import annotations

from typing import NamedTuple

from sightray._jit import kernel
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table
from sightray.mathlib.vec import Vec3
from sightray.scene.world import light_count


class Choice(NamedTuple):
    """A light, and how likely it was to be chosen."""

    light: i64  # its number; -1 where there is no light at all
    probability: f64


@kernel
def choose_light(world: Table, p: Vec3, n: Vec3, u: f64) -> Choice:
    """One of the lights, for a surface at p with unit normal n on the side that is seen, by a number u in [0, 1)."""
    count = light_count(world)
    if count == 0:
        return Choice(-1, 0.0)
    return Choice(min(count - 1, int(u * count)), 1.0 / count)


@kernel
def light_probability(world: Table, p: Vec3, n: Vec3, number: i64) -> f64:
    """Probability with which `choose_light`, for the same p and n, chooses light `number`."""
    return 1.0 / light_count(world)
