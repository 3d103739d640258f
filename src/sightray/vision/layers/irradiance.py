"""Irradiance."""

from __future__ import annotations

import math

from sightray._jit import implements
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, i64_at
from sightray.mathlib.vec import Vec3
from sightray.scene.query_kernels import put_triple
from sightray.vision.layers.base import Layer, fill
from sightray.vision.lighting import irradiance_at, seen_at
from sightray.vision.record import PIXEL, is_met, record_at


class IrradianceLayer(Layer):
    """Light that arrives at the surface straight from all lights, with shadows, per area; linear Rec. 709.

    Lights with an area are asked at the same points as in a picture of one sample, so that `residual` holds no noise.
    """

    label, unit, columns, picture, letters = "irradiance", "W/m²", 3, "color", "RGB"


@implements(fill, IrradianceLayer)
def fill_irradiance(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    for i in range(count):
        record = record_at(records, i)
        color = Vec3(math.nan, math.nan, math.nan)
        if is_met(record):
            color = irradiance_at(frame, record, seen_at(frame, record))
        put_triple(out, i64_at(record, PIXEL), color)
