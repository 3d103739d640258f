"""`Hit`: what an intersection hands back."""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.mathlib.scalars import f64, i64


class Hit(NamedTuple):
    """The nearest meeting of a ray and a shape; ``t`` is infinite where there is none."""

    t: f64  # ray parameter
    prim: i64  # which triangle, face or part
    u: f64  # two numbers of the shape's choice; barycentric weights for triangles
    v: f64


@kernel
def miss() -> Hit:
    """No hit."""
    return Hit(math.inf, -1, 0.0, 0.0)


@kernel
def is_hit(hit: Hit) -> bool:
    """Whether anything was met."""
    return hit.t < math.inf
