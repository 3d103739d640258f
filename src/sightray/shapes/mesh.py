"""Mesh."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from sightray._jit import METHOD_SLOTS, implements, kernel
from sightray.bvh.few import FEW_WORDS, any_in_mesh, closest_in_mesh, pack_few
from sightray.bvh.packets import any_rays, closest_rays
from sightray.bvh.refit import expected_cost, refit_mesh
from sightray.bvh.triangles import MeshTree, build_mesh, pack_mesh
from sightray.errors import SceneError
from sightray.fields import REQUIRED, Derived, Field, array
from sightray.mathlib.hit import Hit
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, i32_at, is_null, table_at
from sightray.mathlib.vec import Vec3, cross, dot, grey
from sightray.shapes.base import (
    Shape,
    Surface,
    any_in_packets,
    closest_in_packets,
    handedness,
    intersect,
    occluded,
    rise,
    surface,
)

WORN = 0.5  # quality of a refitted tree below which another one should be built
_SLIVER = 1e-15  # twice the area over the longest edge squared, up to which three corners count as on one line


class _TreeHead(Field):
    """The words in front of a mesh's row that rays read: the tree, its blocks, the triangles."""

    words = FEW_WORDS - METHOD_SLOTS

    def pack(self, row: Table, word: int, value: Any, packer: Any) -> None:
        pack_mesh(packer.space, row, value)
        pack_few(packer.space, row, value)


