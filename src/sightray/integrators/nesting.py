"""In which medium a path is: what it has entered and not yet left."""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.accelerators.item import THIN
from sightray.integrators.shading import first_step
from sightray.materials.base import interior
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, i64_at, is_null, table_at
from sightray.mathlib.vec import Vec3, dot
from sightray.scene.world import AMID, MEDIUM, Point, find_closest_surface, point_of, thin_beam

MOST_CROSSINGS = 64  # of a line of sight, after which the eye counts as outside of what comes behind


class Nest(NamedTuple):
    """Media one inside the other, the innermost first; no table where there is nothing to meet.

    Four levels are remembered: ice in water in a glass in fog. Bodies must be closed and lie within one another or
    apart; where they overlap, the one that was entered last counts until any is left.
    """

    here: Table
    second: Table
    third: Table
    fourth: Table
    depth: i64


@kernel
def outside(world: Table) -> Nest:
    """Within no body: in what fills the scene."""
    around = table_at(world, MEDIUM)
    return Nest(around, around, around, around, 0)


@kernel
def around_eye(world: Table, o: Vec3, d: Vec3) -> Nest:
    """The bodies that the eye is in: those that the line of sight leaves without having entered, the innermost first."""
    around, nest = table_at(world, MEDIUM), outside(world)
    if i64_at(world, AMID) == 0:
        return nest
    t, entered = 0.0, 0
    for _ in range(MOST_CROSSINGS):
        hit = find_closest_surface(world, o, d, t, math.inf)
        if hit.item < 0 or nest.depth == 4:
            break
        point = point_of(world, hit, o, d, thin_beam())
        t = hit.t + first_step(math.nan, point.p, hit.t)
        inside = interior(point.material)
        if point.flags & THIN != 0 or is_null(inside):
            continue
        if dot(point.normal, d) < 0.0:
            entered += 1
        elif entered > 0:
            entered -= 1
        elif nest.depth == 0:
            nest = Nest(inside, around, around, around, 1)
        elif nest.depth == 1:
            nest = Nest(nest.here, inside, around, around, 2)
        elif nest.depth == 2:
            nest = Nest(nest.here, nest.second, inside, around, 3)
        else:
            nest = Nest(nest.here, nest.second, nest.third, inside, 4)
    return nest


@kernel
def crossing(world: Table, nest: Nest, point: Point, d: Vec3) -> Nest:
    """The nest behind a surface that a ray in direction d passes; thin sheets have nothing inside."""
    if point.flags & THIN != 0:
        return nest
    if dot(point.normal, d) < 0.0:
        return Nest(interior(point.material), nest.here, nest.second, nest.third, nest.depth + 1)
    around = table_at(world, MEDIUM)
    return Nest(nest.second, nest.third, nest.fourth, around, max(0, nest.depth - 1))
