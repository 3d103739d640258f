"""How much light rough surfaces reflect after one bounce between their facets, tabulated when a material is packed.

A microfacet model that follows light for one bounce loses what the facets reflect into one another: more than half of
it at roughness 1. The tables say how much is missing; `missing.py` reads them and materials give it back, spread evenly
as many bounces leave it (C. Kulla, A. Conty, "Revisiting physically based shading at Imageworks", SIGGRAPH 2017 course).

A table holds shares of light by the azimuth, roughness and cosine of the viewer, then their means over the hemisphere.
Nodes lie evenly over cos² azimuth, over roughness = sqrt(alpha), and over cos (1 + alpha) / (cos + alpha): what smooth
surfaces do is a matter of cos / alpha. Each entry integrates over the visible facets with a fixed grid of points.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sightray.materials.stored import stored

Array = NDArray[np.float64]

AZIMUTHS, ROUGHNESSES, COSINES = 5, 25, 25  # nodes; a single azimuth where the surface is the same all around
POINTS = 32  # per axis of the integral over facets
GRAZING = 1e-3  # times alpha: cosine in place of 0
SMOOTH = 1e-4  # alpha below which a surface is a mirror
ROUGHNESS_NODES = np.arange(ROUGHNESSES) / (ROUGHNESSES - 1)


@stored
def missing_of_mirrors(kind: int, anisotropy: float = 0.0) -> Array:
    """What is missing where facets reflect everything: metals."""
    return _table(kind, anisotropy, lambda f: f.reflected)


@stored
def missing_of_glass(kind: int, eta: float, anisotropy: float = 0.0) -> Array:
    """What is missing of reflected and refracted light together; `eta`: index before the surface over that behind."""
    return _table(kind, anisotropy, lambda f: f.share(eta) * f.reflected + (1.0 - f.share(eta)) * f.refracted(eta))


@stored
def reflected_by_glass(kind: int, eta: float, anisotropy: float = 0.0) -> Array:
    """The light that a rough dielectric reflects, over that which a smooth one would.

    That is what does not reach the colour below a varnish. The means at the end are those of the light itself.
    """
    smooth = np.array([fresnel_share(cosines_at(float(roughness**2)), eta) for roughness in ROUGHNESS_NODES])
    rows = [
        [1.0 - _row(kind, anisotropy, c, r, lambda f: f.share(eta) * f.reflected) for r in range(ROUGHNESSES)]
        for c in _azimuths(anisotropy)
    ]
    shares = np.array(rows)
    ratios = np.divide(shares, smooth, out=np.ones_like(shares), where=smooth > 0.0)  # an index of 1 reflects nothing
    return with_means(ratios, lambda cosine: fresnel_share(cosine, eta))


class _Facets:
    """Facets that each of some viewers sees, on grids; kernels of the same mathematics are in microfacet.py.

    `wo`: (n, 3) directions to the viewers. Arrays of facets are (n, POINTS, POINTS), one for each coordinate: numpy is
    several times as fast with these as with arrays of triples.
    """

    def __init__(self, kind: int, x: float, y: float, wo: Array):
        self.kind, self.x, self.y = kind, x, y
        self.wo = tuple(wo.T[:, :, np.newaxis, np.newaxis])
        stretched = wo * (x, y, 1.0)
        stretched /= np.linalg.norm(stretched, axis=1, keepdims=True)
        (u, v, w), self.weight = _visible_cap(stretched) if kind == 0 else _visible_slopes(stretched)
        u, v = u * x, v * y
        scale = 1.0 / np.sqrt(u * u + v * v + w * w)
        self.m = (u * scale, v * scale, w * scale)
        self.cosine = np.clip(sum(a * b for a, b in zip(self.m, self.wo, strict=True)), 0.0, 1.0)

    @cached_property
    def reflected(self) -> Array:
        """Share of what each facet mirrors that leaves the surface."""
        twice = 2.0 * self.cosine
        return self._leaves(*(twice * m - o for m, o in zip(self.m, self.wo, strict=True)))

    def refracted(self, eta: float) -> Array:
        """Share of what each facet refracts that leaves the surface on its lower side."""
        inner = np.sqrt(np.maximum(0.0, 1.0 - eta * eta * (1.0 - self.cosine**2)))
        bend = eta * self.cosine - inner
        u, v, w = (bend * m - eta * o for m, o in zip(self.m, self.wo, strict=True))
        return self._leaves(u, v, -w)

    def share(self, eta: float) -> Array:
        """What Fresnel's equations say that each facet reflects."""
        return fresnel_share(self.cosine, eta)

    @cached_property
    def before(self) -> Array:
        """1 and the facets that are hidden from the viewer, per seen one."""
        return 1.0 + self._hidden(*self.wo)

    def _leaves(self, u: Array, v: Array, w: Array) -> Array:
        """Smith's share of facets seen from both directions, over that seen from the viewer's."""
        return np.where(w > 0.0, self.before / (self.before + self._hidden(u, v, w)), 0.0)

    def _hidden(self, u: Array, v: Array, w: Array) -> Array:
        a2 = ((u * self.x) ** 2 + (v * self.y) ** 2) / np.maximum(w, 1e-9) ** 2
        if self.kind == 0:
            return 0.5 * (np.sqrt(1.0 + a2) - 1.0)
        b = 1.0 / np.sqrt(np.maximum(a2, 4e-4))
        return np.maximum(0.0, 0.5 * np.exp(-b * b) * (1.0 / (b * math.sqrt(math.pi)) - _scaled_erfc(b)))


