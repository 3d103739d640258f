"""Ray direction."""

from __future__ import annotations

from sightray._jit import implements
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, i64_at, vec3_at
from sightray.scene.query_kernels import put_triple
from sightray.vision.layers.base import Layer, fill
from sightray.vision.record import DIRECTION, PIXEL, record_at


class RayDirectionLayer(Layer):
    """Direction of the ray of sight through the pixel's centre: unit length, also where it meets nothing."""

    label, unit, frame, columns, picture, letters = "ray_direction", "", "world", 3, "direction", "XYZ"


@implements(fill, RayDirectionLayer)
def fill_ray_direction(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    for i in range(count):
        record = record_at(records, i)
        put_triple(out, i64_at(record, PIXEL), vec3_at(record, DIRECTION))
