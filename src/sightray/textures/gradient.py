"""Colours that change along a line."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray._jit import implements
from sightray.errors import SceneError
from sightray.fields import array, choice, derived_array, derived_integer, number
from sightray.mathlib.table import Table, f64_at, i64_at, table_at
from sightray.mathlib.vec import Vec3
from sightray.textures.base import Texture, Where, texture_value

U, V, X, Y, Z = 0, 1, 2, 3, 4
CLAMP, REPEAT, MIRROR = 0, 1, 2


class Gradient(Texture):
    """Colours at places along u, v or an axis of the shape's space, and straight mixtures between them.

    The coordinate is counted from `begin`, where it is 0, to `end`, where it is 1; `colors` stand at the ascending
    `places` on that scale, or at even distances from 0 to 1. Beyond, the outer colours go on (``"clamp"``), or the
    scale is repeated or mirrored.
    """

    colors: np.ndarray = array("linear colours, at least one", np.float64, 3, default=((0, 0, 0), (1, 1, 1)))
    places: np.ndarray | None = array("where they stand, ascending; None: evenly", np.float64, default=None)
    along: str = choice("coordinate", ("u", "v", "x", "y", "z"), default="u")
    begin: float = number("coordinate of place 0", default=0.0)
    end: float = number("coordinate of place 1", default=1.0)
    wrap: str = choice("what lies beyond", ("clamp", "repeat", "mirror"), default="clamp")
    _stops: Any = derived_array("place, red, green, blue", lambda g: g.stops())
    _count: Any = derived_integer("number of colours", lambda g: len(g.colors))

    def check(self) -> None:
        if not len(self.colors) or (self.colors < 0).any():
            raise SceneError("Gradient.colors: allowed: one or more colours of numbers of at least 0")
        if self.places is not None and (len(self.places) != len(self.colors) or (np.diff(self.places) < 0).any()):
            raise SceneError(
                f"Gradient.places: got {self.places.tolist()} for {len(self.colors)} colours; allowed: as many, ascending"
            )
        if self.begin == self.end:
            raise SceneError(f"Gradient.end: got {self.end:g}, which is begin; allowed: another number")

    def brightness(self) -> float:
        return float(self.colors.mean())

    def stops(self) -> np.ndarray:
        """Places and colours, (n, 4) float64."""
        places = np.linspace(0, 1, len(self.colors)) if self.places is None else self.places
        return np.ascontiguousarray(np.column_stack([places, self.colors]))


_, _, ALONG, BEGIN, END, WRAP, STOPS, COUNT = Gradient.offsets()


@implements(texture_value, Gradient)
def value_of_gradient(texture: Table, where: Where) -> Vec3:
    along = i64_at(texture, ALONG)
    x = where.u
    if along == V:
        x = where.v
    elif along == X:
        x = where.p.x
    elif along == Y:
        x = where.p.y
    elif along == Z:
        x = where.p.z
    begin, wrap = f64_at(texture, BEGIN), i64_at(texture, WRAP)
    x = (x - begin) / (f64_at(texture, END) - begin)
    if wrap == REPEAT:
        x -= np.floor(x)
    elif wrap == MIRROR:
        x = abs(x - 2.0 * np.floor(0.5 * x + 0.5))

    # Mix the stops on both sides.
    stops, count = table_at(texture, STOPS), i64_at(texture, COUNT)
    k = 0
    while k < count and f64_at(stops, 4 * k) <= x:
        k += 1
    low, high = 4 * max(k - 1, 0), 4 * min(k, count - 1)
    gap = f64_at(stops, high) - f64_at(stops, low)
    s = min(max((x - f64_at(stops, low)) / gap, 0.0), 1.0) if gap > 0.0 else 0.0
    a = Vec3(f64_at(stops, low + 1), f64_at(stops, low + 2), f64_at(stops, low + 3))
    b = Vec3(f64_at(stops, high + 1), f64_at(stops, high + 2), f64_at(stops, high + 3))
    return a * (1.0 - s) + b * s
