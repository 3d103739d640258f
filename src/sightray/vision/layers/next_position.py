"""Where the points that are seen are in another picture's scene."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

from sightray._jit import implements, kernel
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, i64_at, table_at, vec3_at
from sightray.mathlib.vec import Vec3
from sightray.scene.query_kernels import put_triple
from sightray.vision.layers.base import Layer, fill
from sightray.vision.record import DIRECTION, NEXT, ORIGIN, PIXEL, POINT, PREVIOUS, is_met, record_at
from sightray.vision.rolling import FOLLOWED
from sightray.vision.view import FAR, is_gone, moved_point


class _OtherPosition(Layer):
    """What both have in common: the background's points are taken to be 1e15 m away, which is infinity in doubles."""

    unit, frame, columns, picture, letters = "m", "world", 3, "box", "XYZ"
    detail = POINT
    toward: ClassVar[str] = "next"

    def pixelwise(self, frame: Any) -> bool:
        return not frame.rolls(self.toward)

    def needs(self, frame: Any) -> tuple[str, ...]:
        if frame.rolls(self.toward):
            return FOLLOWED
        frame.motion(self.toward)
        return ()

    def compute(self, frame: Any) -> np.ndarray:
        """Where each row has its own time: the point at that of the row that sees it there."""
        return frame.rolling(self.toward).points


class NextPositionLayer(_OtherPosition):
    """Where the point that is seen is in the scene of `next`, in the world; NaN if its object is not there."""

    label = "next_position"


class PreviousPositionLayer(_OtherPosition):
    """Where the point that is seen was in the scene of `previous`, in the world; NaN if its object is not there."""

    label, toward = "previous_position", "previous"


@kernel
def fill_position_in(motion: Table, records: Table, count: i64, out: Table) -> None:
    """Points after their motion; of the background, far away."""
    for i in range(count):
        record = record_at(records, i)
        p = vec3_at(record, ORIGIN) + vec3_at(record, DIRECTION) * FAR
        if is_met(record):
            p = Vec3(math.nan, math.nan, math.nan) if is_gone(motion, record) else moved_point(motion, record)
        put_triple(out, i64_at(record, PIXEL), p)


@implements(fill, NextPositionLayer)
def fill_next_position(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    fill_position_in(table_at(frame, NEXT), records, count, out)


@implements(fill, PreviousPositionLayer)
def fill_previous_position(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    fill_position_in(table_at(frame, PREVIOUS), records, count, out)
