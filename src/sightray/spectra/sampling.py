"""Which wavelengths paths follow: few where the eye sees little.

The density is p(λ) = STEEPNESS / SPAN / cosh²(STEEPNESS (λ - CENTRE)) between FROM_NM and TO_NM. Its integral is a
hyperbolic tangent, so that a random number u in [0, 1) becomes the wavelength

    λ = CENTRE + artanh(LOW + u SPAN) / STEEPNESS,  artanh s = log((1 + s) / (1 - s)) / 2.

A path carries four wavelengths, of u, u + 1/4, u + 1/2 and u + 3/4 (modulo 1), so that its estimate is the mean over
the four of radiance times r̄, ḡ, b̄ over p. What one path that meets white varies by, as the sum of the variances of
linear red, green and blue, with four wavelengths, and with one, as remains behind glass that parts the colours:

=======================================================  =====  =====
density                                                  four   one
=======================================================  =====  =====
the same for all wavelengths                             1.47   22.8
STEEPNESS 0.0072, CENTRE 538 (Radziszewski and others)   0.37   14.6
STEEPNESS 0.0074, CENTRE 515 (here)                      0.24   14.5
in proportion to the length of white's (r̄, ḡ, b̄)         0.23    9.6
=======================================================  =====  =====

The last one, the best possible for one wavelength, has to be tabulated. Luminance alone, which Radziszewski and others
looked at, varies by 0.0024 here, 0.0013 there, and 0.022 for equal densities.

References: M. Radziszewski, K. Boryczko, W. Alda, "An improved technique for full spectral rendering", Journal of WSCG
17, 2009; A. Wilkie, S. Nawaz, M. Droske, A. Weidlich, J. Hanika, "Hero wavelength spectral sampling", EGSR 2014.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sightray.spectra.tables import FIRST_NM, LAST_NM

FROM_NM, TO_NM = FIRST_NM - 0.5, LAST_NM + 0.5  # the rows of `band_table` stand for a nanometre each
STEEPNESS = 0.0074  # 1/nm
CENTRE = 515.0  # nm
LOW = math.tanh(STEEPNESS * (FROM_NM - CENTRE))
SPAN = math.tanh(STEEPNESS * (TO_NM - CENTRE)) - LOW


def sample_wavelength(u: ArrayLike) -> NDArray[np.float64]:
    """Wavelengths, nm, of random numbers in [0, 1), of the same shape."""
    return CENTRE + np.arctanh(LOW + np.asarray(u, dtype=np.float64) * SPAN) / STEEPNESS


def wavelength_density(nm: ArrayLike) -> NDArray[np.float64]:
    """Density, 1/nm, that `sample_wavelength` has at wavelengths; 0 outside of its range."""
    at = np.asarray(nm, dtype=np.float64)
    inside = (at >= FROM_NM) & (at <= TO_NM)
    return np.where(inside, STEEPNESS / SPAN / np.cosh(STEEPNESS * (np.clip(at, FROM_NM, TO_NM) - CENTRE)) ** 2, 0.0)


def hero_wavelengths(u: ArrayLike) -> NDArray[np.float64]:
    """(..., 4) float, nm: the four wavelengths of each path, whose random numbers (...) are in [0, 1).

    The first one, the hero, decides where the path goes.
    """
    shifted = np.asarray(u, dtype=np.float64)[..., np.newaxis] + np.arange(4) / 4
    return sample_wavelength(shifted % 1.0)
