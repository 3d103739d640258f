"""Disparity."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import implements
from sightray.errors import SceneError
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, f64_at, f64_put, i64_at, table_at, vec3_at
from sightray.mathlib.transform import transform_point, transform_vector
from sightray.mathlib.vec import Vec3
from sightray.vision.layers.base import Layer, fill
from sightray.vision.record import DIRECTION, PIXEL, POINT, STEREO, X, is_met, record_at
from sightray.vision.view import PROJECTION, SIDE, is_gone, is_linear, moved_point

EXACT = 1e-9  # by which rectified cameras may differ, in radians and in parts of the focal length


class DisparityLayer(Layer):
    """Disparity to the other picture of a rectified pair, `stereo`: x in the left picture minus x in the right one.

    Where the two cameras share their intrinsics, f B / z with baseline B; it is the same number in both pictures, and 0
    at infinity.

    Raises
    ------
    SceneError
        If the two cameras are not rectified: pinholes whose axes, focal lengths and cy agree, side by side.
    """

    label, unit, frame, background, picture, letters = "disparity", "pixels", "pixel", 0.0, "share_of_most", "Y"
    detail = POINT

    def needs(self, frame: Any) -> tuple[str, ...]:
        motion = frame.motion("stereo")
        a, b = motion.before, motion.after
        if not (is_linear(a.camera) and is_linear(b.camera)):
            raise SceneError("label: stereo: disparity needs two pinhole cameras")
        relative = a.camera_from_world @ b.world_from_camera
        turned = np.abs(relative[:3, :3] - np.eye(3)).max()
        aside = np.abs(relative[1:3, 3]).max() / max(np.linalg.norm(relative[:3, 3]), 1e-300)
        lens = np.abs((a.intrinsics - b.intrinsics)[[0, 1, 1], [0, 1, 2]]).max() / a.intrinsics[0, 0]
        if max(turned, aside, lens) > EXACT:
            raise SceneError(
                f"label: stereo: the cameras are not rectified (turned by {turned:.2g}, displaced from the x axis by "
                f"{aside:.2g}, intrinsics off by {lens:.2g}); allowed: side by side, with the same axes"
            )
        return ()


@implements(fill, DisparityLayer)
def fill_disparity(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    motion = table_at(frame, STEREO)
    side = f64_at(motion, SIDE)
    for i in range(count):
        record = record_at(records, i)
        h = Vec3(0.0, 0.0, -1.0)
        if not is_met(record):
            h = transform_vector(motion, PROJECTION, vec3_at(record, DIRECTION))
        elif not is_gone(motion, record):
            h = transform_point(motion, PROJECTION, moved_point(motion, record))
        disparity = math.nan
        if h.z > 0.0:
            disparity = side * (f64_at(record, X) - h.x / h.z)
        f64_put(out, i64_at(record, PIXEL), disparity)