def fresnel_share(cosine: Array, eta: float) -> Array:
    """Share of unpolarised light that a smooth dielectric reflects, as `mathlib.frame.fresnel`."""
    inner = np.sqrt(np.maximum(0.0, 1.0 - eta * eta * (1.0 - cosine**2)))
    with np.errstate(invalid="ignore", divide="ignore"):
        r_s = (eta * cosine - inner) / (eta * cosine + inner)
        r_p = (cosine - eta * inner) / (cosine + eta * inner)
    return np.where(inner > 0.0, 0.5 * (r_s**2 + r_p**2), 1.0)


def passing(ior: float) -> tuple[float, float]:
    """Shares of light from all sides that pass a smooth boundary from outside and from inside: 1 minus 2 R cos d cos.

    The second is the first over the square of the index (the étendue of light is kept), so the integral over the rarer
    side, which has no kink at a critical angle, gives both.
    """
    cosine = (np.arange(2000) + 0.5) / 2000
    rarer = min(ior, 1.0 / ior)
    share = 1.0 - float((fresnel_share(cosine, rarer) * cosine).mean() * 2.0)
    return (share, share * rarer**2) if ior >= 1.0 else (share * rarer**2, share)


def _scaled_erfc(x: Array) -> Array:
    """exp(x²) erfc(x) for x > 0, to 1.5e-7 (M. Abramowitz, I. Stegun, 1964, 7.1.26)."""
    t = 1.0 / (1.0 + 0.3275911 * x)
    return t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429))))


def _visible_cap(w: Array) -> tuple[tuple[Array, ...], Array]:
    """Stretched GGX facets that each of (n, 3) w sees: equal parts of a spherical cap; and their weights."""
    u, v = np.meshgrid(*2 * [(np.arange(POINTS) + 0.5) / POINTS], indexing="ij")
    wx, wy, wz = w.T[:, :, np.newaxis, np.newaxis]
    z = (1.0 - u) * (1.0 + wz) - wz
    sine = np.sqrt(np.maximum(0.0, 1.0 - z * z))
    facets = (sine * np.cos(2 * np.pi * v) + wx, sine * np.sin(2 * np.pi * v) + wy, z + wz)
    return facets, np.full(z.shape, 1.0 / u.size)


