"""The first surface that is one: boundaries of fog are only seen by what they contain."""

from __future__ import annotations

from sightray._jit import kernel
from sightray.accelerators.item import CLEAR, FLAGS, ItemHit, item_at
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, i64_at, table_at
from sightray.mathlib.vec import Vec3
from sightray.scene.world import FLAGS as WORLD_FLAGS
from sightray.scene.world import ITEMS, find_closest, is_blocked


@kernel
def closest_solid(world: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> ItemHit:
    """Nearest hit with a surface that light does not pass straight through."""
    hit = find_closest(world, o, d, t_min, t_max)
    if i64_at(world, WORLD_FLAGS) & CLEAR != 0:
        while hit.item >= 0 and i64_at(item_at(table_at(world, ITEMS), hit.item), FLAGS) & CLEAR != 0:
            hit = find_closest(world, o, d, hit.t, t_max)
    return hit


@kernel
def solid_between(world: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> bool:
    """Whether such a surface stands between t_min and t_max."""
    if i64_at(world, WORLD_FLAGS) & CLEAR != 0:
        return closest_solid(world, o, d, t_min, t_max).item >= 0
    return is_blocked(world, o, d, t_min, t_max)
