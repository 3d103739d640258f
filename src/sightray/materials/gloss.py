"""What rough surfaces show to Whitted's model, which knows matte colours, highlights of lights, and perfect mirrors.

A rough mirror of reflectance F is divided. A share s = (1 - alpha)² shows other surfaces as if it were smooth, and
lights as a highlight of Blinn's exponent n = 2 / alpha² - 2 whose energy is as much: s F (n + 8) / (8 pi) (T.
Akenine-Möller and others, Real-Time Rendering, 2018, section 9.8). The rest counts as matte.
"""

from __future__ import annotations

import math

from sightray._jit import kernel
from sightray.materials.base import BLINN, Local
from sightray.mathlib.scalars import f64
from sightray.mathlib.vec import Vec3, grey

SHARPEST = 1e4  # exponent of a highlight


@kernel
def sharpness(alpha: f64) -> f64:
    """The share of a rough surface's reflection or refraction that is shown as if it were smooth."""
    return (1.0 - alpha) * (1.0 - alpha)


@kernel
def softened(cosine: f64, alpha: f64) -> f64:
    """The cosine to take Fresnel's share at: the facets of a rough surface are seen less aslant than the surface."""
    return abs(cosine) + (1.0 - abs(cosine)) * 0.5 * alpha


@kernel
def glossy(color: Vec3, emission: Vec3, matte: Vec3, mirror: Vec3, transmission: Vec3, alpha: f64, eta: f64,
           absorption: Vec3) -> Local:  # fmt: skip
    """The answer of a rough surface: `matte`, `mirror` and `transmission` are shares of light."""
    sharp = sharpness(alpha)
    shininess = min(SHARPEST, max(0.0, 2.0 / max(alpha * alpha, 1e-8) - 2.0))
    spread = matte + mirror * (1.0 - sharp)
    highlight = mirror * (sharp * (shininess + 8.0) / (8.0 * math.pi)) if shininess < SHARPEST else grey(0.0)
    return Local(
        color, emission, spread, spread * (1.0 / math.pi), highlight, shininess, BLINN, mirror * sharp, transmission,
        eta, absorption,
    )  # fmt: skip
