"""Wood: rings about the middle of a trunk."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import implements
from sightray.fields import Point, derived_vector, integer, number, vector
from sightray.mathlib.axes import axes_across
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, i64_at, vec3_at
from sightray.mathlib.vec import Vec3, dot
from sightray.textures.base import Where, reach, textured
from sightray.textures.blend import _Blend, share
from sightray.textures.perlin import FARTHEST, fade, noise, octaves_of, visible_at

LATE = 0.82  # where in a ring the growth of a year slows down and the wood turns dark
MEAN_DARK = 181.0 / 462.0  # mean of fade squared, that is of how dark a ring is
FIBRES = 12.0  # cells of their noise in a ring
ALONG_FIBRES = 1.0 / 24.0  # fibres are longer than thick by its inverse


class Wood(_Blend):
    """Annual rings about the line through `center` along `axis`: `light` early wood that darkens, then begins anew.

    Rings have `scale` per metre, waver by `waviness` rings, and show fibres along the axis of strength `grain`.
    `center` and `axis` are in the space of the shape. Fibres, then rings, that are finer than the footprint of a ray
    fade away to their mean.

    References: D. Peachey, "Solid texturing of complex surfaces", SIGGRAPH 1985, section 4.
    """

    dark: Any = textured("colour of late wood", default=(0.19, 0.085, 0.035))
    light: Any = textured("colour of early wood", default=(0.58, 0.34, 0.16))
    center: Point = vector("a point in the middle of the trunk", default=(0.0, 0.0, 0.0), unit="m")
    axis: Point = vector("along the trunk", default=(0.0, 1.0, 0.0), nonzero=True)
    scale: float = number("rings per metre", default=10.0, above=0)
    waviness: float = number("by how many rings they waver", default=0.7, at_least=0)
    grain: float = number("strength of the fibres", default=0.25, at_least=0, at_most=1)
    seed: int = integer("which of many trees", default=0, at_least=0, at_most=2**30)
    _u: Any = derived_vector("across the trunk", lambda w: axes_across(w.axis)[0])
    _v: Any = derived_vector("across the trunk", lambda w: axes_across(w.axis)[1])
    _n: Any = derived_vector("along the trunk, unit", lambda w: axes_across(w.axis)[2])


CENTER, _, SCALE, WAVINESS, GRAIN, SEED, U, V, N = Wood.offsets()[2:]


@implements(share, Wood)
def share_of_wood(texture: Table, where: Where) -> f64:
    p = (where.p - vec3_at(texture, CENTER)) * f64_at(texture, SCALE)
    x, y, z = dot(p, vec3_at(texture, U)), dot(p, vec3_at(texture, V)), dot(p, vec3_at(texture, N))
    r = math.sqrt(x * x + y * y)
    if not r + abs(z) < FARTHEST:
        return 1.0

    # Rings waver slowly around the trunk and more slowly along it.
    seed = i64_at(texture, SEED)
    width = reach(where) * f64_at(texture, SCALE)
    r += f64_at(texture, WAVINESS) * octaves_of(Vec3(0.4 * x, 0.4 * y, 0.1 * z), seed, 3, 0.5, 0.4 * width, False)
    ring = r - np.floor(r)
    late = fade(ring / LATE) if ring < LATE else fade((1.0 - ring) / (1.0 - LATE))
    visible = visible_at(width)
    dark = late * late * visible + MEAN_DARK * (1.0 - visible)
    fibres, visible = 0.5, visible_at(FIBRES * width)
    if visible > 0.0:
        fibres += 0.5 * visible * noise(Vec3(FIBRES * x, FIBRES * y, FIBRES * ALONG_FIBRES * z), seed + 1000)
    return (1.0 - dark) * (1.0 - f64_at(texture, GRAIN) * fibres)
