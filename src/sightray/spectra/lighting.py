"""Light that is stated by its spectrum: what lamps take beside a colour, and what kernels read of it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sightray.errors import SceneError
from sightray.spectra.illuminants import ILLUMINANTS, blackbody, illuminant
from sightray.spectra.observer import rgb_bar
from sightray.spectra.spectrum import Spectrum
from sightray.spectra.tables import WAVELENGTHS
from sightray.spectra.upsampling import basis

Light = str | float | Spectrum | None
"""The name of an illuminant, the temperature of a black body in kelvin, a spectrum of any scale; None: white is D65."""


def stated_light(value: Any) -> Light:
    """`value` as one of the ways to state a light's spectrum; YAML states a `Spectrum` as a mapping.

    Raises
    ------
    SceneError
        It is none of these, or a spectrum that is negative or dark.
    """
    if isinstance(value, dict) and set(value) == {"wavelengths", "values"}:
        value = Spectrum(value["wavelengths"], value["values"])
    if isinstance(value, int | float | np.number) and not isinstance(value, bool):
        value = float(value)
    if value is None:
        return None
    if not isinstance(value, str | float | Spectrum):
        raise SceneError(f"got {value!r:.60}; allowed: {', '.join(ILLUMINANTS)}, kelvin of a black body, a Spectrum")
    found = white_of(value)
    if (found.values < 0).any():
        raise SceneError(f"got {value!r:.60}, which is negative at some wavelength; allowed: a spectrum of at least 0")
    return value


def plain_light(value: Light) -> Any:
    """The same for YAML."""
    if isinstance(value, Spectrum):
        return {"wavelengths": value.wavelengths.tolist(), "values": value.values.tolist()}
    return value


def white_of(light: Light) -> Spectrum:
    """What a light of colour (1, 1, 1) sends out: the stated spectrum at luminance 1; D65 of None."""
    if isinstance(light, Spectrum):
        return light.normalised()
    if isinstance(light, float):
        return blackbody(light).normalised()
    return illuminant("D65" if light is None else light).normalised()


def shown_colour(rgb: ArrayLike, light: Light) -> NDArray[np.float64]:
    """(3,) float, linear Rec. 709: a lamp of colour `rgb` before its `light`; what is outside of the gamut is cut off.

    The colour filters the light, as its up-sampled reflectance.

    >>> shown_colour((2.0, 2.0, 2.0), "D65").round(6).tolist()
    [2.0, 2.0, 2.0]
    """
    if light is None:
        return np.asarray(rgb, dtype=np.float64)
    return np.maximum(_filtered(rgb, light) @ rgb_bar(), 0.0)


def light_rows(rgb: ArrayLike, light: Light) -> NDArray[np.float64] | None:
    """(471,) float: that light at `WAVELENGTHS`, over the sum of its red, green and blue; None where none is stated.

    Kernels know what arrives of a lamp as a colour, which is in proportion to the lamp's own.
    """
    if light is None:
        return None
    total = float(shown_colour(rgb, light).sum())
    return np.ascontiguousarray(_filtered(rgb, light) / total) if total > 0.0 else np.zeros(len(WAVELENGTHS))


def _filtered(rgb: ArrayLike, light: Light) -> NDArray[np.float64]:
    return (basis() @ np.asarray(rgb, dtype=np.float64)) * white_of(light).at(WAVELENGTHS)
