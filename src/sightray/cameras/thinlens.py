"""A lens: what lies before or behind the plane in focus is blurred."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import implements, kernel
from sightray.cameras.base import _CORNER, _DOWN, _EYE, _RIGHT, Ray, generate_ray
from sightray.cameras.perspective import PerspectiveCamera
from sightray.errors import SceneError
from sightray.fields import derived_number, derived_vector, integer, number
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, i64_at, vec3_at
from sightray.mathlib.vec import Vec3, normalize
from sightray.mathlib.warp import concentric


class ThinLensCamera(PerspectiveCamera):
    """A perspective camera with an aperture: sharp at `focus_distance`, blurred elsewhere.

    Rays through one pixel start all over the lens and meet in one point of the plane that stands across the line of
    sight at `focus_distance`. A point at depth z is spread over a copy of the aperture whose radius in the picture is

        fy lens_radius |1/focus_distance - 1/z|  pixels, fy = height / (2 tan(vfov/2)).

    Give `lens_radius`, or `f_number` with the `focal_length`, which make it ``focal_length / (2 f_number)``; neither is a
    pinhole. The angle of view is `vfov` whatever the focus: lenses that breathe are not modelled.

    The aperture is a disk, or with `blades` a regular polygon with its corners at `lens_radius`, one of them on the
    camera's +x axis before `blade_rotation` turns it clockwise, as seen from behind the camera. The unit square of lens
    coordinates is folded onto it area for area, its middle onto the centre of the lens: `project`, `rays` and labels
    speak of the ray through the centre.

    References
    ----------
    R. Cook, T. Porter, L. Carpenter, "Distributed ray tracing", SIGGRAPH 1984; P. Shirley, K. Chiu, "A low distortion
    map between disk and square", Journal of Graphics Tools 2(3), 1997.
    """

    focus_distance: float | None = number("depth of the plane in focus; None: that of the target", default=None,
                                          above=0, optional=True, unit="m")  # fmt: skip
    lens_radius: float | None = number("radius of the aperture", default=None, at_least=0, optional=True, unit="m")
    f_number: float | None = number("focal length over the aperture's diameter", default=None, above=0, optional=True)
    focal_length: float = number("focal length, for the f-number alone", default=0.05, above=0, unit="m")
    blades: int = integer("sides of the aperture; 0: a disk", default=0, at_least=0, at_most=100)
    blade_rotation: float = number("clockwise turn of the aperture", default=0.0, unit="degrees")
    _radius: Any = derived_number("radius of the aperture, m", lambda c: c.aperture())
    _sharp: Any = derived_number("depth of the plane in focus, m", lambda c: c.in_focus())
    _turn: Any = derived_number("turn of the aperture, rad", lambda c: math.radians(c.blade_rotation))
    _across: Any = derived_vector("axis x of the camera", lambda c: c.world_from_camera()[:3, 0])
    _along: Any = derived_vector("axis y of the camera", lambda c: c.world_from_camera()[:3, 1])

    def check(self) -> None:
        super().check()
        if self.lens_radius is not None and self.f_number is not None:
            raise SceneError("ThinLensCamera.f_number: given beside lens_radius; allowed: one of them")
        if self.blades in (1, 2):
            raise SceneError(f"ThinLensCamera.blades: got {self.blades}; allowed: 0 for a disk, or at least 3")

    @property
    def has_lens(self) -> bool:
        return self.aperture() > 0.0

    def aperture(self) -> float:
        """Radius of the aperture, metres."""
        if self.f_number is not None:
            return self.focal_length / (2.0 * self.f_number)
        return 0.0 if self.lens_radius is None else self.lens_radius

    def in_focus(self) -> float:
        """Depth of the plane in focus, metres."""
        if self.focus_distance is not None:
            return self.focus_distance
        return float(np.linalg.norm(np.subtract(self.target, self.eye)))


BLADES, _, RADIUS, SHARP, TURN, ACROSS, ALONG = ThinLensCamera.offsets()[-7:]


@kernel
def place_on_lens(u: f64, v: f64, blades: i64, turn: f64) -> Vec3:
    """A place on a disk or polygon of radius 1, evenly by area; y as the camera's, down."""
    disk = concentric(u, v)
    if blades == 0:
        return disk

    # Rings of the disk become rings of the polygon: within each of its triangles the angle runs along the side.
    step = 2.0 * math.pi / blades
    side = math.atan2(disk.y, disk.x) / step
    corner = np.floor(side)
    f, first, r = side - corner, turn + step * corner, math.sqrt(disk.x * disk.x + disk.y * disk.y)
    x = (1.0 - f) * math.cos(first) + f * math.cos(first + step)
    y = (1.0 - f) * math.sin(first) + f * math.sin(first + step)
    return Vec3(r * x, r * y, 0.0)


@implements(generate_ray, ThinLensCamera)
def generate_lens_ray(camera: Table, x: f64, y: f64, lens_u: f64, lens_v: f64, time: f64) -> Ray:
    d = vec3_at(camera, _CORNER) + vec3_at(camera, _RIGHT) * x + vec3_at(camera, _DOWN) * y  # depth 1
    place = place_on_lens(lens_u, lens_v, i64_at(camera, BLADES), f64_at(camera, TURN))
    offset = (vec3_at(camera, ACROSS) * place.x + vec3_at(camera, ALONG) * place.y) * f64_at(camera, RADIUS)
    # Rays meet at eye + d * sharp; divided by its depth, the pinhole's direction stays as it is to the last bit.
    return Ray(vec3_at(camera, _EYE) + offset, normalize(d - offset / f64_at(camera, SHARP)))
