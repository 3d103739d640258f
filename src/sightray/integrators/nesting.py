"""In which medium a path is: what it has entered and not yet left."""

from __future__ import annotations

from typing import NamedTuple

from sightray._jit import kernel
from sightray.accelerators.item import THIN
from sightray.materials.base import interior
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, table_at
from sightray.mathlib.vec import Vec3, dot
from sightray.scene.world import MEDIUM, Point


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
def crossing(world: Table, nest: Nest, point: Point, d: Vec3) -> Nest:
    """The nest behind a surface that a ray in direction d passes; thin sheets have nothing inside."""
    if point.flags & THIN != 0:
        return nest
    if dot(point.normal, d) < 0.0:
        return Nest(interior(point.material), nest.here, nest.second, nest.third, nest.depth + 1)
    around = table_at(world, MEDIUM)
    return Nest(nest.second, nest.third, nest.fourth, around, max(0, nest.depth - 1))
