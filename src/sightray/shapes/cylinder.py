"""Cylinder."""

from __future__ import annotations

from sightray.fields import number
from sightray.shapes.tapered import _Tapered


class Cylinder(_Tapered):
    """All points within ``radius`` of the axis from ``base`` to ``top``: a can, or a tube if not ``capped``.

    In axes with z along the cylinder's, the ray p + t q is inside the endless cylinder where
    ``(q_x² + q_y²) t² + 2 (p_x q_x + p_y q_y) t + p_x² + p_y² - r² <= 0``, and between the caps where ``|z| <= h/2``.
    It hits where the common interval begins and ends (`shapes.tapered`). Normals point away from the axis, also on an
    open tube.

    Texture coordinates: u runs once around the axis, counter-clockwise seen from above the top, starting at the u axis
    of `Plane` for the axis as normal; v from base (0) to top (1). On caps, v runs from the centre (0) to the rim (1).
    Part number: 0 side, 1 base, 2 top.
    """

    radius: float = number("radius", default=1.0, above=0, unit="m")

    def radii(self) -> tuple[float, float]:
        return self.radius, self.radius
