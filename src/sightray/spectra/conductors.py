"""Complex refractive indices: metals."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sightray.errors import FormatError, SceneError, unknown
from sightray.spectra.index_page import read_page
from sightray.spectra.observer import rgb_bar, white
from sightray.spectra.spectrum import Spectrum
from sightray.spectra.tables import WAVELENGTHS, indices

METAL_ALIASES = {"aluminium": "Al", "aluminum": "Al", "copper": "Cu", "gold": "Au", "silver": "Ag"}


@dataclass(frozen=True)
class ComplexIndex:
    """The index n + i k of a conductor by wavelength: n bends light, k > 0 swallows it.

    Parameters
    ----------
    name : what it is called.
    n, k : by wavelength.
    reference : who measured it.

    Examples
    --------
    >>> from sightray.spectra import complex_index
    >>> gold = complex_index("Au")
    >>> gold.reflectance().rgb("D65").round(2).tolist()
    [1.04, 0.73, 0.36]
    """

    name: str
    n: Spectrum
    k: Spectrum
    reference: str = ""

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> ComplexIndex:
        """Read a page with a table of n and k that was downloaded from refractiveindex.info as YAML.

        Raises
        ------
        SceneError
            No such readable file.
        FormatError
            The file is not such a page.
        """
        path = Path(path)
        page = read_page(path)
        if "nk" not in page:
            raise FormatError("no table of n and k; a clear material is read by RefractiveIndex.load", path)
        return _made(path.stem, page)

    def at(self, nm: ArrayLike) -> NDArray[np.complex128]:
        """n + i k at wavelengths of any shape, nm."""
        return self.n.at(nm) + 1j * self.k.at(nm)

    def reflectance(self) -> Spectrum:
        """Share of light that is reflected at normal incidence, ((n - 1)² + k²) / ((n + 1)² + k²), by wavelength."""
        n, k = self.n.at(WAVELENGTHS), self.k.at(WAVELENGTHS)
        return Spectrum(WAVELENGTHS, normal_reflectance(n, k))

    def rgb(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(3,) n and (3,) k for linear red, green and blue: the metal where colours have three numbers.

        The n of a channel is the mean of n, weighted by what the channel sees of D65; k follows from it such that the
        reflectance at normal incidence has the metal's colour under D65. Gold and some coppers have a red of more than
        1, outside of Rec. 709's gamut; they get the most that the metal reflects between 400 and 700 nm instead.
        """
        seen = np.maximum(white()[:, np.newaxis] * rgb_bar(), 0.0)
        n = self.n.at(WAVELENGTHS) @ (seen / seen.sum(axis=0))
        spectrum = self.reflectance()
        most = spectrum.values[(WAVELENGTHS >= 400) & (WAVELENGTHS <= 700)].max()
        colour = np.clip(spectrum.rgb("D65"), 0.0, most)
        squared = (colour * (n + 1.0) ** 2 - (n - 1.0) ** 2) / (1.0 - colour)
        return n, np.sqrt(np.maximum(squared, 0.0))


def normal_reflectance(n: ArrayLike, k: ArrayLike) -> NDArray[np.float64]:
    """Reflectance at normal incidence of an index n + i k against vacuum (A. Fresnel, 1823)."""
    n, k = np.asarray(n, dtype=np.float64), np.asarray(k, dtype=np.float64)
    return ((n - 1.0) ** 2 + k * k) / ((n + 1.0) ** 2 + k * k)


def complex_index(name: str) -> ComplexIndex:
    """The complex index of a metal by its name; see `metal_names`.

    ``"Ag"``, ``"Cu"`` and ``"Au"`` are Johnson and Christy's measurements, ``"Al"`` is Rakić's; other sources have
    their author behind the name. ``"silver"``, ``"copper"``, ``"gold"`` and ``"aluminium"`` are the same.

    Raises
    ------
    SceneError
        Unknown name; the message offers the nearest one.
    """
    known = indices()
    entry = known.get(METAL_ALIASES.get(name, name))
    if entry is None or not entry["metal"]:
        hint = f"; '{name}' is clear, see refractive_index" if entry else ""
        raise SceneError(unknown("metal", str(name), [*metal_names(), *METAL_ALIASES]) + hint)
    return _made(METAL_ALIASES.get(name, name), entry)


def metal_names() -> tuple[str, ...]:
    """The names that `complex_index` knows, without other names for the same."""
    return tuple(name for name, entry in indices().items() if entry["metal"])


def _made(name: str, entry: dict[str, Any]) -> ComplexIndex:
    nm, n, k = zip(*entry["nk"], strict=True)
    return ComplexIndex(name, Spectrum(nm, n), Spectrum(nm, k), entry["reference"])
