"""Distance."""

from __future__ import annotations

import math

from sightray._jit import implements
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, f64_at, f64_put, i64_at
from sightray.vision.layers.base import Layer, fill
from sightray.vision.record import PIXEL, T, record_at


class DistanceLayer(Layer):
    """Distance along the ray of sight, from where it starts: the eye, for cameras that have one."""

    label, unit, background, picture, letters = "distance", "m", math.inf, "heat", "Y"


@implements(fill, DistanceLayer)
def fill_distance(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    for i in range(count):
        record = record_at(records, i)
        f64_put(out, i64_at(record, PIXEL), f64_at(record, T))
