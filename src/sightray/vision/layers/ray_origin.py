"""Ray origin."""

from __future__ import annotations

from sightray._jit import implements
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, i64_at, vec3_at
from sightray.scene.query_kernels import put_triple
from sightray.vision.layers.base import Layer, fill
from sightray.vision.record import ORIGIN, PIXEL, record_at


class RayOriginLayer(Layer):
    """Where the ray of sight through the pixel's centre starts: the eye, for cameras that have one."""

    label, unit, frame, columns, picture, letters = "ray_origin", "m", "world", 3, "box", "XYZ"


@implements(fill, RayOriginLayer)
def fill_ray_origin(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    for i in range(count):
        record = record_at(records, i)
        put_triple(out, i64_at(record, PIXEL), vec3_at(record, ORIGIN))
