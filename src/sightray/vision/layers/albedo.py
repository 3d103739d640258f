"""Albedo."""

from __future__ import annotations

import math

from sightray._jit import implements
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, i64_at
from sightray.mathlib.vec import Vec3
from sightray.scene.query_kernels import put_triple
from sightray.vision.layers.base import Layer, fill
from sightray.vision.lighting import seen_at
from sightray.vision.record import PIXEL, is_met, record_at


class AlbedoLayer(Layer):
    """Share of light that the surface reflects diffusely, linear Rec. 709: pi times the material's diffuse answer."""

    label, columns, picture, letters = "albedo", 3, "color", "RGB"


@implements(fill, AlbedoLayer)
def fill_albedo(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    for i in range(count):
        record = record_at(records, i)
        color = Vec3(math.nan, math.nan, math.nan)
        if is_met(record):
            color = seen_at(frame, record).terms.diffuse * math.pi
        put_triple(out, i64_at(record, PIXEL), color)
