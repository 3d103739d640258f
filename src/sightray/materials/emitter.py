"""A black surface that glows: what the lights with an area look like."""

from __future__ import annotations

from typing import Any

from sightray._jit import implements
from sightray.fields import Color, color, derived_array, derived_vector, flag, other
from sightray.materials.base import PHONG, Local, Material, emitted, glow_in_lanes, local
from sightray.materials.by_wavelength import at_bands
from sightray.mathlib.bands import as_light
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, i64_at, is_null, table_at, vec3_at
from sightray.mathlib.vec import Vec3, grey
from sightray.spectra.lighting import light_rows, plain_light, shown_colour, stated_light
from sightray.textures.base import Where


class Emitter(Material):
    """Gives off the same `radiance` in all directions and reflects nothing.

    Seen from behind it is black, unless it is `two_sided`: just as the light of a one-sided lamp falls only forwards.
    Without `spectrum` white is D65; with one, (1, 1, 1) is light of that spectrum at luminance 1.
    """

    radiance: Color = color("radiance that it gives off", default=1.0, unit="W/(m² sr)")
    two_sided: bool = flag("whether the inside of the surface glows too", default=False)
    spectrum: Any = other("illuminant's name, kelvin of a black body, or a Spectrum; None: D65", stated_light, default=None,
                          plain=plain_light)  # fmt: skip
    _shown: Any = derived_vector("radiance in RGB", lambda e: shown_colour(e.radiance, e.spectrum))
    _by_wavelength: Any = derived_array("its light by wavelength, over the sum of its colour",
                                        lambda e: light_rows(e.radiance, e.spectrum))  # fmt: skip

    @property
    def glow(self) -> float:
        return sum(self.radiance) / 3


_, TWO_SIDED, RADIANCE, BY_WAVELENGTH = Emitter.offsets()


@implements(emitted, Emitter)
def emitted_by_emitter(material: Table, where: Where, cos_view: f64) -> Vec3:
    if cos_view > 0.0 or i64_at(material, TWO_SIDED) != 0:
        return vec3_at(material, RADIANCE)
    return grey(0.0)


@implements(glow_in_lanes, Emitter)
def glow_of_emitter(material: Table, bands: Table, rgb: Vec3) -> Vec3:
    rows = table_at(material, BY_WAVELENGTH)
    if is_null(rows):
        return as_light(bands, rgb)
    return at_bands(rows, 1, 0, bands) * (rgb.x + rgb.y + rgb.z)


@implements(local, Emitter)
def local_of_emitter(material: Table, where: Where, cos_view: f64) -> Local:
    zero = grey(0.0)
    return Local(
        zero, emitted_by_emitter(material, where, cos_view), zero, zero, zero, 0.0, PHONG, zero, zero, 1.0, zero
    )
