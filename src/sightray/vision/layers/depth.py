"""Depth."""

from __future__ import annotations

import math

from sightray._jit import implements
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, f64_put, i64_at
from sightray.mathlib.transform import transform_point
from sightray.vision.layers.base import Layer, fill
from sightray.vision.record import CAMERA_FROM_WORLD, PIXEL, is_met, point_on_ray, record_at


class DepthLayer(Layer):
    """Depth: z in the camera's frame, along the line of sight of the camera, not of the pixel; infinite for nothing."""

    label, unit, frame, background, picture, letters = "depth", "m", "camera", math.inf, "heat", "Y"


@implements(fill, DepthLayer)
def fill_depth(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    for i in range(count):
        record = record_at(records, i)
        z = math.inf
        if is_met(record):
            z = transform_point(frame, CAMERA_FROM_WORLD, point_on_ray(record)).z
        f64_put(out, i64_at(record, PIXEL), z)
