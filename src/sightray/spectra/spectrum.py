"""`Spectrum`: a quantity by wavelength."""

from __future__ import annotations

import operator
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sightray.errors import FormatError, SceneError, unknown
from sightray.spectra.interpolation import sprague
from sightray.spectra.observer import rgb_bar, xyz_bar
from sightray.spectra.tables import WAVELENGTHS, frozen


class Spectrum:
    """A quantity by wavelength: a reflectance, the power of a light, an index. Immutable.

    Between the wavelengths the values are joined by straight lines; outside of them the end values hold, as CIE
    15:2018 recommends. Spectra and numbers can be added, subtracted, multiplied and divided; the result stands at the
    wavelengths of both.

    Parameters
    ----------
    wavelengths : (n,) float, nm, > 0, increasing.
    values : (n,) float, finite.

    Raises
    ------
    SceneError
        Lengths differ, a number is not finite, or wavelengths do not increase.

    Examples
    --------
    >>> from sightray.spectra import Spectrum
    >>> red = Spectrum([550, 650], [0.1, 0.9])
    >>> float(red.at(600)), float((2 * red).at(700))
    (0.5, 1.8)
    >>> Spectrum.constant(0.5).rgb("D65").round(6).tolist()
    [0.5, 0.5, 0.5]
    """

    __slots__ = ("values", "wavelengths")
    wavelengths: NDArray[np.float64]
    values: NDArray[np.float64]
    __array_ufunc__ = None  # array * spectrum is an error instead of an array of spectra

    def __init__(self, wavelengths: ArrayLike, values: ArrayLike):
        nm, v = _numbers("wavelengths", wavelengths), _numbers("values", values)
        if len(nm) != len(v):
            raise SceneError(f"Spectrum: {len(nm)} wavelengths and {len(v)} values; allowed: as many of both")
        if not (nm[0] > 0 and (np.diff(nm) > 0).all()):
            raise SceneError("Spectrum: wavelengths must be above 0 nm and increase from each to the next")
        object.__setattr__(self, "wavelengths", nm)
        object.__setattr__(self, "values", v)

    @classmethod
    def constant(cls, value: float) -> Spectrum:
        """The same value at all wavelengths."""
        return cls([WAVELENGTHS[0], WAVELENGTHS[-1]], [value, value])

    @classmethod
    def load(cls, path: str | os.PathLike[str], column: str | None = None) -> Spectrum:
        """Read a CSV file: a line of names, or none, then lines that begin with the wavelength in nm.

        Parameters
        ----------
        path : the file.
        column : name of the column of values; by default the second one.

        Raises
        ------
        FormatError
            A line does not hold numbers, or the numbers make no spectrum.
        SceneError
            No such readable file, or no such column.
        """
        path = Path(path)
        try:
            lines = path.read_text(encoding="utf-8-sig").splitlines()
        except (OSError, UnicodeDecodeError) as error:
            raise SceneError(f"{path}: cannot be read as text: {getattr(error, 'strerror', None) or error}") from error
        return _parsed(cls, path, lines, column)

    def at(self, nm: ArrayLike) -> NDArray[np.float64]:
        """Values at wavelengths of any shape, nm."""
        return np.asarray(np.interp(np.asarray(nm, dtype=np.float64), self.wavelengths, self.values))

    def resampled(self, wavelengths: ArrayLike = WAVELENGTHS, *, smooth: bool = False) -> Spectrum:
        """The spectrum at other wavelengths.

        With `smooth`, six or more evenly spaced values are joined by Sprague's quintic instead of straight lines, which
        is what colour computations with measurements at 10 or 20 nm want.
        """
        nm = _numbers("wavelengths", wavelengths)
        if not smooth:
            return Spectrum(nm, self.at(nm))
        steps = np.diff(self.wavelengths)
        if len(steps) < 5 or not np.allclose(steps, steps[0], rtol=1e-6):
            raise SceneError("Spectrum.resampled: smooth interpolation needs six or more evenly spaced wavelengths")
        return Spectrum(nm, sprague(self.wavelengths, self.values, nm))

    def xyz(self, illuminant: str | Spectrum | None = None) -> NDArray[np.float64]:
        """(3,) float: CIE 1931 XYZ.

        Without an illuminant the spectrum is light, and 1 at all wavelengths has Y = 1. With one (its name or its
        spectrum) it is a reflectance or a transmittance under that light, and 1 at all wavelengths has Y = 1 as well.
        """
        return self._weighed(xyz_bar(), illuminant)

    def rgb(self, illuminant: str | Spectrum | None = None) -> NDArray[np.float64]:
        """(3,) float: linear Rec. 709, unclipped: colours outside of its gamut have negative parts.

        `illuminant` as in `xyz`. Nothing adapts to the illuminant: a white surface under D65 is (1, 1, 1), and under
        light of another colour it has that colour.
        """
        return self._weighed(rgb_bar(), illuminant)

    def xy(self, illuminant: str | Spectrum | None = None) -> NDArray[np.float64]:
        """(2,) float: CIE 1931 chromaticity; NaN of darkness."""
        xyz = self.xyz(illuminant)
        with np.errstate(invalid="ignore", divide="ignore"):
            return xyz[:2] / xyz.sum()

    def normalised(self) -> Spectrum:
        """The same light at luminance Y = 1."""
        luminance = float(self.xyz()[1])
        if not luminance > 0:
            raise SceneError(f"Spectrum.normalised: the luminance is {luminance:g}; allowed: above 0")
        return self / luminance

    def _weighed(self, curves: NDArray[np.float64], illuminant: str | Spectrum | None) -> NDArray[np.float64]:
        if illuminant is None:
            return self.at(WAVELENGTHS) @ curves
        if isinstance(illuminant, str):
            from sightray.spectra.illuminants import illuminant as named

            illuminant = named(illuminant)
        return (self.at(WAVELENGTHS) * illuminant.normalised().at(WAVELENGTHS)) @ curves

    def _combined(self, other: Any, operation: Callable[[Any, Any], Any], *, swapped: bool = False) -> Spectrum:
        if isinstance(other, Spectrum):
            nm = np.union1d(self.wavelengths, other.wavelengths)
            a, b = self.at(nm), other.at(nm)
        elif isinstance(other, int | float | np.number):
            nm, a, b = self.wavelengths, self.values, np.full_like(self.values, other)
        else:
            return NotImplemented
        with np.errstate(all="ignore"):  # what is not finite is refused by the constructor
            return Spectrum(nm, operation(b, a) if swapped else operation(a, b))

    def __add__(self, other: Any) -> Spectrum:
        return self._combined(other, operator.add)

    def __radd__(self, other: Any) -> Spectrum:
        return self._combined(other, operator.add)

    def __sub__(self, other: Any) -> Spectrum:
        return self._combined(other, operator.sub)

    def __rsub__(self, other: Any) -> Spectrum:
        return self._combined(other, operator.sub, swapped=True)

    def __mul__(self, other: Any) -> Spectrum:
        return self._combined(other, operator.mul)

    def __rmul__(self, other: Any) -> Spectrum:
        return self._combined(other, operator.mul)

    def __truediv__(self, other: Any) -> Spectrum:
        return self._combined(other, operator.truediv)

    def __rtruediv__(self, other: Any) -> Spectrum:
        return self._combined(other, operator.truediv, swapped=True)

    def __neg__(self) -> Spectrum:
        return Spectrum(self.wavelengths, -self.values)

    def __eq__(self, other: Any) -> bool:
        if not isinstance(other, Spectrum):
            return NotImplemented
        return np.array_equal(self.wavelengths, other.wavelengths) and np.array_equal(self.values, other.values)

    def __hash__(self) -> int:
        return hash((self.wavelengths.tobytes(), self.values.tobytes()))

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError("Spectrum is immutable")

    def __reduce__(self) -> tuple[Any, ...]:
        return Spectrum, (self.wavelengths, self.values)

    def __repr__(self) -> str:
        nm, v = self.wavelengths, self.values
        return f"<Spectrum {nm[0]:g} to {nm[-1]:g} nm, {len(nm)} values {v.min():.4g} to {v.max():.4g}>"


