"""Geometric normal, in the world."""

from __future__ import annotations

import math

from sightray._jit import implements
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, i64_at, vec3_at
from sightray.mathlib.vec import Vec3
from sightray.scene.query_kernels import put_triple
from sightray.vision.layers.base import Layer, fill
from sightray.vision.record import FACE, NORMAL, PIXEL, is_met, record_at


class NormalLayer(Layer):
    """Geometric normal of the surface that is seen: unit length, pointing outward, in the world."""

    label, frame, columns, picture, letters = "normal", "world", 3, "direction", "XYZ"
    detail = FACE


@implements(fill, NormalLayer)
def fill_normal(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    for i in range(count):
        record = record_at(records, i)
        n = Vec3(math.nan, math.nan, math.nan)
        if is_met(record):
            n = vec3_at(record, NORMAL)
        put_triple(out, i64_at(record, PIXEL), n)
