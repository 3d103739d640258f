"""A black surface that glows: what the lights with an area look like."""

from __future__ import annotations

from typing import Any

from sightray._jit import implements
from sightray.fields import derived_array, derived_child, derived_vector, flag, other
from sightray.materials.base import PHONG, Local, Material, Sample8, emitted, glow_in_lanes, local, sample_eight
from sightray.materials.by_wavelength import at_bands
from sightray.mathlib.bands import as_light
from sightray.mathlib.eight_paths import grey8
from sightray.mathlib.eights import F64x8, I64x8, Vec3x8, splat8d
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, i64_at, is_null, table_at, vec3_at
from sightray.mathlib.vec import Vec3, dot, grey
from sightray.spectra.lighting import light_rows, plain_light, shown_colour, stated_light
from sightray.textures.base import Texture, Where, texture_value, textured


class Emitter(Material):
    """Gives off the same `radiance` in all directions and reflects nothing.

    Seen from behind it is black, unless it is `two_sided`: just as the light of a one-sided lamp falls only forwards.
    Without `spectrum` white is D65; with one, (1, 1, 1) is light of that spectrum at luminance 1. `radiance` may be a
    texture, such as the picture of a screen; where a `spectrum` is stated, all of it has that, and its luminance counts.
    """

    chooses = False
    radiance: Any = textured("radiance that it gives off, W/(m² sr)", default=1.0, packed=False)
    two_sided: bool = flag("whether the inside of the surface glows too", default=False)
    spectrum: Any = other("illuminant's name, kelvin of a black body, or a Spectrum; None: D65", stated_light, default=None,
                          plain=plain_light)  # fmt: skip
    _shown: Any = derived_vector("radiance in RGB, or what a texture is multiplied by",
                                 lambda e: shown_colour(e.colour(), e.spectrum))  # fmt: skip
    _by_wavelength: Any = derived_array("its light by wavelength, over the sum of its colour",
                                        lambda e: light_rows(e.colour(), e.spectrum))  # fmt: skip
    _picture: Any = derived_child("texture of the radiance, if it is one",
                                  lambda e: e.radiance if isinstance(e.radiance, Texture) else None)  # fmt: skip

    def colour(self) -> tuple[float, float, float]:
        """The stated colour; white for a texture."""
        return (1.0, 1.0, 1.0) if isinstance(self.radiance, Texture) else self.radiance

    @property
    def glow(self) -> float:
        return self.radiance.brightness() if isinstance(self.radiance, Texture) else sum(self.radiance) / 3

    @property
    def painted_glow(self) -> Any:
        return self.radiance if isinstance(self.radiance, Texture) else None


TWO_SIDED, RADIANCE, BY_WAVELENGTH, PICTURE = Emitter.offsets()


@implements(emitted, Emitter)
def emitted_by_emitter(material: Table, where: Where, cos_view: f64) -> Vec3:
    if cos_view <= 0.0 and i64_at(material, TWO_SIDED) == 0:
        return grey(0.0)
    picture = table_at(material, PICTURE)
    if is_null(picture):
        return vec3_at(material, RADIANCE)
    painted = texture_value(picture, where)
    if not is_null(table_at(material, BY_WAVELENGTH)):
        painted = grey(dot(painted, Vec3(0.2126, 0.7152, 0.0722)))  # luminance of linear Rec. 709
    return painted * vec3_at(material, RADIANCE)


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


@implements(sample_eight, Emitter)
def sample_emitter_eight(material: Table, rows: I64x8, wo: Vec3x8, u: F64x8, v: F64x8, choice: F64x8) -> Sample8:
    return Sample8(wo, grey8(0.0), splat8d(0.0))
