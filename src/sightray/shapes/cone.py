"""Cone."""

from __future__ import annotations

from sightray.errors import SceneError
from sightray.fields import number
from sightray.shapes.tapered import _Tapered


class Cone(_Tapered):
    """A body whose radius changes evenly from ``base_radius`` to ``top_radius``: a cone, or a truncated one.

    In axes with z along the cone's and ``r(z) = r_m + k z``, the ray p + t q is inside the endless double cone where
    ``a t² + 2 b t + c <= 0`` with ``a = q_x² + q_y² - k² q_z²``, ``b = p_x q_x + p_y q_y - k q_z r(p_z)`` and
    ``c = p_x² + p_y² - r(p_z)²``. Its sign tells how: a > 0 passes one nappe from side to side, a < 0 goes from one
    nappe into the other, a = 0 runs parallel to the side. The common interval with ``|z| <= h/2`` keeps the right nappe
    (`shapes.tapered`). Normals point outward, also if not ``capped``; at the apex, along the axis.

    Texture coordinates: u runs once around the axis, counter-clockwise seen from above the top, starting at the u axis
    of `Plane` for the axis as normal; v from base (0) to top (1). On caps, v runs from the centre (0) to the rim (1).
    Part number: 0 side, 1 base, 2 top.
    """

    base_radius: float = number("radius at the base", default=1.0, at_least=0, unit="m")
    top_radius: float = number("radius at the top", default=0.0, at_least=0, unit="m")

    def check(self) -> None:
        super().check()
        if self.base_radius == 0.0 and self.top_radius == 0.0:
            raise SceneError("Cone.base_radius: got 0; allowed: more than 0 where top_radius is 0")

    def radii(self) -> tuple[float, float]:
        return self.base_radius, self.top_radius
