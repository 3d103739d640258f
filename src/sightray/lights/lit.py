"""Lights of one colour, whose spectrum can be stated."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray._jit import implements
from sightray.fields import derived_array, other
from sightray.lights.base import Light, in_lanes
from sightray.materials.by_wavelength import at_bands
from sightray.mathlib.bands import as_light
from sightray.mathlib.table import Table, is_null, table_at
from sightray.mathlib.vec import Vec3
from sightray.spectra.lighting import light_rows, plain_light, shown_colour, stated_light


class _Lit(Light):
    """Base of lights that send out the same spectrum everywhere; `color_of_light` names their colour.

    Without `spectrum` white is D65, and other colours are up-sampled. With one, (1, 1, 1) is light of that spectrum at
    luminance 1, other colours filter it, and RGB mode sees its colour.
    """

    spectrum: Any = other("illuminant's name, kelvin of a black body, or a Spectrum; None: D65", stated_light, default=None,
                          plain=plain_light)  # fmt: skip
    _by_wavelength: Any = derived_array("its light by wavelength, over the sum of its colour",
                                        lambda light: light_rows(light.color_of_light(), light.spectrum))  # fmt: skip

    def color_of_light(self) -> Any:
        """The stated colour, linear Rec. 709."""
        return self.radiance  # type: ignore[attr-defined]

    def shown(self) -> np.ndarray:
        """The colour in RGB mode, (3,) float64, linear Rec. 709."""
        return shown_colour(self.color_of_light(), self.spectrum)


(BY_WAVELENGTH,) = _Lit.offsets()


@implements(in_lanes, _Lit)
def lit_in_lanes(light: Table, bands: Table, rgb: Vec3) -> Vec3:
    rows = table_at(light, BY_WAVELENGTH)
    if is_null(rows):
        return as_light(bands, rgb)
    return at_bands(rows, 1, 0, bands) * (rgb.x + rgb.y + rgb.z)
