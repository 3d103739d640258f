"""Lights by their spectra: the CIE's standard illuminants, daylight of any colour temperature, glowing bodies."""

from __future__ import annotations

import numpy as np

from sightray.errors import SceneError, unknown
from sightray.spectra.spectrum import Spectrum
from sightray.spectra.tables import WAVELENGTHS, rows_of

PLANCK = 6.62607015e-34  # J s
LIGHT_SPEED = 299792458.0  # m/s
BOLTZMANN = 1.380649e-23  # J/K
_DAYLIGHTS = {"D50": 5000.0, "D55": 5500.0, "D75": 7500.0}
ILLUMINANTS = ("A", "D50", "D55", "D65", "D75", "E", "FL2")
"""Names that `illuminant` knows."""


def illuminant(name: str) -> Spectrum:
    """Relative spectral power of a CIE standard illuminant.

    A is a tungsten lamp at 2856 K, D50 to D75 are phases of daylight (D65 is the white of Rec. 709), E is the same at
    all wavelengths, FL2 a cool white fluorescent lamp. The scale is the CIE's: 100 at 560 nm, FL2 aside;
    `Spectrum.normalised` scales to luminance 1. D50, D55 and D75 come from `daylight`.

    Raises
    ------
    SceneError
        Unknown name.

    References: CIE 15:2018, section 4; ISO/CIE 11664-2:2022.

    >>> illuminant("D65").xy().round(4).tolist()
    [0.3127, 0.329]
    """
    if name not in ILLUMINANTS:
        raise SceneError(unknown("illuminant", str(name), ILLUMINANTS))
    if name in ("D65", "FL2"):
        table = rows_of(name.lower())
        return Spectrum(table[:, 0], table[:, 1])
    if name == "E":
        return Spectrum.constant(100.0)
    if name == "A":
        power = (560.0 / WAVELENGTHS) ** 5 * np.expm1(1.435e7 / (2848 * 560)) / np.expm1(1.435e7 / (2848 * WAVELENGTHS))
        return Spectrum(WAVELENGTHS, 100.0 * power)
    return daylight(_DAYLIGHTS[name] * 1.4388 / 1.4380)  # c2 was revised after these temperatures had been named


def daylight(kelvin: float) -> Spectrum:
    """Relative spectral power of the phase of daylight with a correlated colour temperature; 100 at 560 nm.

    With T the temperature, the chromaticity x is a cubic in 1/T, y = -3 x² + 2.87 x - 0.275, and the power is
    S0 + M1 S1 + M2 S2 with M1 and M2 functions of x and y.

    Parameters
    ----------
    kelvin : 4000 to 25000. D65 is 6504 K.

    References: D. Judd, D. MacAdam, G. Wyszecki, "Spectral distribution of typical daylight as a function of correlated
    color temperature", JOSA 54(8), 1964; CIE 15:2018, section 4.1.2.
    """
    if not 4000 <= kelvin <= 25000:
        raise SceneError(f"daylight: kelvin {kelvin!r}; allowed: 4000 to 25000")
    t = 1000.0 / kelvin
    if kelvin <= 7000:
        x = ((-4.6070 * t + 2.9678) * t + 0.09911) * t + 0.244063
    else:
        x = ((-2.0064 * t + 1.9018) * t + 0.24748) * t + 0.237040
    y = (-3.0 * x + 2.870) * x - 0.275
    m = 0.0241 + 0.2562 * x - 0.7341 * y
    m1 = (-1.3515 - 1.7703 * x + 5.9114 * y) / m
    m2 = (0.0300 - 31.4424 * x + 30.0717 * y) / m
    nm, s0, s1, s2 = rows_of("daylight").T
    return Spectrum(nm, s0 + m1 * s1 + m2 * s2)


def blackbody(kelvin: float) -> Spectrum:
    """Spectral radiance of a black body, W/(m² sr nm), every nanometre from 360 to 830.

    L = 2 h c² / λ⁵ / (exp(h c / (λ k T)) - 1). `Spectrum.normalised` keeps its colour and gives it luminance 1.

    Parameters
    ----------
    kelvin : above 0. Candles have about 1850, tungsten lamps 2856, the sun 5772. Radiances that are too small for a
        double are 0.

    Reference: M. Planck, "Ueber das Gesetz der Energieverteilung im Normalspectrum", Annalen der Physik 309(3), 1901.
    """
    if not (kelvin > 0 and np.isfinite(kelvin)):
        raise SceneError(f"blackbody: kelvin {kelvin!r}; allowed: above 0")
    metres = WAVELENGTHS * 1e-9
    with np.errstate(over="ignore"):
        per_metre = (2.0 * PLANCK * LIGHT_SPEED**2 / metres**5) / np.expm1(
            PLANCK * LIGHT_SPEED / (metres * BOLTZMANN * kelvin)
        )
    return Spectrum(WAVELENGTHS, per_metre * 1e-9)
