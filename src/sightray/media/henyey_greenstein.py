"""The phase function of Henyey and Greenstein, which one number shapes.

    p(cos) = (1 - g²) / (4 pi (1 + g² - 2 g cos)^(3/2)),  with mean cosine g

(L. Henyey, J. Greenstein, "Diffuse radiation in the galaxy", Astrophysical Journal 93, 1941.)
"""

from __future__ import annotations

import math

from sightray._jit import kernel
from sightray.mathlib.frame import perpendicular
from sightray.mathlib.scalars import f64
from sightray.mathlib.vec import Vec3, cross
from sightray.mathlib.warp import circle
from sightray.media.base import PhaseSample

NEARLY_EVEN = 1e-3  # below this |g| the inverse loses its digits, and even scattering is as good


@kernel
def henyey_greenstein(g: f64, cosine: f64) -> f64:
    """Density per solid angle; `cosine` is 1 straight on."""
    base = 1.0 + g * g - 2.0 * g * cosine
    return (1.0 - g * g) / (4.0 * math.pi * base * math.sqrt(base))


@kernel
def sample_henyey_greenstein(g: f64, d: Vec3, u: f64, v: f64) -> PhaseSample:
    """A direction after light that travelled along d, with that density: the inverse of its distribution."""
    cosine = 1.0 - 2.0 * u
    if abs(g) > NEARLY_EVEN:
        ratio = (1.0 - g * g) / (1.0 - g + 2.0 * g * u)
        cosine = (1.0 + g * g - ratio * ratio) / (2.0 * g)
    cosine = min(1.0, max(-1.0, cosine))
    sine, around = math.sqrt(1.0 - cosine * cosine), circle(v)
    s = perpendicular(d)
    way = s * (sine * around.x) + cross(d, s) * (sine * around.y) + d * cosine
    return PhaseSample(way, henyey_greenstein(g, cosine))
