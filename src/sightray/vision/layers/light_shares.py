"""Shares of lights."""

from __future__ import annotations

import math
from typing import Any

from sightray._jit import implements
from sightray.fields import integer
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, i64_at, table_at, vec3_at
from sightray.scene.world import lamp_count, light_at
from sightray.vision.layers.base import Layer, fill
from sightray.vision.lighting import Shares, seen_at, shares_of_light
from sightray.vision.pictures import Painting, shares
from sightray.vision.record import DIRECTION, PIXEL, WORLD, is_met, put_pair, record_at


class LightSharesLayer(Layer):
    """For each light two numbers, (h, w, 2 n): which share of it the point sees, and which lies before its surface.

    Shares are of the light that would arrive without shadows on a surface that faces it. Lights with an area are asked
    at the middles of `rays` x `rays` parts of each of their cells. `light_visibility`, `attached_shadow` and
    `cast_shadow` are made of it.
    """

    rays: int = integer("points along a side of each cell of a light", default=1, at_least=1, at_most=64)
    label, picture = "light_shares", "own"

    def columns_in(self, frame: Any) -> int:
        return 2 * len(frame.view.scene.lights)

    def painting(self, labels: Any) -> Painting:
        """Which share of each light lies before the surface, hidden or not."""
        return shares(labels, self, labels[self.label][..., 1::2])


(RAYS,) = LightSharesLayer.offsets()


@implements(fill, LightSharesLayer)
def fill_light_shares(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    world = table_at(frame, WORLD)
    lights = lamp_count(world)
    for i in range(count):
        record = record_at(records, i)
        pixel = i64_at(record, PIXEL)
        met = is_met(record)
        for index in range(lights):
            found = Shares(math.nan, math.nan)
            if met:
                light, sight = light_at(world, index), vec3_at(record, DIRECTION)
                found = shares_of_light(frame, light, seen_at(frame, record), sight, i64_at(layer, RAYS))
            put_pair(out, pixel * lights + index, found.seen, found.before)
