"""A measured colour: reflectance by wavelength."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray._jit import implements, kernel
from sightray.errors import SceneError, unknown
from sightray.fields import array, derived_array, derived_integer, derived_vector, other
from sightray.mathlib.bands import WAVELENGTHS
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, i64_at, table_at, vec3_at
from sightray.mathlib.vec import Vec3
from sightray.spectra import Spectrum, colorchecker
from sightray.textures.base import Texture, Where, texture_spectrum, texture_value


def _field(value: Any) -> str | None:
    """The name of one of the chart's fields, or None."""
    if value is not None and value not in colorchecker():
        raise SceneError(unknown("field of the ColorChecker", str(value), colorchecker()))
    return value


class SpectralColor(Texture):
    """The same reflectance spectrum everywhere, joined by straight lines and going on with its end values.

    In spectral mode each path sees it at its own wavelengths. In RGB mode it is the colour that it has under daylight
    (D65), with what lies outside of Rec. 709 cut off: two spectra of one colour, which part under another light
    (metamers), do so in spectral mode only. It is stated as a table, or as the name of a field of the ColorChecker
    chart (see `spectra.colorchecker`).
    """

    wavelengths: np.ndarray = array("ascending", np.float64, default=None, unit="nm")
    reflectances: np.ndarray = array("at each, 0 to 1", np.float64, default=None)
    colorchecker: str | None = other("instead of both: name of a field of the ColorChecker", _field, default=None)
    _samples: Any = derived_array("wavelengths and values in turn", lambda s: s.pairs())
    _count: Any = derived_integer("number of wavelengths", lambda s: len(s.pairs()))
    _rgb: Any = derived_vector("colour under D65", lambda s: s.rgb())

    @classmethod
    def of(cls, spectrum: Spectrum) -> SpectralColor:
        """The texture of a `Spectrum`, such as ``spectra.colorchecker()["red"]``."""
        return cls(wavelengths=spectrum.wavelengths, reflectances=spectrum.values)

    @property
    def spectrum(self) -> Spectrum:
        """The reflectance."""
        if self.colorchecker is not None:
            return colorchecker()[self.colorchecker]
        return Spectrum(self.wavelengths, self.reflectances)

    def check(self) -> None:
        stated = [name for name in ("wavelengths", "reflectances") if getattr(self, name) is not None]
        if self.colorchecker is not None:
            if stated:
                raise SceneError(f"SpectralColor.colorchecker: stated beside {stated[0]}; allowed: one of the two")
            return
        if len(stated) != 2:
            missing = "reflectances" if stated == ["wavelengths"] else "wavelengths"
            raise SceneError(
                f"SpectralColor.{missing}: missing; allowed: wavelengths and reflectances, or colorchecker"
            )
        _ = self.spectrum  # complains about lengths and order
        if (self.reflectances < 0).any() or (self.reflectances > 1).any():
            raise SceneError("SpectralColor.reflectances: got numbers outside of 0 to 1; allowed: reflectances, 0 to 1")

    def rgb(self) -> np.ndarray:
        """(3,) float64: linear Rec. 709 under D65, at least 0."""
        return np.maximum(self.spectrum.rgb("D65"), 0.0)

    def brightness(self) -> float:
        return float(self.rgb().mean())

    def pairs(self) -> np.ndarray:
        """(n, 2) float64: wavelength and value."""
        spectrum = self.spectrum
        return np.ascontiguousarray(np.column_stack([spectrum.wavelengths, spectrum.values]))


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
