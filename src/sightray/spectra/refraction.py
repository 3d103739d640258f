"""Refractive indices of what is clear: glasses, water, diamond."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sightray.errors import FormatError, SceneError, UnsupportedError, unknown
from sightray.spectra.index_page import read_page
from sightray.spectra.spectrum import Spectrum
from sightray.spectra.tables import indices

D_LINE, F_LINE, C_LINE = 587.5618, 486.1327, 656.2725
"""Helium d, hydrogen F and C, nm: the lines that glasses are named by."""
ALIASES = {"BK7": "N-BK7", "C": "diamond", "SiO2": "fused silica", "Al2O3": "sapphire", "H2O": "water"}
CLEAR = Spectrum.constant(0.0)
FORMULAS = {1: "Sellmeier", 2: "Sellmeier, squared resonances", 3: "polynomial", 5: "Cauchy"}
"""The dispersion formulas that are known, by their numbers at refractiveindex.info."""


@dataclass(frozen=True)
class RefractiveIndex:
    """The refractive index of a clear material by wavelength.

    With w the wavelength in micrometres and c the coefficients, the formulas are, by their numbers at
    refractiveindex.info:

    1. ``n² = 1 + c0 + Σ c1 w² / (w² - c2²) + ...``  (W. Sellmeier, 1871)
    2. ``n² = 1 + c0 + Σ c1 w² / (w² - c2) + ...``
    3. ``n² = c0 + Σ c1 w^c2 + ...``
    5. ``n = c0 + Σ c1 w^c2 + ...``  (A.-L. Cauchy, 1836)

    The sums run over pairs of coefficients. Outside of the measured range formulas go on and tables hold their ends.

    Parameters
    ----------
    name : what it is called.
    formula : 1, 2, 3 or 5; or 0 for a table.
    coefficients : of the formula, an odd number of them.
    measured : (2,) nm, where it was measured.
    table : index by wavelength where there is no formula.
    extinction : k, the imaginary part of the index, by wavelength; 0 where it is not given.
    reference : who measured it.

    Examples
    --------
    >>> from sightray.spectra import refractive_index
    >>> bk7 = refractive_index("N-BK7")
    >>> round(float(bk7.at(587.6)), 4), round(bk7.abbe, 2)
    (1.5168, 64.17)
    """

    name: str
    formula: int
    coefficients: tuple[float, ...]
    measured: tuple[float, float]
    table: Spectrum | None = None
    extinction: Spectrum = CLEAR
    reference: str = ""

    @classmethod
    def cauchy(cls, a: float, b: float, c: float = 0.0) -> RefractiveIndex:
        """``n = a + b / w² + c / w⁴`` with w the wavelength in micrometres."""
        return cls("cauchy", 5, (a, b, -2.0, c, -4.0), (360.0, 830.0))

    @classmethod
    def from_abbe(cls, index: float, abbe: float) -> RefractiveIndex:
        """Cauchy's formula of two terms for an index at the d line, above 1, and an Abbe number, above 0.

        The Abbe number is (n_d - 1) / (n_F - n_C): the lower, the more glass parts the colours.
        """
        if not (index > 1 and abbe > 0):
            raise SceneError(f"from_abbe: index {index!r}, abbe {abbe!r}; allowed: above 1, and above 0")
        b = (index - 1.0) / abbe / ((1000.0 / F_LINE) ** 2 - (1000.0 / C_LINE) ** 2)
        return cls.cauchy(index - b * (1000.0 / D_LINE) ** 2, b)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> RefractiveIndex:
        """Read a page that was downloaded from refractiveindex.info as YAML.

        Raises
        ------
        SceneError
            No such readable file.
        FormatError
            The file is not such a page.
        UnsupportedError
            It uses a formula other than 1, 2, 3 and 5.
        """
        path = Path(path)
        page = read_page(path)
        if "nk" not in page and "n" not in page and "formula" not in page:
            raise FormatError("neither a formula nor a table of n", path)
        return _made(path.stem, page)

    def at(self, nm: ArrayLike) -> NDArray[np.float64]:
        """The index at wavelengths of any shape, nm."""
        if self.table is not None:
            return self.table.at(nm)
        w = np.asarray(nm, dtype=np.float64) / 1000.0
        first, a, b = self.coefficients[0], self.coefficients[1::2], self.coefficients[2::2]
        with np.errstate(all="ignore"):
            if self.formula in (1, 2):
                resonances = [c * c for c in b] if self.formula == 1 else b
                found = np.sqrt(1.0 + first + sum(s * w * w / (w * w - r) for s, r in zip(a, resonances, strict=True)))
            else:
                found = first + sum((s * w**power for s, power in zip(a, b, strict=True)), np.zeros_like(w))
                found = np.sqrt(found) if self.formula == 3 else found
        if not (np.isfinite(found) & (found > 0)).all():
            raise SceneError(f"{self.name}: no index at {nm!r} nm; its formula holds for {self._range()}")
        return np.asarray(found)

    def absorption(self, nm: ArrayLike) -> NDArray[np.float64]:
        """The absorption coefficient 4 π k / λ, 1/m, at wavelengths of any shape, nm."""
        return 4.0 * np.pi * self.extinction.at(nm) / (np.asarray(nm, dtype=np.float64) * 1e-9)

    @property
    def index(self) -> float:
        """The index at the d line, 587.56 nm: what is meant by a glass's index without further words."""
        return float(self.at(D_LINE))

    @property
    def abbe(self) -> float:
        """The Abbe number (n_d - 1) / (n_F - n_C)."""
        return float((self.at(D_LINE) - 1.0) / (self.at(F_LINE) - self.at(C_LINE)))

    def _range(self) -> str:
        return f"{self.measured[0]:g} to {self.measured[1]:g} nm"

    def __repr__(self) -> str:
        return f"<RefractiveIndex {self.name}: {self.index:.5f} at 587.6 nm, measured {self._range()}>"


