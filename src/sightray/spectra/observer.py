"""How a spectrum becomes three numbers: the CIE 1931 standard observer, and linear Rec. 709.

With x̄, ȳ, z̄ the observer's curves, the light L has X = k ∫ L x̄ dλ, and likewise Y and Z. Here k = 1 / ∫ ȳ dλ, so that
L = 1 at all wavelengths has the luminance Y = 1. The same goes for r̄, ḡ, b̄, the curves of linear Rec. 709, which are
mixtures of the three that have negative parts. Rec. 709's white is D65: light of its spectrum and of luminance 1 has the
colour (1, 1, 1). The white is taken from D65's spectrum itself rather than from its rounded chromaticity
(0.3127, 0.3290), so that white comes out white to the last digit.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from sightray.spectra.tables import WAVELENGTHS, frozen, rows_of

PRIMARIES = ((0.64, 0.33), (0.30, 0.60), (0.15, 0.06))
"""Chromaticities x, y of Rec. 709 red, green and blue (ITU-R BT.709-6)."""


@cache
def xyz_bar() -> NDArray[np.float64]:
    """(471, 3) float, 1/nm: x̄, ȳ, z̄ at `WAVELENGTHS`, over the sum of ȳ: XYZ of light L is ``L @ xyz_bar()``."""
    curves = rows_of("observer")[:, 1:]
    return frozen(curves / curves[:, 1].sum())


@cache
def white() -> NDArray[np.float64]:
    """(471,) float: D65 at `WAVELENGTHS`, scaled to luminance 1; the light whose colour is (1, 1, 1)."""
    table = rows_of("d65")
    power = np.interp(WAVELENGTHS, table[:, 0], table[:, 1])
    return frozen(power / (power @ xyz_bar()[:, 1]))


@cache
def xyz_from_rgb() -> NDArray[np.float64]:
    """(3, 3) float: XYZ of linear Rec. 709, column by column that of red, green and blue."""
    xy = np.array(PRIMARIES)
    columns = np.vstack([xy.T, 1.0 - xy.sum(axis=1)])
    return frozen(columns * np.linalg.solve(columns, white() @ xyz_bar()))


@cache
def rgb_from_xyz() -> NDArray[np.float64]:
    """(3, 3) float: the inverse of `xyz_from_rgb`."""
    return frozen(np.linalg.inv(xyz_from_rgb()))


@cache
def rgb_bar() -> NDArray[np.float64]:
    """(471, 3) float, 1/nm: r̄, ḡ, b̄ at `WAVELENGTHS`: linear Rec. 709 of light L is ``L @ rgb_bar()``."""
    return frozen(xyz_bar() @ rgb_from_xyz().T)
