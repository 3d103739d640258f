"""A black surface that glows: what the lights with an area look like."""

from __future__ import annotations

from sightray._jit import implements
from sightray.fields import Color, color, flag
from sightray.materials.base import PHONG, Local, Material, local
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, i64_at, vec3_at
from sightray.mathlib.vec import grey
from sightray.textures.base import Where


class Emitter(Material):
    """Gives off the same `radiance` in all directions and reflects nothing.

    Seen from behind it is black, unless it is `two_sided`: just as the light of a one-sided lamp falls only forwards.
    """

    radiance: Color = color("radiance that it gives off", default=1.0, unit="W/(m² sr)")
    two_sided: bool = flag("whether the inside of the surface glows too", default=False)


RADIANCE, TWO_SIDED = Emitter.offsets()


@implements(local, Emitter)
def local_of_emitter(material: Table, where: Where, cos_view: f64) -> Local:
    zero = grey(0.0)
    emission = zero
    if cos_view > 0.0 or i64_at(material, TWO_SIDED) != 0:
        emission = vec3_at(material, RADIANCE)
    return Local(zero, emission, zero, zero, zero, 0.0, PHONG, zero, zero, 1.0, zero)
