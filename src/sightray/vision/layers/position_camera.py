"""Position in the camera's frame."""

from __future__ import annotations

import math

from sightray._jit import implements
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, i64_at, vec3_at
from sightray.mathlib.transform import transform_point
from sightray.mathlib.vec import Vec3
from sightray.scene.query_kernels import put_triple
from sightray.vision.layers.base import Layer, fill
from sightray.vision.record import CAMERA_FROM_WORLD, PIXEL, POINT, POSITION, is_met, record_at


class PositionCameraLayer(Layer):
    """Point of the surface that is seen, in the camera's frame: x right, y down, z forward."""

    label, unit, frame, columns, picture, letters = "position_camera", "m", "camera", 3, "box", "XYZ"
    detail = POINT


@implements(fill, PositionCameraLayer)
def fill_position_camera(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    for i in range(count):
        record = record_at(records, i)
        p = Vec3(math.nan, math.nan, math.nan)
        if is_met(record):
            p = transform_point(frame, CAMERA_FROM_WORLD, vec3_at(record, POSITION))
        put_triple(out, i64_at(record, PIXEL), p)
