"""Instance."""

from __future__ import annotations

import numpy as np

from sightray._jit import implements
from sightray.accelerators.item import OBJECT, item_at
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, i32_put, i64_at, table_at
from sightray.scene.world import ITEMS as WORLD_ITEMS
from sightray.vision.layers.base import Layer, fill
from sightray.vision.record import ITEM, PIXEL, WORLD, is_met, record_at


class InstanceLayer(Layer):
    """Index in ``scene.objects`` of what is seen, -1 for nothing; a `Group` is one instance, a visible light another."""

    label, dtype, background, picture, letters = "instance", np.int32, -1, "categories", "Y"


@implements(fill, InstanceLayer)
def fill_instance(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    items = table_at(table_at(frame, WORLD), WORLD_ITEMS)
    for i in range(count):
        record = record_at(records, i)
        number = -1
        if is_met(record):
            number = i64_at(item_at(items, i64_at(record, ITEM)), OBJECT)
        i32_put(out, i64_at(record, PIXEL), number)
