"""The default accelerator: an 8-wide bounding volume hierarchy over the items."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray._jit import implements
from sightray.accelerators.base import Accelerator, blocked, closest
from sightray.accelerators.items import any_item, closest_item, pack_items
from sightray.mathlib.table import Space, Table


class Bvh(Accelerator):
    """8-wide bounding volume hierarchy, built by binned surface area heuristic (I. Wald, 2007)."""

    def build(self, space: Space, items: Table, lower: np.ndarray, upper: np.ndarray) -> Any:
        return pack_items(space, items, lower, upper)


implements(closest, Bvh)(closest_item)
implements(blocked, Bvh)(any_item)
