"""Noise: clouds, dirt, uneven surfaces."""

from __future__ import annotations

from sightray._jit import implements
from sightray.fields import choice, flag, integer, number
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, i64_at
from sightray.mathlib.vec import Vec3
from sightray.textures.base import Where, reach
from sightray.textures.blend import _Blend, share
from sightray.textures.perlin import octaves_of

SOLID, UV = 0, 1


class Noise(_Blend):
    """Perlin's noise between two colours or textures.

    `scale` cells per metre of the shape's space (``"solid"``), or per unit of u and v (``"uv"``), make the coarsest
    pattern; each of the further `octaves` is twice as fine and `gain` times as strong. Where their mean, weighed by
    strength, is n, about -1 to 1, `light` has the share (1 + contrast n)/2, cut off at 0 and 1. With `turbulence` it is
    the mean of absolute values, and the share is ``contrast n``: creases, as in smoke and fire.

    Octaves finer than the footprint of a ray fade away to their mean.

    References: K. Perlin, "An image synthesizer", SIGGRAPH 1985; "Improving noise", SIGGRAPH 2002.
    """

    mode: str = choice("the space that is filled", ("solid", "uv"), default="solid")
    scale: float = number("cells per metre, or per unit of u and v", default=1.0, above=0)
    octaves: int = integer("sizes of patterns", default=6, at_least=1, at_most=30)
    gain: float = number("strength of each octave over the one before", default=0.5, above=0, at_most=1)
    turbulence: bool = flag("whether absolute values are summed", default=False)
    contrast: float = number("factor of the sum", default=1.5, above=0)
    seed: int = integer("which of many patterns", default=0, at_least=0, at_most=2**31)


MODE, SCALE, OCTAVES, GAIN, TURBULENCE, CONTRAST, SEED = Noise.offsets()[2:]


@implements(share, Noise)
def share_of_noise(texture: Table, where: Where) -> f64:
    scale = f64_at(texture, SCALE)
    p, width = where.p * scale, reach(where) * scale
    if i64_at(texture, MODE) == UV:
        p, width = Vec3(where.u, where.v, 0.0) * scale, where.width * scale
    folded = i64_at(texture, TURBULENCE) != 0
    n = octaves_of(p, i64_at(texture, SEED), i64_at(texture, OCTAVES), f64_at(texture, GAIN), width, folded)
    n *= f64_at(texture, CONTRAST)
    return min(max(n if folded else 0.5 + 0.5 * n, 0.0), 1.0)
