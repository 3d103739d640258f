"""Constants of matter that change with the wavelength: tables in rows, one line for each nanometre."""

from __future__ import annotations

from sightray._jit import kernel
from sightray.mathlib.bands import SINGLE, WAVELENGTHS, ones
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, is_null
from sightray.mathlib.vec import Vec3
from sightray.spectra.sampling import FROM_NM
from sightray.spectra.tables import WAVELENGTHS as NANOMETRES

LAST = len(NANOMETRES) - 1


@kernel
def at_wavelength(table: Table, columns: i64, column: i64, nm: f64) -> f64:
    """One column of a table with a line for each of spectra's wavelengths, which stands for its nanometre."""
    return f64_at(table, min(LAST, max(0, int(nm - FROM_NM))) * columns + column)


@kernel
def at_bands(table: Table, columns: i64, column: i64, bands: Table) -> Vec3:
    """The same at the four wavelengths of a path."""
    return Vec3(
        at_wavelength(table, columns, column, f64_at(bands, WAVELENGTHS)),
        at_wavelength(table, columns, column, f64_at(bands, WAVELENGTHS + 1)),
        at_wavelength(table, columns, column, f64_at(bands, WAVELENGTHS + 2)),
        at_wavelength(table, columns, column, f64_at(bands, WAVELENGTHS + 3)),
    )


@kernel
def hero_alone(bands: Table) -> bool:
    """Whether a path has lost all of its wavelengths but the first."""
    return not is_null(bands) and f64_at(bands, SINGLE) != 0.0


@kernel
def hero_share(bands: Table) -> Vec3:
    """The weights that `hero_only` would give, for light that is looked at and not yet followed."""
    return ones(bands) if hero_alone(bands) else Vec3(4.0, 0.0, 0.0, 0.0)