def _visible_slopes(w: Array) -> tuple[tuple[Array, ...], Array]:
    """Stretched Beckmann facets that each w sees: slopes at even quantiles, and what is seen of them as weights."""
    wx, wy, wz = w.T[:, :, np.newaxis, np.newaxis]
    sine = np.maximum(np.hypot(wx, wy), 1e-9)
    quantiles = (np.arange(POINTS) + 0.5) / POINTS
    normal = NormalDist(sigma=math.sqrt(0.5))
    highest = [normal.cdf(cot) for cot in (wz / sine).ravel()]
    s = np.array([[normal.inv_cdf(q * top) for q in quantiles] for top in highest])[:, :, np.newaxis]
    t = np.array([normal.inv_cdf(q) for q in quantiles])
    weight = np.broadcast_to(np.maximum(0.0, wz - s * sine), (len(w), POINTS, POINTS))
    c, d = np.where(sine > 1e-6, wx / sine, 1.0), np.where(sine > 1e-6, wy / sine, 0.0)
    return (-(s * c - t * d), -(s * d + t * c), np.ones((1, 1, 1))), weight / weight.sum(axis=(1, 2), keepdims=True)


def _table(kind: int, anisotropy: float, leaving: Callable[[_Facets], Array]) -> Array:
    """1 minus the mean of `leaving` over visible facets, for all nodes; then the means over the hemisphere."""
    rows = [[_row(kind, anisotropy, c, r, leaving) for r in range(ROUGHNESSES)] for c in _azimuths(anisotropy)]
    return with_means(np.clip(rows, 0.0, 1.0))


def _azimuths(anisotropy: float) -> Array:
    """Cosines of the nodes' azimuths: a single one, 0 or any, where the surface is the same all around."""
    nodes = AZIMUTHS if anisotropy else 1
    return np.sqrt(np.arange(nodes) / max(1, nodes - 1))


def _row(kind: int, anisotropy: float, along: float, r: int, leaving: Callable[[_Facets], Array]) -> Array:
    """The entries for all cosines, at one roughness and one azimuth, whose cosine is `along`."""
    from sightray.materials.microfacet import facets

    roughness = float(ROUGHNESS_NODES[r])
    z = cosines_at(roughness**2)
    sine = np.sqrt(1.0 - z * z)
    wo = np.stack([sine * along, sine * math.sqrt(1.0 - along * along), z], axis=1)
    shape = facets(kind, roughness, anisotropy)
    seen = _Facets(kind, shape.x, shape.y, wo)
    return np.asarray(1.0 - (leaving(seen) * seen.weight).sum(axis=(1, 2)))


def cosines_at(bend: float) -> Array:
    """The cosines of a row's nodes: half of them lie below `bend`, which is alpha where facets are."""
    bend, s = max(SMOOTH, bend), np.arange(COSINES) / (COSINES - 1)
    return np.asarray(np.clip(bend * s / (1.0 + bend - s), GRAZING * bend, 1.0))


def with_means(
    table: ArrayLike, factor: Callable[[Array], Any] = lambda cosine: 1.0, bend: float | None = None
) -> Array:
    """The number of azimuths, the table, and its mean over the hemisphere for each roughness, in a row.

    `table`: (azimuths, roughnesses, cosines); entries times `factor` are averaged. `bend` as in `cosines_at`, where it
    is the same for all roughnesses.
    """
    table = np.asarray(table)
    around = np.tensordot(_mean_around(len(table)), table, axes=1)
    root = (np.arange(4000) + 0.5) / 4000  # of the cosine; d(cos²) = 4 root³ d root
    bends = np.maximum(SMOOTH, ROUGHNESS_NODES**2 if bend is None else np.full(ROUGHNESSES, bend))[:, np.newaxis]
    s = root**2 * (1.0 + bends) / (root**2 + bends)
    nodes, weight = np.arange(COSINES) / (COSINES - 1), 4.0 * root**3 * factor(root**2) / len(root)
    means = [np.interp(at, nodes, row) @ weight for at, row in zip(s, around, strict=True)]
    return np.concatenate([[float(len(table))], table.ravel(), means])


def _mean_around(azimuths: int) -> Array:
    """Weights of the azimuths in a mean over all directions, as linear interpolation over cos² spreads them."""
    if azimuths == 1:
        return np.ones(1)
    x = np.cos((np.arange(2000) + 0.5) / 2000 * np.pi / 2) ** 2 * (azimuths - 1)
    return np.maximum(0.0, 1.0 - np.abs(x - np.arange(azimuths)[:, np.newaxis])).mean(axis=1)
