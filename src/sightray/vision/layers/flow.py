"""Optical flow to the next picture."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

from sightray._jit import implements, kernel
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, advance, f64_at, i64_at, table_at, vec3_at
from sightray.mathlib.transform import transform_point, transform_vector
from sightray.mathlib.vec import Vec3
from sightray.vision.layers.base import Layer, fill
from sightray.vision.record import DIRECTION, NEXT, PIXEL, POINT, POSITION, PREVIOUS, X, Y, is_met, put_pair, record_at
from sightray.vision.view import PROJECTION, STILL, is_gone, moved_point


class _Flow(Layer):
    """What flows to another picture have in common.

    With X the point that is seen, T₀ and T₁ the poses of its object, and π₁ the other camera, the flow of pixel x is
    ``π₁(T₁ T₀⁻¹ X) - x``. Where the ray meets nothing, X is the point at infinity in its direction: under a rotation
    R of a pinhole camera the background moves by the homography K R K⁻¹. NaN where the point lies behind the other
    camera, or its object is not in the other scene. Flow does not ask whether the point is seen there; `occlusion` does.
    """

    unit, frame, columns, picture, letters = "pixels", "pixel", 2, "flow", "XY"
    detail = POINT
    toward: ClassVar[str] = "next"
    point_layer: ClassVar[str] = "next_position"

    def pixelwise(self, frame: Any) -> bool:
        return not frame.rolls(self.toward) and frame.motion(self.toward).linear

    def needs(self, frame: Any) -> tuple[str, ...]:
        return () if self.pixelwise(frame) else (self.point_layer,)

    def compute(self, frame: Any) -> np.ndarray:
        """For cameras whose projection is no matrix, and where each row has its own time."""
        if frame.rolls(self.toward):
            return frame.rolling(self.toward).pixels - pixel_centres(frame.width, frame.height)
        there = frame.other(self.toward).project(frame.values[self.point_layer])
        return there - pixel_centres(frame.width, frame.height)


def pixel_centres(width: int, height: int) -> np.ndarray:
    """Continuous coordinates of all pixel centres, (height, width, 2)."""
    return np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5), axis=-1)


@kernel
def fill_flow_to(motion: Table, records: Table, count: i64, out: Table) -> None:
    """Flow by the projection matrix of the other camera."""
    camera, still = advance(motion, PROJECTION), i64_at(motion, STILL) != 0
    for i in range(count):
        record = record_at(records, i)
        h = Vec3(0.0, 0.0, -1.0)
        if not is_met(record):
            h = transform_vector(camera, 0, vec3_at(record, DIRECTION))
        elif still:
            h = transform_point(camera, 0, vec3_at(record, POSITION))
        elif not is_gone(motion, record):
            h = transform_point(camera, 0, moved_point(motion, record))
        dx, dy = math.nan, math.nan
        if h.z > 0.0:
            dx, dy = h.x / h.z - f64_at(record, X), h.y / h.z - f64_at(record, Y)
        put_pair(out, i64_at(record, PIXEL), dx, dy)


class FlowLayer(_Flow):
    """Optical flow to the picture `next`: x to the right, y down; of the background, too."""

    label = "flow"


class BackwardFlowLayer(_Flow):
    """Optical flow to the picture `previous`: x to the right, y down; of the background, too."""

    label, toward, point_layer = "backward_flow", "previous", "previous_position"


@implements(fill, FlowLayer)
def fill_flow(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    fill_flow_to(table_at(frame, NEXT), records, count, out)


@implements(fill, BackwardFlowLayer)
def fill_backward_flow(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    fill_flow_to(table_at(frame, PREVIOUS), records, count, out)
