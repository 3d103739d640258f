"""Which wavelengths a path sees, and what colour that is.

A path follows four wavelengths at once. The first, the hero, decides where it goes; the others, a quarter of the
probability further on each, are carried along, so that one path sees most of a colour (A. Wilkie, S. Nawaz, M. Droske,
A. Weidlich, J. Hanika, "Hero wavelength spectral sampling", EGSR 2014).
"""

from __future__ import annotations

import math

from sightray._jit import kernel
from sightray.mathlib.bands import BLUE, GREEN, RED, SEEN, SINGLE, WAVELENGTHS, WHITE
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, f64_put, vec3_at
from sightray.mathlib.vec import Vec3, mean4
from sightray.spectra.sampling import CENTRE, FROM_NM, LOW, SPAN, STEEPNESS

COLUMNS, LAST_ROW = 8, 470  # of the table of bands, which spectra/upsampling.py describes
IN_R, IN_G, IN_B, IN_WHITE, R_BAR = 0, 1, 2, 3, 4


@kernel
def choose_bands(table: Table, u: f64, bands: Table) -> None:
    """Fill `bands` with four wavelengths, by one number in [0, 1), and all that depends on them."""
    for lane in range(4):
        part = u + 0.25 * lane
        s = LOW + (part - math.floor(part)) * SPAN
        nm = CENTRE + math.log((1.0 + s) / (1.0 - s)) / (2.0 * STEEPNESS)
        slope = math.cosh(STEEPNESS * (nm - CENTRE))
        density = STEEPNESS / (SPAN * slope * slope)
        row = COLUMNS * min(LAST_ROW, max(0, int(nm - FROM_NM)))
        f64_put(bands, WAVELENGTHS + lane, nm)
        f64_put(bands, RED + lane, f64_at(table, row + IN_R))
        f64_put(bands, GREEN + lane, f64_at(table, row + IN_G))
        f64_put(bands, BLUE + lane, f64_at(table, row + IN_B))
        f64_put(bands, WHITE + lane, f64_at(table, row + IN_WHITE))
        for channel in range(3):
            f64_put(bands, SEEN + 4 * channel + lane, f64_at(table, row + R_BAR + channel) / density)
    f64_put(bands, SINGLE, 0.0)


@kernel
def seen_colour(bands: Table, radiance: Vec3) -> Vec3:
    """Linear Rec. 709 of the radiance at the four wavelengths; single samples may lie outside of the gamut."""
    r = mean4(radiance * vec3_at(bands, SEEN))
    g = mean4(radiance * vec3_at(bands, SEEN + 4))
    b = mean4(radiance * vec3_at(bands, SEEN + 8))
    return Vec3(r, g, b)
