"""Normalised object coordinates."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import implements
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, f64_at, i64_at, table_at, vec3_at
from sightray.mathlib.transform import transform_point
from sightray.mathlib.vec import Vec3, grey
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


class ObjectCoordinatesLayer(Layer):
    """Normalised object coordinates (NOCS): the object's box in its own frame has a diagonal of 1 and its middle at 0.5.

    So all coordinates lie in [0, 1]. NaN for nothing, and for objects without end.

    Reference: H. Wang et al., "Normalized object coordinate space for category-level 6D object pose and size
    estimation", CVPR 2019.
    """

    label, frame, columns, picture, letters = "object_coordinates", "object", 3, "cube", "XYZ"
    detail, object_frames = POINT, True

    def pixelwise(self, frame: Any) -> bool:
        return not frame.view.blurred

    def needs(self, frame: Any) -> tuple[str, ...]:
        return ("position", "instance") if frame.view.blurred else ()

    def compute(self, frame: Any) -> np.ndarray:
        """Where each row has its own time: in the frame that the object has then."""
        inside, instance = inside_objects(frame), frame.values["instance"]
        boxes = {thing.index: thing for thing in frame.objects}
        for index in np.unique(instance[instance >= 0]):
            thing, own = boxes[index], instance == index
            diagonal = np.linalg.norm(thing.upper - thing.lower)
            with np.errstate(invalid="ignore"):
                inside[own] = (inside[own] - 0.5 * (thing.lower + thing.upper)) / diagonal + 0.5
            inside[own] = inside[own] if np.isfinite(diagonal) else np.nan
        return inside


@implements(fill, ObjectCoordinatesLayer)
def fill_object_coordinates(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    frames = table_at(frame, OBJECT_FRAMES)
    for i in range(count):
        record = record_at(records, i)
        p = Vec3(math.nan, math.nan, math.nan)
        if is_met(record):
            at = OBJECT_FRAME_WORDS * i64_at(record, ITEM)
            inside = transform_point(frames, at, vec3_at(record, POSITION)) - vec3_at(frames, at + 16)
            diagonal = f64_at(frames, at + 19)
            if diagonal < math.inf:
                p = inside / diagonal + grey(0.5)
        put_triple(out, i64_at(record, PIXEL), p)