class Mesh(Shape):
    """Triangles over shared vertices.

    Rays find the nearest triangle through a tree of boxes (`bvh.triangles`); the tree is built once for each
    Mesh, when it is first rendered, and shared by all scenes and instances that show it. Two triangles that share an
    edge leave no gap. ``faces`` runs counter-clockwise seen from the outer side: the geometric normal is
    (b - a) × (c - a). With ``normals``, shading uses their mean weighted by the barycentric coordinates (B. Phong,
    "Illumination for computer generated pictures", 1975); without, the geometric normal.

    Texture coordinates: the weighted mean of ``uvs``, with the tangent along growing u; without ``uvs``, the
    barycentric weights of the second and third corner. Part number: the row of ``faces``.

    Triangles without area, and those that name a vertex twice, are dropped with a warning; ``faces`` holds the others,
    and ``dropped`` the number that went.
    """

    tree_head = Derived("tree over the triangles", lambda mesh: mesh.tree(), _TreeHead)
    vertices: np.ndarray = array("(n, 3) points", np.float64, columns=3, unit="m")
    faces: np.ndarray = array("(m, 3) vertex numbers, from 0", np.int32, columns=3)
    normals: np.ndarray | None = array("(n, 3) normals at the vertices", np.float64, columns=3, default=None)
    uvs: np.ndarray | None = array("(n, 2) texture coordinates at the vertices", np.float64, columns=2, default=None)

    dropped: int

    def check(self) -> None:
        n = len(self.vertices)
        for name in ("normals", "uvs"):
            values = getattr(self, name)
            if values is not None and len(values) != n:
                raise SceneError(f"Mesh.{name}: got {len(values)} rows; allowed: one for each of the {n} vertices")
        if self.faces.size and not 0 <= self.faces.min() <= self.faces.max() < n:
            bad = int(np.flatnonzero(((self.faces < 0) | (self.faces >= n)).any(axis=1))[0])
            raise SceneError(f"Mesh.faces: row {bad}: got {self.faces[bad].tolist()}; allowed: numbers 0 to {n - 1}")

        keep = _have_area(self.vertices, self.faces)
        object.__setattr__(self, "dropped", int(len(keep) - keep.sum()))
        if not keep.any():
            raise SceneError(f"Mesh.faces: got {len(keep)} triangles, none with an area; allowed: at least one")
        if self.dropped:
            kept = np.ascontiguousarray(self.faces[keep])
            kept.flags.writeable = False
            object.__setattr__(self, "faces", kept)
            warnings.warn(f"Mesh: {self.dropped} triangles without area were dropped", stacklevel=4)

    @classmethod
    def joined(cls, vertices: np.ndarray, faces: np.ndarray) -> Mesh:
        """A mesh of triangles that are known to be good: nothing is checked or dropped, so their numbers stay."""
        mesh = object.__new__(cls)
        values = {name: field.convert(field.default) for name, field in cls.given.items() if field.default is not REQUIRED}
        for name, value in {**values, "vertices": vertices, "faces": faces.astype(np.int32), "dropped": 0}.items():
            object.__setattr__(mesh, name, value)
        return mesh

    def tree(self) -> MeshTree:
        """The tree and the packed triangles, built on the first call."""
        if "_tree" not in vars(self):
            object.__setattr__(self, "_tree", build_mesh(*self._used()))
        return vars(self)["_tree"]

    def with_vertices(self, vertices: Any, normals: Any = None) -> Mesh:
        """The same triangles over vertices that have moved, for meshes that bend from frame to frame.

        The tree is refitted (`bvh.refit`), which is several times as fast as building it; hits are those of
        ``mesh.replace(vertices=...)``. Where vertices wander far from their neighbours rays become slower: `tree_quality`
        tells how much. No triangle is dropped: those that have lost their area keep their number and are not met.

        Parameters
        ----------
        vertices : (n, 3) floats, m
            As many as the mesh has.
        normals : (n, 3) floats
            At the moved vertices; needed if the mesh has any.

        Raises
        ------
        SceneError
            If the arrays have another shape, hold numbers that are not finite, or normals are missing.

        Warns
        -----
        UserWarning
            If `tree_quality` has fallen below 0.5.
        """
        if (normals is None) != (self.normals is None):
            got = "missing, and the mesh has some" if normals is None else "given, and the mesh has none"
            raise SceneError(f"Mesh.with_vertices: normals: {got}; .replace(vertices=..., normals=...) can change that")
        moved = {"vertices": vertices} | ({} if normals is None else {"normals": normals})
        for name, value in moved.items():
            try:
                moved[name] = self.given[name].convert(value)
            except SceneError as error:
                raise SceneError(f"Mesh.with_vertices: {name}: {error}") from None
            if len(moved[name]) != len(self.vertices):
                told = f"got {len(moved[name])} rows; allowed: one for each of the {len(self.vertices)} vertices"
                raise SceneError(f"Mesh.with_vertices: {name}: {told}")
        mesh = object.__new__(type(self))
        for name, value in {**self.values(), **moved, "dropped": self.dropped}.items():
            object.__setattr__(mesh, name, value)
        tree = self.tree()
        object.__setattr__(mesh, "_tree", refit_mesh(tree, mesh._used()[0]))
        object.__setattr__(mesh, "_built_cost", vars(self).get("_built_cost", expected_cost(tree)))
        if mesh.tree_quality < WORN:
            warnings.warn(
                f"Mesh.with_vertices: the tree that was refitted has {mesh.tree_quality:.2g} of its quality: rays will be "
                "slow; .replace(vertices=...) builds another", stacklevel=2)  # fmt: skip
        return mesh

    @property
    def tree_quality(self) -> float:
        """About how fast rays go through a refitted tree, over how fast when it was built; 1 if it was not refitted."""
        built = vars(self).get("_built_cost")
        return 1.0 if built is None else built / expected_cost(self.tree())

    def _used(self) -> tuple[np.ndarray, np.ndarray]:
        """Vertices and faces without vertices that no face names: a stray one would spoil the scale of the tree."""
        used = np.zeros(len(self.vertices), bool)
        used[self.faces] = True
        if used.all():
            return self.vertices, self.faces
        return self.vertices[used], (np.cumsum(used) - 1).astype(np.int32)[self.faces]

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        if "_bounds" not in vars(self):  # a mesh may be shown ten thousand times
            points = self._used()[0]
            lower, upper = points.min(axis=0), points.max(axis=0)
            lower.flags.writeable = upper.flags.writeable = False
            object.__setattr__(self, "_bounds", (lower, upper))
        return vars(self)["_bounds"]


