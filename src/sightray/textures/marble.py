"""Marble: layers that were folded while they were soft."""

from __future__ import annotations

import math

import numpy as np

from sightray._jit import implements
from sightray.fields import Point, integer, number, vector
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, i64_at, vec3_at
from sightray.mathlib.vec import dot, length
from sightray.textures.base import Where, textured
from sightray.textures.blend import _Blend, share
from sightray.textures.perlin import FARTHEST, octaves_of


class Marble(_Blend):
    """Veins of `dark` stone in `light` stone: layers across `direction`, folded by turbulence.

    With h the height along `direction`, in layers, the share of light stone is ``1 - |cos(pi (h + fold T))|^sharpness``
    for turbulence T, 0 to 1, with cells of the layers' thickness: a vein runs in the middle of each layer. `direction`
    is in the space of the shape.

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


DIRECTION, SCALE, FOLD, SHARPNESS, OCTAVES, SEED = Marble.offsets()[2:]


@implements(share, Marble)
def share_of_marble(texture: Table, where: Where) -> f64:
    axis = vec3_at(texture, DIRECTION)
    p = where.p * f64_at(texture, SCALE)
    height = dot(p, axis) / length(axis)
    if not abs(height) < FARTHEST:
        return 1.0
    turbulence = octaves_of(p, i64_at(texture, SEED), i64_at(texture, OCTAVES), 0.5, 0.0, True)
    layer = height + f64_at(texture, FOLD) * turbulence
    layer -= np.floor(layer)
    return 1.0 - abs(math.cos(math.pi * layer)) ** f64_at(texture, SHARPNESS)
