"""Ideal mirror reflection."""

from __future__ import annotations

from typing import Any

from sightray._jit import implements
from sightray.materials.base import PHONG, BsdfSample, Local, Material, Sample8, local, sample_bsdf, sample_eight
from sightray.mathlib.eights import F64x8, I64x8, Vec3x8, splat8d
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, table_at
from sightray.mathlib.vec import Vec3, grey
from sightray.textures.base import Where, constant8, textured, value_at
from sightray.textures.constant import COLOR


class Mirror(Material):
    """Throws a share `reflectance` of the light back under the angle at which it came (Euclid, Catoptrics).

    The same for every angle, and on both sides. Lights without extent do not show in it: their image is a point.
    """

    chooses = False
    reflectance: Any = textured("share of light that is reflected", default=1.0, at_most=1.0)


(REFLECTANCE,) = Mirror.offsets()


@implements(local, Mirror)
def local_of_mirror(material: Table, where: Where, cos_view: f64) -> Local:
    zero = grey(0.0)
    reflectance = value_at(table_at(material, REFLECTANCE), where)
    return Local(reflectance, zero, zero, zero, zero, 0.0, PHONG, reflectance, zero, 1.0, zero)


@implements(sample_bsdf, Mirror)
def sample_mirror(material: Table, where: Where, wo: Vec3, u: f64, v: f64, choice: f64) -> BsdfSample:
    return BsdfSample(Vec3(-wo.x, -wo.y, wo.z), value_at(table_at(material, REFLECTANCE), where), 0.0)


@implements(sample_eight, Mirror)
def sample_mirror_eight(material: Table, rows: I64x8, wo: Vec3x8, u: F64x8, v: F64x8, choice: F64x8) -> Sample8:
    return Sample8(Vec3x8(-wo.x, -wo.y, wo.z), constant8(material, rows, REFLECTANCE, COLOR), splat8d(0.0))
