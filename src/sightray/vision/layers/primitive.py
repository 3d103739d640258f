"""Primitive."""

from __future__ import annotations

import numpy as np

from sightray._jit import implements
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, i32_put, i64_at
from sightray.vision.layers.base import Layer, fill
from sightray.vision.record import PIXEL, PRIM, is_met, record_at


class PrimitiveLayer(Layer):
    """Row of ``faces`` of the triangle that is seen, or part of another shape; -1 for nothing."""

    label, dtype, background, picture, letters = "primitive", np.int32, -1, "numbers", "Y"


@implements(fill, PrimitiveLayer)
def fill_primitive(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    for i in range(count):
        record = record_at(records, i)
        i32_put(out, i64_at(record, PIXEL), i64_at(record, PRIM) if is_met(record) else -1)
