"""Where a medium begins and ends, and nothing else is: the edge of a cloud."""

from __future__ import annotations

from typing import Any

from sightray._jit import implements
from sightray.fields import child, derived_vector
from sightray.materials.base import PHONG, BsdfSample, Local, Material, interior, local, sample_bsdf
from sightray.mathlib.bands import ones
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, table_at, vec3_at
from sightray.mathlib.vec import Vec3, grey
from sightray.media.homogeneous import HomogeneousMedium
from sightray.textures.base import Where


def _stain(boundary: Any) -> tuple[float, float, float]:
    """What Whitted's model, which cannot scatter, knows of the medium: its absorption, 1/m."""
    inside = boundary.interior
    return inside.absorption if isinstance(inside, HomogeneousMedium) else (0.0, 0.0, 0.0)


class Boundary(Material):
    """An invisible surface around a medium: light passes straight through, and goes on inside of `interior`.

    A box or sphere with it is a cloud of fog or smoke. It neither reflects nor bends light. Shapes must be closed.
    """

    interior: Any = child("the medium inside", "media")
    _stain: Any = derived_vector("its absorption as Whitted's model sees it", _stain)

    @property
    def filled(self) -> bool:
        return True

    @property
    def clear(self) -> bool:
        return True


INSIDE, STAIN = Boundary.offsets()


@implements(local, Boundary)
def local_of_boundary(material: Table, where: Where, cos_view: f64) -> Local:
    zero = grey(0.0)
    absorption = vec3_at(material, STAIN) if cos_view < 0.0 else zero
    return Local(zero, zero, zero, zero, zero, 0.0, PHONG, zero, Vec3(1.0, 1.0, 1.0), 1.0, absorption)


@implements(sample_bsdf, Boundary)
def pass_straight(material: Table, where: Where, wo: Vec3, u: f64, v: f64, choice: f64) -> BsdfSample:
    return BsdfSample(-wo, ones(where.bands), 0.0)


@implements(interior, Boundary)
def interior_of_boundary(material: Table) -> Table:
    return table_at(material, INSIDE)
