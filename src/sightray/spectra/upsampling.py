"""From RGB to spectra: three fixed reflectances that stand for red, green and blue.

The reflectance of an RGB colour is ``r * R(λ) + g * G(λ) + b * B(λ)``. R, G and B lie between 0 and 1, add up to 1 at
every wavelength, and have the colours (1, 0, 0), (0, 1, 0) and (0, 0, 1) under D65. So grey is flat, colours of the RGB
cube conserve energy, every colour comes back exactly under D65, and what is linear in RGB, such as the filtering of a
texture, is linear in spectra. Of all such triples they are the smoothest; tools/make_basis_spectra.py finds them.

Reference: I. Mallett, C. Yuksel, "Spectral primary decomposition for rendering with sRGB reflectance", EGSR 2019.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sightray.errors import SceneError
from sightray.spectra.observer import rgb_bar, white
from sightray.spectra.spectrum import Spectrum
from sightray.spectra.tables import WAVELENGTHS, frozen, rows_of


@cache
def basis() -> NDArray[np.float64]:
    """(471, 3) float in [0, 1]: the reflectances of red, green and blue at `WAVELENGTHS`."""
    return frozen(rows_of("basis")[:, 1:])


def reflectance(rgb: ArrayLike) -> Spectrum:
    """The reflectance of a linear Rec. 709 colour; within [0, 1] if the colour is.

    >>> reflectance((0.2, 0.5, 0.1)).rgb("D65").round(6).tolist()
    [0.2, 0.5, 0.1]
    """
    return Spectrum(WAVELENGTHS, basis() @ _three("reflectance", rgb))


def emission(rgb: ArrayLike) -> Spectrum:
    """Light of a linear Rec. 709 colour: its reflectance times D65 of luminance 1.

    >>> emission((3.0, 2.0, 1.0)).rgb().round(6).tolist()
    [3.0, 2.0, 1.0]
    """
    return Spectrum(WAVELENGTHS, (basis() @ _three("emission", rgb)) * white())


@cache
def band_table() -> NDArray[np.float64]:
    """(471, 8) float: all that a spectral path reads, one row for each of `WAVELENGTHS`.

    Columns: reflectance of red, green, blue; white (D65 of luminance 1); r̄, ḡ, b̄ (see `rgb_bar`, 1/nm); 0. A row stands
    for the nanometre around its wavelength: wavelengths from 359.5 to 830.5 look up row ``floor(nm - 359.5)``. Then
    integrals over wavelength are sums over rows, and RGB colours come back exactly.
    """
    zero = np.zeros((len(WAVELENGTHS), 1))
    return frozen(np.hstack([basis(), white()[:, np.newaxis], rgb_bar(), zero]))


def _three(where: str, rgb: ArrayLike) -> NDArray[np.float64]:
    colour = np.asarray(rgb)
    if colour.shape != (3,) or colour.dtype.kind not in "iuf" or not np.isfinite(colour).all():
        raise SceneError(f"{where}: {rgb!r}; allowed: three finite numbers, linear red, green and blue")
    return colour.astype(np.float64)
