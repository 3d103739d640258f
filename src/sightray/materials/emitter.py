"""A black surface that glows: what the lights with an area look like."""

from __future__ import annotations

from sightray._jit import implements
from sightray.fields import Color, color, flag
from sightray.materials.base import PHONG, Local, Material, emitted, local
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, i64_at, vec3_at
from sightray.mathlib.vec import Vec3, grey
from sightray.textures.base import Where


class Emitter(Material):
    """Gives off the same `radiance` in all directions and reflects nothing.

    Seen from behind it is black, unless it is `two_sided`: just as the light of a one-sided lamp falls only forwards.
    """

    radiance: Color = color("radiance that it gives off", default=1.0, unit="W/(m² sr)")
    two_sided: bool = flag("whether the inside of the surface glows too", default=False)

    @property
    def glow(self) -> float:
        return sum(self.radiance) / 3


RADIANCE, TWO_SIDED = Emitter.offsets()


@implements(emitted, Emitter)
def emitted_by_emitter(material: Table, where: Where, cos_view: f64) -> Vec3:
    if cos_view > 0.0 or i64_at(material, TWO_SIDED) != 0:
        return vec3_at(material, RADIANCE)
    return grey(0.0)


@implements(local, Emitter)
def local_of_emitter(material: Table, where: Where, cos_view: f64) -> Local:
    zero = grey(0.0)
    return Local(
        zero, emitted_by_emitter(material, where, cos_view), zero, zero, zero, 0.0, PHONG, zero, zero, 1.0, zero
    )
