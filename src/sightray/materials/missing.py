"""Reading the tables of energy.py, and the light of many bounces between facets, which they say is missing."""

from __future__ import annotations

import math

from sightray._jit import kernel
from sightray.materials.energy import COSINES, ROUGHNESSES, SMOOTH
from sightray.mathlib.frame import fresnel
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at
from sightray.mathlib.vec import Vec3
from sightray.mathlib.warp import circle, cosine_hemisphere

PLANE = ROUGHNESSES * COSINES  # entries of one azimuth


@kernel
def share_at(table: Table, roughness: f64, w: Vec3) -> f64:
    """The table's share for a direction, interpolated between its nodes."""
    azimuths, bend = int(f64_at(table, 0)), max(SMOOTH, roughness * roughness)
    if azimuths == 1:
        return in_plane(table, 1, roughness, bend, w.z)
    flat = w.x * w.x + w.y * w.y
    at = w.x * w.x / flat * (azimuths - 1) if flat > 0.0 else 0.0
    a = min(azimuths - 2, int(at))
    t = at - a
    below = in_plane(table, 1 + a * PLANE, roughness, bend, w.z)
    return below * (1.0 - t) + in_plane(table, 1 + (a + 1) * PLANE, roughness, bend, w.z) * t


@kernel
def in_plane(table: Table, start: i64, roughness: f64, bend: f64, cosine: f64) -> f64:
    """Interpolation over roughness and cosine; half of the nodes are for cosines below `bend`."""
    z = min(1.0, abs(cosine))
    x, y = z * (1.0 + bend) / (z + bend) * (COSINES - 1), roughness * (ROUGHNESSES - 1)
    k, r = min(COSINES - 2, int(x)), min(ROUGHNESSES - 2, int(y))
    s, t = x - k, y - r
    at = start + r * COSINES + k
    low = f64_at(table, at) * (1.0 - s) + f64_at(table, at + 1) * s
    high = f64_at(table, at + COSINES) * (1.0 - s) + f64_at(table, at + COSINES + 1) * s
    return low * (1.0 - t) + high * t


@kernel
def varnish_share(table: Table, roughness: f64, eta: f64, w: Vec3) -> f64:
    """What a rough dielectric reflects, by its table `reflected_by_glass`."""
    return min(1.0, fresnel(w.z, eta) * share_at(table, roughness, w))


@kernel
def mean_share(table: Table, roughness: f64) -> f64:
    """The mean of the table's shares over the hemisphere, each direction by its cosine."""
    y = roughness * (ROUGHNESSES - 1)
    r = min(ROUGHNESSES - 2, int(y))
    at = 1 + int(f64_at(table, 0)) * PLANE + r
    return f64_at(table, at) * (1.0 - (y - r)) + f64_at(table, at + 1) * (y - r)


@kernel
def sample_spread(roughness: f64, u: f64, v: f64) -> Vec3:
    """Choose where light goes that was reflected more than once: half by the cosine, half by cos / alpha.

    The second half is for smooth surfaces, which lose light at grazing angles only, and give it back there.
    """
    if u < 0.5:
        return cosine_hemisphere(2.0 * u, v)
    alpha, s = max(SMOOTH, roughness * roughness), 2.0 * u - 1.0
    z = alpha * s / (1.0 + alpha - s)
    sine, around = math.sqrt(max(0.0, 1.0 - z * z)), circle(v)
    return Vec3(sine * around.x, sine * around.y, z)


@kernel
def spread_density(roughness: f64, cosine: f64) -> f64:
    """The density of that choice, per solid angle."""
    alpha = max(SMOOTH, roughness * roughness)
    by_ratio = alpha * (1.0 + alpha) / ((cosine + alpha) * (cosine + alpha))
    return 0.5 * (cosine / math.pi + by_ratio / (2.0 * math.pi))
