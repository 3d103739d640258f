"""Geometric normal, in the camera's frame."""

from __future__ import annotations

import math

from sightray._jit import implements
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, i64_at, vec3_at
from sightray.mathlib.transform import transform_vector
from sightray.mathlib.vec import Vec3
from sightray.scene.query_kernels import put_triple
from sightray.vision.layers.base import Layer, fill
from sightray.vision.record import CAMERA_FROM_WORLD, FACE, NORMAL, PIXEL, is_met, record_at


class NormalCameraLayer(Layer):
    """Geometric normal of the surface that is seen: unit length, pointing outward,
    in the camera's frame (x right, y down, z forward).
    """

    label, frame, columns, picture, letters = "normal_camera", "camera", 3, "direction", "XYZ"
    detail = FACE


@implements(fill, NormalCameraLayer)
def fill_normal_camera(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    for i in range(count):
        record = record_at(records, i)
        n = Vec3(math.nan, math.nan, math.nan)
        if is_met(record):
            n = transform_vector(frame, CAMERA_FROM_WORLD, vec3_at(record, NORMAL))
        put_triple(out, i64_at(record, PIXEL), n)
