"""The sheen of cloth: fibres that stand up from the surface and glow towards grazing angles.

The facets' normals have the density D = (2 + 1/alpha) / (2 pi) sin^(1/alpha), densest along the surface, with alpha the
square of the roughness (A. Estevez, C. Kulla, "Production friendly microfacet sheen BRDF", SIGGRAPH 2017 course); what
hides them is 1 / (4 (cos o + cos i - cos o cos i)) (M. Ashikhmin, S. Premoze, 2007). For smooth cloth that would reflect
more than arrives at grazing angles; there it is scaled down, by the same factor from both sides.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from sightray._jit import kernel
from sightray.materials.energy import ROUGHNESS_NODES, cosines_at, with_means
from sightray.materials.missing import in_plane
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table
from sightray.mathlib.vec import Vec3, normalize

SMOOTHEST = 0.07  # roughness; less would be a line of light
BEND = 0.5  # half of the table's nodes are for cosines below it
POINTS = 96  # per axis of the integral over directions


@kernel
def sheen_value(table: Table, roughness: f64, o: Vec3, i: Vec3) -> f64:
    """The sheen's f times the cosine, for white fibres."""
    m = normalize(o + i)
    sine2 = max(0.0, 1.0 - m.z * m.z)
    alpha = max(SMOOTHEST, roughness) ** 2.0
    density = (2.0 + 1.0 / alpha) / (2.0 * math.pi) * sine2 ** (0.5 / alpha)
    most = max(1.0, in_plane(table, 1, roughness, BEND, o.z), in_plane(table, 1, roughness, BEND, i.z))
    return density * i.z / (4.0 * (o.z + i.z - o.z * i.z) * most)


@kernel
def sheen_share(table: Table, roughness: f64, w: Vec3) -> f64:
    """The share of light of one direction that white fibres reflect, at most."""
    return min(1.0, in_plane(table, 1, roughness, BEND, w.z))


@cache
def sheen_table() -> NDArray[np.float64]:
    """The shares without any scaling down, laid out as in energy.py."""
    x = (np.arange(POINTS) + 0.5) / POINTS
    z, phi = np.meshgrid(x**2, x * np.pi, indexing="ij")  # d z = 2 x dx
    sine, weight = np.sqrt(1.0 - z * z), 4.0 * np.pi * np.sqrt(z) * z / z.size
    rows = []
    mu = cosines_at(BEND)[:, np.newaxis, np.newaxis]
    for roughness in ROUGHNESS_NODES:
        s = np.sqrt(1.0 - mu * mu)
        size2 = 2.0 + 2.0 * (sine * np.cos(phi) * s + z * mu)  # of wo + wi, squared
        sine2 = np.clip(1.0 - (z + mu) ** 2 / size2, 0.0, 1.0)
        alpha = max(SMOOTHEST, roughness) ** 2
        density = (2.0 + 1.0 / alpha) / (2.0 * np.pi) * sine2 ** (0.5 / alpha)
        rows.append((density * weight / (4.0 * (mu + z - mu * z))).sum(axis=(1, 2)))
    return with_means([rows], bend=BEND)
