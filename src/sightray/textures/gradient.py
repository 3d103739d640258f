"""Colours that change along a line."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import implements, kernel
from sightray.errors import SceneError
from sightray.fields import array, choice, derived_array, derived_integer, number
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, i64_at, table_at
from sightray.mathlib.vec import Vec3
from sightray.textures.base import Texture, Where, reach, texture_value

U, V, X, Y, Z = 0, 1, 2, 3, 4
CLAMP, REPEAT, MIRROR = 0, 1, 2
STOP_WORDS = 8  # place, colour, the integral of the colours from the first place on, 0
BOX = 0.5  # of a footprint where it is longest, as in checker.py
THIN, WIDE = 1e-3, 1e3  # width of a box, where `begin` to `end` is 1: as good as a point; so wide that little changes


class Gradient(Texture):
    """Colours at places along u, v or an axis of the shape's space, and straight mixtures between them.

    The coordinate is counted from `begin`, where it is 0, to `end`, where it is 1; `colors` stand at the ascending
    `places` on that scale, or at even distances from 0 to 1. Beyond, the outer colours go on (``"clamp"``), or the
    scale is repeated or mirrored.

    Where the footprint of the ray is wide, the mean shows over a box half as wide as that is long: the difference of two
    values of the colours' integral, which is known in closed form (F. Crow, "Summed-area tables for texture mapping",
    SIGGRAPH 1984, has the idea).
    """

    colors: np.ndarray = array("linear colours, at least one", np.float64, 3, default=((0, 0, 0), (1, 1, 1)))
    places: np.ndarray | None = array("where they stand, ascending; None: evenly", np.float64, default=None)
    along: str = choice("coordinate", ("u", "v", "x", "y", "z"), default="u")
    begin: float = number("coordinate of place 0", default=0.0)
    end: float = number("coordinate of place 1", default=1.0)
    wrap: str = choice("what lies beyond", ("clamp", "repeat", "mirror"), default="clamp")
    _stops: Any = derived_array("place, red, green, blue, and their integrals", lambda g: g.stops())
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
        """Places, colours, and integrals up to there, (n, STOP_WORDS) float64."""
        places = np.linspace(0, 1, len(self.colors)) if self.places is None else self.places
        pieces = 0.5 * (self.colors[1:] + self.colors[:-1]) * np.diff(places)[:, None]
        sums = np.concatenate([np.zeros((1, 3)), np.cumsum(pieces, axis=0)])
        return np.ascontiguousarray(np.column_stack([places, self.colors, sums, np.zeros(len(places))]))


_, _, ALONG, BEGIN, END, WRAP, STOPS, COUNT = Gradient.offsets()


@implements(texture_value, Gradient)
def value_of_gradient(texture: Table, where: Where) -> Vec3:
    along, begin = i64_at(texture, ALONG), f64_at(texture, BEGIN)
    x, width, n = where.u, where.width, where.normal
    if along == V:
        x = where.v
    elif along == X:
        x, width = where.p.x, reach(where) * math.sqrt(max(0.0, 1.0 - n.x * n.x))
    elif along == Y:
        x, width = where.p.y, reach(where) * math.sqrt(max(0.0, 1.0 - n.y * n.y))
    elif along == Z:
        x, width = where.p.z, reach(where) * math.sqrt(max(0.0, 1.0 - n.z * n.z))
    scale = 1.0 / (f64_at(texture, END) - begin)
    return mean_about(texture, (x - begin) * scale, min(BOX * width * abs(scale), WIDE))


@kernel
def mean_about(texture: Table, x: f64, width: f64) -> Vec3:
    """The mean of the wrapped scale over a width about x."""
    wrap = i64_at(texture, WRAP)
    if wrap == REPEAT:
        x -= np.floor(x)  # so that far away no digits are lost
    elif wrap == MIRROR:
        x -= 2.0 * np.floor(0.5 * x)
    if not width > THIN:
        return mixed(texture, 2.0 - x if wrap == MIRROR and x > 1.0 else x)
    return (wrapped_sum(texture, x + 0.5 * width) - wrapped_sum(texture, x - 0.5 * width)) / width


@kernel
def wrapped_sum(texture: Table, x: f64) -> Vec3:
    """The integral of the wrapped scale from 0 to x, or from the first place if it is clamped."""
    wrap = i64_at(texture, WRAP)
    if wrap == CLAMP:
        return sum_to(texture, x)
    start = sum_to(texture, 0.0)
    period, turns = sum_to(texture, 1.0) - start, np.floor(x)
    if wrap == MIRROR and turns - 2.0 * np.floor(0.5 * turns) > 0.5:  # on the way back
        return period * (turns + 1.0) - (sum_to(texture, turns + 1.0 - x) - start)
    return period * turns + (sum_to(texture, x - turns) - start)


@kernel
def stops_before(texture: Table, x: f64) -> i64:
    """How many stops stand at x or before."""
    stops, count, k = table_at(texture, STOPS), i64_at(texture, COUNT), 0
    while k < count and f64_at(stops, STOP_WORDS * k) <= x:
        k += 1
    return k


@kernel
def colour_of(stops: Table, at: i64) -> Vec3:
    """Three words of the stops as a colour."""
    return Vec3(f64_at(stops, at), f64_at(stops, at + 1), f64_at(stops, at + 2))


@kernel
def mixed(texture: Table, x: f64) -> Vec3:
    """The straight mixture of the stops on both sides of x."""
    stops, k = table_at(texture, STOPS), stops_before(texture, x)
    low, high = STOP_WORDS * max(k - 1, 0), STOP_WORDS * min(k, i64_at(texture, COUNT) - 1)
    gap = f64_at(stops, high) - f64_at(stops, low)
    s = min(max((x - f64_at(stops, low)) / gap, 0.0), 1.0) if gap > 0.0 else 0.0
    return colour_of(stops, low + 1) * (1.0 - s) + colour_of(stops, high + 1) * s


@kernel
def sum_to(texture: Table, x: f64) -> Vec3:
    """The integral of the clamped scale from its first place to x: trapezoids."""
    stops, low = table_at(texture, STOPS), STOP_WORDS * max(stops_before(texture, x) - 1, 0)
    middle = (colour_of(stops, low + 1) + mixed(texture, x)) * 0.5
    return colour_of(stops, low + 4) + middle * (x - f64_at(stops, low))