def _have_area(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Which triangles have an area; by axis, which takes half the time of `numpy.cross`."""
    a, b, c = (np.ascontiguousarray(vertices[faces[:, corner]].T) for corner in range(3))
    p, q, r = b - a, c - b, a - c
    longest = np.max([x * x + y * y + z * z for x, y, z in (p, q, r)], axis=0)
    x, y, z = p[1] * r[2] - p[2] * r[1], p[2] * r[0] - p[0] * r[2], p[0] * r[1] - p[1] * r[0]
    return np.sqrt(x * x + y * y + z * z) > _SLIVER * longest


TREE_HEAD, VERTICES_GIVEN, FACES_GIVEN, NORMALS, UVS = Mesh.offsets()
assert TREE_HEAD == METHOD_SLOTS, "the tree must stand first in a mesh's row"

implements(intersect, Mesh)(closest_in_mesh)
implements(occluded, Mesh)(any_in_mesh)
implements(closest_in_packets, Mesh)(closest_rays)
implements(any_in_packets, Mesh)(any_rays)


@kernel
def vec3_of(rows: Table, row: i64) -> Vec3:
    """Row of an (n, 3) array."""
    return Vec3(f64_at(rows, 3 * row), f64_at(rows, 3 * row + 1), f64_at(rows, 3 * row + 2))


@implements(handedness, Mesh)
def handedness_of_face(mesh: Table, prim: i64) -> f64:
    """Twice the signed area of the face in its texture coordinates."""
    uvs, faces, first = table_at(mesh, UVS), table_at(mesh, FACES_GIVEN), 3 * prim
    if is_null(uvs):
        return 1.0
    i, j, k = int(i32_at(faces, first)), int(i32_at(faces, first + 1)), int(i32_at(faces, first + 2))
    u0, v0 = f64_at(uvs, 2 * i), f64_at(uvs, 2 * i + 1)
    du1, dv1 = f64_at(uvs, 2 * j) - u0, f64_at(uvs, 2 * j + 1) - v0
    du2, dv2 = f64_at(uvs, 2 * k) - u0, f64_at(uvs, 2 * k + 1) - v0
    return du1 * dv2 - du2 * dv1


@implements(surface, Mesh)
def surface_of_mesh(mesh: Table, hit: Hit, p: Vec3) -> Surface:
    vertices, faces, first = table_at(mesh, VERTICES_GIVEN), table_at(mesh, FACES_GIVEN), 3 * hit.prim
    i, j, k = int(i32_at(faces, first)), int(i32_at(faces, first + 1)), int(i32_at(faces, first + 2))
    a = vec3_of(vertices, i)
    e1, e2 = vec3_of(vertices, j) - a, vec3_of(vertices, k) - a
    w0, w1, w2 = 1.0 - hit.u - hit.v, hit.u, hit.v
    n = cross(e1, e2)
    shading, tangent, u, v = n, e1, w1, w2

    normals = table_at(mesh, NORMALS)
    if not is_null(normals):
        smooth = vec3_of(normals, i) * w0 + vec3_of(normals, j) * w1 + vec3_of(normals, k) * w2
        if dot(smooth, smooth) > 0.0:
            shading = smooth

    # Solve e1 = du1 T + dv1 B, e2 = du2 T + dv2 B for the tangent T.
    uvs = table_at(mesh, UVS)
    if not is_null(uvs):
        u0, v0 = f64_at(uvs, 2 * i), f64_at(uvs, 2 * i + 1)
        du1, dv1 = f64_at(uvs, 2 * j) - u0, f64_at(uvs, 2 * j + 1) - v0
        du2, dv2 = f64_at(uvs, 2 * k) - u0, f64_at(uvs, 2 * k + 1) - v0
        u, v = u0 + du1 * w1 + du2 * w2, v0 + dv1 * w1 + dv2 * w2
        det = du1 * dv2 - du2 * dv1
        if det != 0.0:
            tangent = (e1 * dv2 - e2 * dv1) / det
    return Surface(n, shading, u, v, tangent)


@implements(rise, Mesh)
def rise_over_mesh(mesh: Table, hit: Hit, p: Vec3, side: f64) -> Vec3:
    normals = table_at(mesh, NORMALS)
    if is_null(normals):
        return grey(0.0)
    vertices, faces, first = table_at(mesh, VERTICES_GIVEN), table_at(mesh, FACES_GIVEN), 3 * hit.prim
    i, j, k = int(i32_at(faces, first)), int(i32_at(faces, first + 1)), int(i32_at(faces, first + 2))
    a = up_to_plane(p, vec3_of(vertices, i), vec3_of(normals, i) * side)
    b = up_to_plane(p, vec3_of(vertices, j), vec3_of(normals, j) * side)
    c = up_to_plane(p, vec3_of(vertices, k), vec3_of(normals, k) * side)
    return a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v


@kernel
def up_to_plane(p: Vec3, corner: Vec3, n: Vec3) -> Vec3:
    """The way from p straight up to the plane through a corner with the normal n; none if p is above it."""
    n2 = dot(n, n)
    if not n2 > 0.0:
        return grey(0.0)
    return n * (max(0.0, dot(corner - p, n)) / n2)
