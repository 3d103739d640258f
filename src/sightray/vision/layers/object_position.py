"""Position in the object's frame."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import implements
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, i64_at, table_at, vec3_at
from sightray.mathlib.transform import transform_point
from sightray.mathlib.vec import Vec3
from sightray.scene.query_kernels import put_triple
from sightray.vision.layers.base import Layer, fill
from sightray.vision.record import (
    ITEM,
    OBJECT_FRAME_WORDS,
    OBJECT_FRAMES,
    PIXEL,
    POINT,
    POSITION,
    is_met,
    record_at,
)
from sightray.vision.rolling import inside_objects


class ObjectPositionLayer(Layer):
    """Point of the surface that is seen, in its object's own frame: before the object's transform."""

    label, unit, frame, columns, picture, letters = "object_position", "m", "object", 3, "box", "XYZ"
    detail, object_frames = POINT, True

    def pixelwise(self, frame: Any) -> bool:
        return not frame.view.blurred

    def needs(self, frame: Any) -> tuple[str, ...]:
        return ("position", "instance") if frame.view.blurred else ()

    def compute(self, frame: Any) -> np.ndarray:
        """Where each row has its own time: in the frame that the object has then."""
        return inside_objects(frame)


@implements(fill, ObjectPositionLayer)
def fill_object_position(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    frames = table_at(frame, OBJECT_FRAMES)
    for i in range(count):
        record = record_at(records, i)
        p = Vec3(math.nan, math.nan, math.nan)
        if is_met(record):
            p = transform_point(frames, OBJECT_FRAME_WORDS * i64_at(record, ITEM), vec3_at(record, POSITION))
        put_triple(out, i64_at(record, PIXEL), p)
