"""A measured colour: reflectance by wavelength."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray._jit import implements, kernel
from sightray.errors import SceneError
from sightray.fields import array, derived_array, derived_integer, derived_vector
from sightray.mathlib.bands import WAVELENGTHS
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, i64_at, table_at, vec3_at
from sightray.mathlib.vec import Vec3
from sightray.spectra import Spectrum
from sightray.textures.base import Texture, Where, texture_spectrum, texture_value


class SpectralColor(Texture):
    """The same reflectance spectrum everywhere, joined by straight lines and going on with its end values.

    In spectral mode each path sees it at its own wavelengths. In RGB mode it is the colour that it has under daylight
    (D65), with what lies outside of Rec. 709 cut off: two spectra of one colour, which part under another light
    (metamers), do so in spectral mode only.
    """

    wavelengths: np.ndarray = array("ascending", np.float64, unit="nm")
    reflectances: np.ndarray = array("at each, 0 to 1", np.float64)
    _samples: Any = derived_array("wavelengths and values in turn", lambda s: s.pairs())
    _count: Any = derived_integer("number of wavelengths", lambda s: len(s.wavelengths))
    _rgb: Any = derived_vector("colour under D65", lambda s: s.rgb())

    @classmethod
    def of(cls, spectrum: Spectrum) -> SpectralColor:
        """The texture of a `Spectrum`, such as ``spectra.colorchecker()["red"]``."""
        return cls(wavelengths=spectrum.wavelengths, reflectances=spectrum.values)

    @property
    def spectrum(self) -> Spectrum:
        """The reflectance."""
        return Spectrum(self.wavelengths, self.reflectances)

    def check(self) -> None:
        _ = self.spectrum  # complains about lengths and order
        if (self.reflectances < 0).any() or (self.reflectances > 1).any():
            raise SceneError("SpectralColor.reflectances: got numbers outside of 0 to 1; allowed: reflectances, 0 to 1")

    def rgb(self) -> np.ndarray:
        """(3,) float64: linear Rec. 709 under D65, at least 0."""
        return np.maximum(self.spectrum.rgb("D65"), 0.0)

    def pairs(self) -> np.ndarray:
        """(n, 2) float64: wavelength and value."""
        return np.ascontiguousarray(np.column_stack([self.wavelengths, self.reflectances]))


_, _, SAMPLES, COUNT, RGB = SpectralColor.offsets()


@implements(texture_value, SpectralColor)
def rgb_of_spectrum(texture: Table, where: Where) -> Vec3:
    return vec3_at(texture, RGB)


@implements(texture_spectrum, SpectralColor)
def spectrum_at_wavelengths(texture: Table, where: Where) -> Vec3:
    nm = vec3_at(where.bands, WAVELENGTHS)
    return Vec3(
        reflectance_at(texture, nm.x), reflectance_at(texture, nm.y), reflectance_at(texture, nm.z),
        reflectance_at(texture, nm.w),
    )  # fmt: skip


@kernel
def reflectance_at(texture: Table, nm: f64) -> f64:
    """The value at one wavelength, by a straight line between its neighbours."""
    samples, low, high = table_at(texture, SAMPLES), 0, i64_at(texture, COUNT) - 1
    if nm <= f64_at(samples, 0):
        return f64_at(samples, 1)
    if nm >= f64_at(samples, 2 * high):
        return f64_at(samples, 2 * high + 1)
    while high - low > 1:
        middle = (low + high) // 2
        if f64_at(samples, 2 * middle) <= nm:
            low = middle
        else:
            high = middle
    a, b = f64_at(samples, 2 * low), f64_at(samples, 2 * high)
    s = (nm - a) / (b - a)
    return f64_at(samples, 2 * low + 1) * (1.0 - s) + f64_at(samples, 2 * high + 1) * s
