"""Light by wavelength: spectra, their colours, illuminants, refractive indices.

>>> from sightray import spectra
>>> spectra.illuminant("A").normalised().rgb().round(2).tolist()
[1.85, 0.83, 0.23]
>>> spectra.colorchecker()["white 9.5 (.05 D)"].rgb("D65").round(2).tolist()
[0.92, 0.92, 0.87]
>>> round(float(spectra.refractive_index("diamond").at(587.6)), 3)
2.417

Wavelengths are in nanometres, in vacuum or air as the sources have them. What kernels read comes from
`upsampling.band_table` and `sampling`.
"""

from sightray.spectra.colorchecker import colorchecker
from sightray.spectra.conductors import ComplexIndex, complex_index, metal_names
from sightray.spectra.illuminants import ILLUMINANTS, blackbody, daylight, illuminant
from sightray.spectra.observer import rgb_bar, rgb_from_xyz, white, xyz_bar, xyz_from_rgb
from sightray.spectra.refraction import RefractiveIndex, index_names, refractive_index
from sightray.spectra.sampling import hero_wavelengths, sample_wavelength, wavelength_density
from sightray.spectra.spectrum import Spectrum
from sightray.spectra.tables import WAVELENGTHS
from sightray.spectra.upsampling import band_table, basis, emission, reflectance

__all__ = [
    "ILLUMINANTS",
    "WAVELENGTHS",
    "ComplexIndex",
    "RefractiveIndex",
    "Spectrum",
    "band_table",
    "basis",
    "blackbody",
    "colorchecker",
    "complex_index",
    "daylight",
    "emission",
    "hero_wavelengths",
    "illuminant",
    "index_names",
    "metal_names",
    "reflectance",
    "refractive_index",
    "rgb_bar",
    "rgb_from_xyz",
    "sample_wavelength",
    "wavelength_density",
    "white",
    "xyz_bar",
    "xyz_from_rgb",
]
