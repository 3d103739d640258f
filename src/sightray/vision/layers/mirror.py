"""Mirror mask."""

from __future__ import annotations

import numpy as np

from sightray._jit import implements
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, i32_put, i64_at
from sightray.mathlib.vec import max3
from sightray.vision.layers.base import Layer, fill
from sightray.vision.lighting import seen_at
from sightray.vision.record import PIXEL, is_met, record_at


class MirrorLayer(Layer):
    """1 where the surface reflects like a mirror and lets nothing through, 0 elsewhere."""

    label, dtype, background, picture, letters = "mirror", np.int32, 0, "mask", "Y"


@implements(fill, MirrorLayer)
def fill_mirror(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    for i in range(count):
        record = record_at(records, i)
        found = 0
        if is_met(record):
            terms = seen_at(frame, record).terms
            if max3(terms.mirror) > 0.0 and not max3(terms.transmission) > 0.0:
                found = 1
        i32_put(out, i64_at(record, PIXEL), found)
