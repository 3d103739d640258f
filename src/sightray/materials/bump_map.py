"""Fine relief as a field of heights."""

from __future__ import annotations

from typing import Any

from sightray._jit import implements, kernel
from sightray.fields import number
from sightray.materials.base import Way, bent_normal
from sightray.materials.data import data, number_at
from sightray.materials.normal_map import on_top
from sightray.materials.wrapper import INNER, _Wrapper
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, table_at
from sightray.mathlib.vec import Vec3, normalize
from sightray.textures.base import Where

STEP = 5e-4  # of u and v, for rays without width


class BumpMap(_Wrapper):
    """Bends the shading normal as if the surface were raised by ``scale * height`` metres.

    Differences of heights half a footprint of the ray, but at least 1/2000 of u, to each side give the slopes. A unit of v
    counts as long on the surface as a unit of u. A texture that fills space, such as solid noise, is followed along the
    surface. Relief changes how light is answered, not where the surface is: outlines and shadows stay.

    Reference: J. F. Blinn, "Simulation of wrinkled surfaces", SIGGRAPH 1978.
    """

    height: Any = data("texture of heights: its red")
    scale: float = number("metres per unit of height; negative digs in", default=0.01, unit="m")

    @property
    def bumpy(self) -> bool:
        return True


_, HEIGHT, SCALE = BumpMap.offsets()


@implements(bent_normal, BumpMap)
def bent_normal_of_heights(material: Table, where: Where, way: Way) -> Vec3:
    below = bent_normal(table_at(material, INNER), where, way)
    if not way.stretch > 0.0:
        return below
    texture, step = table_at(material, HEIGHT), max(STEP, 0.5 * where.width)
    steep = f64_at(material, SCALE) / (2.0 * step * way.stretch)
    along = number_at(texture, moved(where, way, step, 0.0)) - number_at(texture, moved(where, way, -step, 0.0))
    across = number_at(texture, moved(where, way, 0.0, step)) - number_at(texture, moved(where, way, 0.0, -step))
    return on_top(normalize(Vec3(-along * steep, -across * steep, 1.0)), below)


@kernel
def moved(where: Where, way: Way, du: f64, dv: f64) -> Where:
    """A place a little further on in u and v, and in space."""
    p = where.p + way.along * du + way.across * dv
    return Where(where.u + du, where.v + dv, p, where.normal, where.width, where.bands)
