"""Box."""

from __future__ import annotations

import numpy as np

from sightray._jit import implements
from sightray.errors import SceneError
from sightray.fields import Point, derived_array, vector
from sightray.mathlib.axes import axes_across
from sightray.mathlib.hit import Hit, miss
from sightray.mathlib.scalars import f64
from sightray.mathlib.slabs import slab
from sightray.mathlib.table import Table, table_at, vec3_at
from sightray.mathlib.vec import Vec3, dot
from sightray.shapes.base import Shape, Surface, intersect, surface


def _faces(box: Box) -> np.ndarray:
    """For the faces -x +x -y +y -z +z: normal, tangent, and the affine maps from p - lower to u and to v."""
    size = np.subtract(box.upper, box.lower)
    faces = np.zeros((6, 16))
    for face in range(6):
        normal = np.eye(3)[face // 2] * (1 if face % 2 else -1)
        u, v, _ = axes_across(normal)
        for word, axis in ((8, u), (12, v)):
            faces[face, word : word + 3] = axis / size
            faces[face, word + 3] = 1.0 if axis.sum() < 0 else 0.0  # count from the upper end where the axis runs down
        faces[face, 0:3], faces[face, 4:7] = normal, u * size
    return faces


class Box(Shape):
    """All points between the corners ``lower`` and ``upper``, axis by axis; turn it with ``transform``.

    The box is the common part of three slabs; a ray enters it where it enters the last slab, and leaves it where it
    leaves the first (T. Kay and J. Kajiya, "Ray tracing complex scenes", 1986). Rays from inside hit the far wall.

    Texture coordinates: u and v in [0, 1] on each face along the axes of `Plane`: v up and u to the right as seen from
    outside; on top and bottom v runs along -z. Part number: the face, in the order -x +x -y +y -z +z.
    """

    flat = True
    lower: Point = vector("corner with the smallest coordinates", default=(-0.5, -0.5, -0.5), unit="m")
    upper: Point = vector("corner with the largest coordinates", default=(0.5, 0.5, 0.5), unit="m")
    faces = derived_array("frames of the six faces", _faces)

    def check(self) -> None:
        if not all(a < b for a, b in zip(self.lower, self.upper, strict=True)):
            raise SceneError(f"Box.upper: got {self.upper}; allowed: larger than lower {self.lower} along every axis")

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        return np.array(self.lower), np.array(self.upper)


LOWER, UPPER, FACES = Box.offsets()
FACE_WORDS, NORMAL, TANGENT, MAP_U, MAP_V = 16, 0, 4, 8, 12


@implements(intersect, Box)
def intersect_box(box: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> Hit:
    lower, upper = vec3_at(box, LOWER), vec3_at(box, UPPER)
    x, y, z = slab(lower.x, upper.x, o.x, d.x), slab(lower.y, upper.y, o.y, d.y), slab(lower.z, upper.z, o.z, d.z)
    near, far = max(x.near, y.near, z.near), min(x.far, y.far, z.far)
    if not near <= far:
        return miss()

    # A ray that runs up an axis enters through its lower face and leaves through its upper one.
    if t_min < near < t_max:
        if near == x.near:
            return Hit(near, 0 if d.x > 0.0 else 1, 0.0, 0.0)
        if near == y.near:
            return Hit(near, 2 if d.y > 0.0 else 3, 0.0, 0.0)
        return Hit(near, 4 if d.z > 0.0 else 5, 0.0, 0.0)
    if t_min < far < t_max:
        if far == x.far:
            return Hit(far, 1 if d.x > 0.0 else 0, 0.0, 0.0)
        if far == y.far:
            return Hit(far, 3 if d.y > 0.0 else 2, 0.0, 0.0)
        return Hit(far, 5 if d.z > 0.0 else 4, 0.0, 0.0)
    return miss()


@implements(surface, Box)
def surface_of_box(box: Table, hit: Hit, p: Vec3) -> Surface:
    faces, face = table_at(box, FACES), hit.prim * FACE_WORDS
    q = p - vec3_at(box, LOWER)
    map_u, map_v = vec3_at(faces, face + MAP_U), vec3_at(faces, face + MAP_V)
    u = min(1.0, max(0.0, dot(map_u, q) + map_u.w))
    v = min(1.0, max(0.0, dot(map_v, q) + map_v.w))
    n = vec3_at(faces, face + NORMAL)
    return Surface(n, n, u, v, vec3_at(faces, face + TANGENT))
