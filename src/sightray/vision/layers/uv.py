"""Texture coordinates."""

from __future__ import annotations

import math

from sightray._jit import implements
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, f64_at, i64_at
from sightray.vision.layers.base import Layer, fill
from sightray.vision.record import PIXEL, SURFACE, TEXTURE_U, TEXTURE_V, is_met, put_pair, record_at


class UvLayer(Layer):
    """Texture coordinates u, v of the point that is seen, as its shape defines them; v runs upward."""

    label, frame, columns, picture, letters = "uv", "object", 2, "square", "UV"
    detail = SURFACE


@implements(fill, UvLayer)
def fill_uv(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    for i in range(count):
        record = record_at(records, i)
        u, v = math.nan, math.nan
        if is_met(record):
            u, v = f64_at(record, TEXTURE_U), f64_at(record, TEXTURE_V)
        put_pair(out, i64_at(record, PIXEL), u, v)
