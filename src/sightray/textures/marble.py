"""Marble: layers that were folded while they were soft."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import implements
from sightray.fields import Point, derived_number, integer, number, vector
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, i64_at, vec3_at
from sightray.mathlib.vec import dot, length
from sightray.textures.base import Where, reach, textured
from sightray.textures.blend import _Blend, share
from sightray.textures.perlin import FARTHEST, octaves_of, visible_at


class Marble(_Blend):
    """Veins of `dark` stone in `light` stone: layers across `direction`, folded by turbulence.

    With h the height along `direction`, in layers, the share of light stone is ``1 - |cos(pi (h + fold T))|^sharpness``
    for turbulence T, 0 to 1, with cells of the layers' thickness: a vein runs in the middle of each layer. `direction`
    is in the space of the shape. Folds, then veins, that are finer than the footprint of a ray fade away to their mean.

    References: K. Perlin, "An image synthesizer", SIGGRAPH 1985, section "marble"; D. Ebert et al., Texturing and
    modeling, 3rd ed. 2002, chapter 2.
    """

    dark: object = textured("colour of the veins", default=(0.12, 0.12, 0.15))
    light: object = textured("colour of the stone", default=(0.88, 0.86, 0.82))
    direction: Point = vector("across the layers", default=(1.0, 0.0, 0.0), nonzero=True)
    scale: float = number("layers per metre", default=1.0, above=0)
    fold: float = number("by how many layers they are folded", default=2.5, at_least=0)
    sharpness: float = number("how thin veins are", default=8.0, above=0)
    octaves: int = integer("sizes of folds", default=7, at_least=1, at_most=30)
    seed: int = integer("which of many stones", default=0, at_least=0, at_most=2**31)
    _mean: Any = derived_number("share of dark stone, all in all", lambda m: m.mean())

    def mean(self) -> float:
        """Mean of |cos|^sharpness, by the gamma function; 0 in the limit of thin veins."""
        k = 0.5 * self.sharpness
        return math.exp(math.lgamma(k + 0.5) - math.lgamma(k + 1.0)) / math.sqrt(math.pi)


DIRECTION, SCALE, FOLD, SHARPNESS, OCTAVES, SEED, MEAN = Marble.offsets()[2:]


@implements(share, Marble)
def share_of_marble(texture: Table, where: Where) -> f64:
    axis = vec3_at(texture, DIRECTION)
    p = where.p * f64_at(texture, SCALE)
    height = dot(p, axis) / length(axis)
    if not abs(height) < FARTHEST:
        return 1.0
    width, fold = reach(where) * f64_at(texture, SCALE), f64_at(texture, FOLD)
    visible = visible_at(width * (1.0 + fold))  # folds make layers about that much steeper
    if visible <= 0.0:
        return 1.0 - f64_at(texture, MEAN)
    layer = height + fold * octaves_of(p, i64_at(texture, SEED), i64_at(texture, OCTAVES), 0.5, width, True)
    layer -= np.floor(layer)
    vein = abs(math.cos(math.pi * layer)) ** f64_at(texture, SHARPNESS)
    return 1.0 - vein * visible - f64_at(texture, MEAN) * (1.0 - visible)
