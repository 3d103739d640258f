"""The picture itself, at the pixels' centres."""

from __future__ import annotations

from sightray._jit import implements
from sightray.cameras.base import Ray
from sightray.integrators.base import radiance
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, i64_at, table_at, vec3_at
from sightray.scene.query_kernels import put_triple
from sightray.vision.layers.base import Layer, fill
from sightray.vision.lighting import draws_at
from sightray.vision.record import DIRECTION, INTEGRATOR, ORIGIN, PIXEL, WORLD, record_at


class ColorLayer(Layer):
    """Light along the ray through the pixel's centre by `Whitted` (the scene's own, if it has one); linear Rec. 709."""

    label, unit, columns, picture, letters = "color", "W/(m² sr)", 3, "color", "RGB"


@implements(fill, ColorLayer)
def fill_color(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    world, integrator = table_at(frame, WORLD), table_at(frame, INTEGRATOR)
    for i in range(count):
        record = record_at(records, i)
        ray = Ray(vec3_at(record, ORIGIN), vec3_at(record, DIRECTION))
        put_triple(out, i64_at(record, PIXEL), radiance(integrator, world, ray, draws_at(frame, record)).color)
