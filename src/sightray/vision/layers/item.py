"""Item."""

from __future__ import annotations

import numpy as np

from sightray._jit import implements
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, i32_put, i64_at
from sightray.vision.layers.base import Layer, fill
from sightray.vision.record import ITEM, PIXEL, record_at


class ItemLayer(Layer):
    """Which shape at which place is seen, after groups were opened and instances followed; -1 for nothing."""

    label, dtype, background, picture, letters = "item", np.int32, -1, "numbers", "Y"


@implements(fill, ItemLayer)
def fill_item(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    for i in range(count):
        record = record_at(records, i)
        i32_put(out, i64_at(record, PIXEL), i64_at(record, ITEM))
