"""No structure at all: every ray asks every item. The oracle of all others."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import METHOD_SLOTS, implements
from sightray.accelerators.base import Accelerator, blocked, closest
from sightray.accelerators.item import ItemHit, better, intersect_item, item_at, occluded_item, worth
from sightray.mathlib.hit import is_hit
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Space, Table, i64_at, link, table_at
from sightray.mathlib.tally import TESTS, tally
from sightray.mathlib.vec import Vec3

ITEMS, COUNT = METHOD_SLOTS, METHOD_SLOTS + 1


class Brute(Accelerator):
    """Asks every item of the scene."""

    def build(self, space: Space, items: Table, lower: np.ndarray, upper: np.ndarray) -> Any:
        row = space.row(METHOD_SLOTS + 2)
        link(row, ITEMS, items)
        row.view(np.int64)[COUNT] = len(lower)
        return row


@implements(closest, Brute)
def closest_of_all(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> ItemHit:
    items = table_at(tree, ITEMS)
    best = ItemHit(math.inf, -1, -1, 0.0, 0.0)
    for index in range(i64_at(tree, COUNT)):
        tally(TESTS)
        hit = intersect_item(item_at(items, index), o, d, t_min, worth(best, t_max))
        found = ItemHit(hit.t, index, hit.prim, hit.u, hit.v)
        if is_hit(hit) and better(found, best):
            best = found
    return best


@implements(blocked, Brute)
def blocked_by_any(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> bool:
    items = table_at(tree, ITEMS)
    for index in range(i64_at(tree, COUNT)):
        if occluded_item(item_at(items, index), o, d, t_min, t_max):
            return True
    return False
