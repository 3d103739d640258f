"""What the four lanes of a colour stand for along one path: red, green and blue, or four wavelengths.

`Bands` is a small table that a path carries along: null in RGB mode. In spectral mode it holds the four wavelengths and,
at these, the values of three fixed reflectance spectra for linear Rec. 709 red, green and blue, and of white light.
A colour that was stated as RGB becomes the sum of the three, weighted (after I. Mallett, C. Yuksel, "Spectral primary
decomposition for rendering with sRGB reflectance", EGSR 2019), so what is linear in RGB stays so.
"""

from __future__ import annotations

from sightray._jit import kernel
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, f64_put, is_null, vec3_at
from sightray.mathlib.vec import Vec3, grey

WAVELENGTHS, RED, GREEN, BLUE, WHITE, SEEN, SINGLE = 0, 4, 8, 12, 16, 20, 32  # SEEN: what each lane adds to R, G, B
BANDS_WORDS = 33


@kernel
def as_reflectance(bands: Table, rgb: Vec3) -> Vec3:
    """A reflectance, or a coefficient per length, that was stated as RGB, in the path's lanes."""
    if is_null(bands):
        return rgb
    return vec3_at(bands, RED) * rgb.x + vec3_at(bands, GREEN) * rgb.y + vec3_at(bands, BLUE) * rgb.z


@kernel
def as_light(bands: Table, rgb: Vec3) -> Vec3:
    """Light that was stated as RGB, in the path's lanes: (1, 1, 1) is D65."""
    if is_null(bands):
        return rgb
    return as_reflectance(bands, rgb) * vec3_at(bands, WHITE)


@kernel
def ones(bands: Table) -> Vec3:
    """One in every lane that is in use: all four in spectral mode, three in RGB mode."""
    return Vec3(1.0, 1.0, 1.0, 0.0 if is_null(bands) else 1.0)


@kernel
def hero_wavelength(bands: Table) -> f64:
    """The wavelength that decides where a path goes, nm; that of the sodium D line (587.6) in RGB mode."""
    return 587.6 if is_null(bands) else f64_at(bands, WAVELENGTHS)


@kernel
def hero_only(bands: Table) -> Vec3:
    """Follow the first wavelength alone from here on, as where glass parts the colours: the weight of each lane.

    The first call gives 4, 0, 0, 0 and marks the path; later calls change nothing. RGB paths have no wavelengths to
    part: all ones.
    """
    if is_null(bands) or f64_at(bands, SINGLE) != 0.0:
        return grey(1.0)
    f64_put(bands, SINGLE, 1.0)
    return Vec3(4.0, 0.0, 0.0, 0.0)