def refractive_index(name: str) -> RefractiveIndex:
    """The index of a glass, or of another clear material, by its name; see `index_names`.

    Raises
    ------
    SceneError
        Unknown name; the message offers the nearest one.
    """
    known = indices()
    entry = known.get(ALIASES.get(name, name))
    if entry is None or entry["metal"]:
        hint = f"; '{name}' is a metal, see complex_index" if entry else ""
        raise SceneError(unknown("refractive index", str(name), [*index_names(), *ALIASES]) + hint)
    return _made(ALIASES.get(name, name), entry)


def index_names() -> tuple[str, ...]:
    """The names that `refractive_index` knows, without other names for the same."""
    return tuple(name for name, entry in indices().items() if not entry["metal"])


def _made(name: str, entry: dict[str, Any]) -> RefractiveIndex:
    """An index of what is known: a formula or a table, and extinctions."""
    losses = entry.get("k", entry.get("nk"))
    extinction = Spectrum([row[0] for row in losses], [row[-1] for row in losses]) if losses else CLEAR
    if "formula" not in entry:
        rows = entry["nk"] if "nk" in entry else entry["n"]
        table = Spectrum([row[0] for row in rows], [row[1] for row in rows])
        return RefractiveIndex(name, 0, (), (rows[0][0], rows[-1][0]), table, extinction, entry["reference"])
    formula, coefficients = entry["formula"], tuple(entry["coefficients"])
    if formula not in FORMULAS:
        known = ", ".join(f"{number} ({words})" for number, words in FORMULAS.items())
        raise UnsupportedError(f"{name}: dispersion formula {formula}; known: {known}")
    if len(coefficients) % 2 == 0:
        raise FormatError(f"{name}: {len(coefficients)} coefficients; formula {formula} needs an odd number of them")
    return RefractiveIndex(name, formula, coefficients, tuple(entry["range"]), None, extinction, entry["reference"])