def _numbers(what: str, given: ArrayLike) -> NDArray[np.float64]:
    """Own read-only (n,) float64 array of finite numbers."""
    try:
        numbers = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise SceneError(f"Spectrum: {what} {given!r}; allowed: a sequence of numbers") from None
    if numbers.ndim != 1 or not numbers.size or not np.isfinite(numbers).all():
        raise SceneError(f"Spectrum: {what} of shape {numbers.shape}; allowed: one or more finite numbers in a row")
    return frozen(numbers)


def _parsed(cls: type[Spectrum], path: Path, lines: list[str], column: str | None) -> Spectrum:
    """The spectrum in the lines of a CSV file."""
    cells = [(i, [cell.strip() for cell in line.split(",")]) for i, line in enumerate(lines, 1) if line.strip()]
    if not cells:
        raise FormatError("no spectrum in an empty file; allowed: lines of a wavelength in nm and values", path)
    names = [] if _is_number(cells[0][1][0]) else cells.pop(0)[1]
    if column is not None and column not in names[1:]:
        raise SceneError(f"{path}: {unknown('column', column, names[1:])}")
    place = 1 if column is None else names.index(column, 1)
    rows = []
    for line, row in cells:
        if len(row) <= place or not (_is_number(row[0]) and _is_number(row[place])):
            raise FormatError(f"got '{','.join(row)}'; allowed: a wavelength in nm and values, all numbers", path, line)
        rows.append((float(row[0]), float(row[place])))
    try:
        return cls([nm for nm, _ in rows], [value for _, value in rows])
    except SceneError as error:
        raise FormatError(str(error), path) from None


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
