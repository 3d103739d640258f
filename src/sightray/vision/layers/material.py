"""Material."""

from __future__ import annotations

import numpy as np

from sightray._jit import implements
from sightray.bvh.bvh8 import int_at
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, i32_put, i64_at, table_at
from sightray.vision.layers.base import Layer, fill
from sightray.vision.record import ITEM, MATERIAL_OF_ITEM, PIXEL, is_met, record_at


class MaterialLayer(Layer):
    """Index in ``labels.materials`` of what the surface that is seen is made of, -1 for nothing."""

    label, dtype, background, picture, letters = "material", np.int32, -1, "categories", "Y"


@implements(fill, MaterialLayer)
def fill_material(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    numbers = table_at(frame, MATERIAL_OF_ITEM)
    for i in range(count):
        record = record_at(records, i)
        number = int_at(numbers, i64_at(record, ITEM)) if is_met(record) else -1
        i32_put(out, i64_at(record, PIXEL), number)
