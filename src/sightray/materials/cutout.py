"""Surfaces with holes: leaves, lace, wire netting, labels with round corners."""

from __future__ import annotations

from typing import Any

from sightray._jit import implements
from sightray.fields import number
from sightray.materials.base import opacity
from sightray.materials.data import data, share_of
from sightray.materials.wrapper import INNER, _Wrapper
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, table_at
from sightray.textures.base import Where


class Cutout(_Wrapper):
    """A material where `opacity` is 1, nothing where it is 0; in between rays are stopped with that probability.

    With a `threshold` there is no in between: the surface is there where the opacity reaches it. What is a hole is a
    hole for all rays, shadow rays as well.
    """

    opacity: Any = data("share of light that the surface stops, 0 to 1: a number, or the red of a texture")
    threshold: float | None = number(
        "opacity from which on the surface is whole; None for shares", default=None, above=0, at_most=1,
        optional=True)  # fmt: skip

    @property
    def cutout(self) -> bool:
        return True


_, OPACITY, THRESHOLD = Cutout.offsets()


@implements(opacity, Cutout)
def opacity_of_cutout(material: Table, where: Where) -> f64:
    share, threshold = share_of(table_at(material, OPACITY), where), f64_at(material, THRESHOLD)
    if threshold == threshold:  # one is stated: NaN is not equal to itself
        share = 1.0 if share >= threshold else 0.0
    return share * opacity(table_at(material, INNER), where)
