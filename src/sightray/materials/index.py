"""Refractive indices of clear materials: one number, or one for each wavelength."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray._jit import kernel
from sightray.fields import REQUIRED, Number, Packer
from sightray.materials.by_wavelength import at_bands, at_wavelength
from sightray.mathlib.bands import hero_wavelength
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, is_null, link, table_at
from sightray.mathlib.vec import Vec3, grey
from sightray.spectra import WAVELENGTHS, RefractiveIndex, refractive_index


class Index(Number):
    """A number, the name of a measured material, or a `RefractiveIndex`.

    Kernels see two words: the index at the d line (587.56 nm), and a table by wavelength where it changes with it.
    """

    words = 2

    def convert(self, value: Any) -> Any:
        if isinstance(value, str):
            refractive_index(value)
            return value
        return value if isinstance(value, RefractiveIndex) else super().convert(value)

    def pack(self, row: Table, word: int, value: Any, packer: Packer) -> None:
        super().pack(row, word, nominal(value), packer)
        table = None if isinstance(value, float) else np.ascontiguousarray(_measured(value).at(WAVELENGTHS))
        link(row, word + 1, None if table is None else packer.space.array(table))

    def allowed(self) -> str:
        return f"{super().allowed()}, the name of a glass such as 'N-BK7', or a RefractiveIndex"


def index(doc: str, default: Any = REQUIRED, **bounds: Any) -> Any:
    """A refractive index, with optional bounds on what is given as a number."""
    return Index(doc, default, **bounds)


def nominal(value: Any) -> float:
    """The index at the d line."""
    return value if isinstance(value, float) else _measured(value).index


def _measured(value: Any) -> RefractiveIndex:
    return refractive_index(value) if isinstance(value, str) else value


@kernel
def disperses(row: Table, word: i64, bands: Table) -> bool:
    """Whether the colours of a path part at this surface."""
    return not is_null(bands) and not is_null(table_at(row, word + 1))


@kernel
def index_at(row: Table, word: i64, bands: Table) -> f64:
    """The index that decides where a path goes."""
    if not disperses(row, word, bands):
        return f64_at(row, word)
    return at_wavelength(table_at(row, word + 1), 1, 0, hero_wavelength(bands))


@kernel
def indices_at(row: Table, word: i64, bands: Table) -> Vec3:
    """The index for each lane of colour."""
    if not disperses(row, word, bands):
        return grey(f64_at(row, word))
    return at_bands(table_at(row, word + 1), 1, 0, bands)
