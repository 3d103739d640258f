"""Position in the world."""

from __future__ import annotations

import math

from sightray._jit import implements
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, i64_at, vec3_at
from sightray.mathlib.vec import Vec3
from sightray.scene.query_kernels import put_triple
from sightray.vision.layers.base import Layer, fill
from sightray.vision.record import PIXEL, POINT, POSITION, is_met, record_at


class PositionLayer(Layer):
    """Point of the surface that is seen, in the world; of meshes, on the very triangle."""

    label, unit, frame, columns, picture, letters = "position", "m", "world", 3, "box", "XYZ"
    detail = POINT


@implements(fill, PositionLayer)
def fill_position(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    for i in range(count):
        record = record_at(records, i)
        p = vec3_at(record, POSITION) if is_met(record) else Vec3(math.nan, math.nan, math.nan)
        put_triple(out, i64_at(record, PIXEL), p)
