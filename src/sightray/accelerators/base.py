"""The contract of accelerators: structures that find which items a ray meets without asking each one."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray._jit import method
from sightray.accelerators.item import ItemHit
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Space, Table
from sightray.mathlib.vec import Vec3
from sightray.registry import Member


class Accelerator(Member, family="accelerators"):
    """Base of all accelerators over the items of a scene."""

    def build(self, space: Space, items: Table, lower: np.ndarray, upper: np.ndarray) -> Any:
        """Row of the structure over items with these world bounds, each (n, 3) float64; unbounded ones are infinite."""
        raise NotImplementedError


@method(0)
def closest(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> ItemHit:
    """Nearest hit of the ray o + t d with any item, t_min < t < t_max."""
    raise NotImplementedError


@method(1)
def blocked(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> bool:
    """Whether any item stands between t_min and t_max."""
    raise NotImplementedError
