"""The contract of materials.

For Whitted's model (T. Whitted, "An improved illumination model for shaded display", CACM 1980) a material describes
in `local` how its surface answers light at one point:

    I = emission + ambient * I_ambient + sum over lights of V * L * (diffuse * max(n.l, 0) + highlight)
        + mirror * I_reflected + transmission * I_refracted

`diffuse` multiplies irradiance, so a Lambertian surface states albedo / pi. The highlight is
``specular * cos^shininess`` of the angle between the viewer and the mirrored light (Phong) or between the normal and
the half vector (Blinn).
"""

from __future__ import annotations

from typing import NamedTuple

from sightray._jit import method
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table
from sightray.mathlib.vec import Vec3
from sightray.registry import Member
from sightray.textures.base import Where

PHONG, BLINN = 0, 1


class Local(NamedTuple):
    """How a surface answers light at a point, in Whitted's terms; see the formula of this module."""

    color: Vec3  # plain colour, as ray casting without lights shows it
    emission: Vec3
    ambient: Vec3
    diffuse: Vec3
    specular: Vec3
    shininess: f64
    highlight: i64  # PHONG or BLINN
    mirror: Vec3
    transmission: Vec3
    eta: f64  # refractive index before the surface over the one behind it, along the ray
    absorption: Vec3  # of the medium that the ray came through, per metre


class Material(Member, family="materials"):
    """Base of all materials."""


@method(0)
def local(material: Table, where: Where, cos_view: f64) -> Local:
    """The surface's answer at a place. `cos_view`: viewer and outward normal; negative when seen from inside."""
    raise NotImplementedError
