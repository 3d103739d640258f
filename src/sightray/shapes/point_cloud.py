"""PointCloud."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from sightray._jit import METHOD_SLOTS, implements
from sightray.bvh.binned_sah import Bvh8, build, pack_tree
from sightray.bvh.bvh8 import TREE_WORDS
from sightray.errors import SceneError
from sightray.fields import Derived, Field, array, choice, derived_array, other
from sightray.mathlib.hit import Hit
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, aligned, i64_at
from sightray.mathlib.vec import Vec3
from sightray.shapes.base import Shape, Surface, intersect, surface
from sightray.shapes.point_normals import estimate_normals, neighbourhood, spacing
from sightray.shapes.point_smooth import surface_of_smooth, trace_smooth
from sightray.shapes.point_splats import BALLS, MODE, SPLATS, surface_of_splat, trace_splats

SMOOTH_RADIUS, SPLAT_RADIUS = 4.0, 2.0  # in units of the spacing


class _TreeHead(Field):
    """The words in front of the row that rays read first: the tree over the points."""

    words = TREE_WORDS - METHOD_SLOTS

    def pack(self, row: Table, word: int, value: Any, packer: Any) -> None:
        pack_tree(packer.space, row, value)


class Fit(NamedTuple):
    """All that is computed of a cloud, once."""

    tree: Bvh8
    balls: np.ndarray  # (n, 8) float64 in the tree's order: point, radius, unit normal, number of the point
    normals: np.ndarray  # (n, 3) float64
    radii: np.ndarray  # (n,) float64
    spacing: float  # NaN where nothing asked for it


def _radius(value: Any) -> Any:
    """Check the radius: None, a number, or one for each point."""
    if value is None:
        return None
    try:
        radii = np.array(value, np.float64)
    except (TypeError, ValueError):
        radii = np.zeros(0)
    if radii.ndim > 1 or not radii.size or not (np.isfinite(radii) & (radii > 0)).all() or isinstance(value, bool):
        raise SceneError(f"got {value!r}; allowed: a finite number > 0 (m), one for each point, or None")
    radii.flags.writeable = False
    return float(radii) if radii.ndim == 0 else radii


class PointCloud(Shape):
    """Measured points as a surface.

    ``surface="splats"`` shows each point as a disk across its normal, of its radius; nothing is made up between them.

    ``surface="smooth"`` is the surface that the points imply: where the weighted mean of the distances to their tangent
    planes is zero,

        f(x) = Σ wᵢ(x) nᵢ·(x - pᵢ) / Σ wᵢ(x),  wᵢ(x) = (1 - |x - pᵢ|² / rᵢ²)⁴ within the ball of radius rᵢ, 0 outside.

    It exists within the union of the balls. On a smooth surface sampled with spacing h and radii that are a multiple of
    h, it deviates by about h² times half the curvature. Along a ray, f is evaluated at steps of a sixth of the
    smallest radius of the balls that are met; signs that change bracket a root, found by false position (Illinois
    variant) and halving to the last digits. Sheets that are closer to one another than the radius melt together.

    Without ``normals``, these are estimated (`point_normals`): the plane through 12 neighbours, sides made to agree over
    the cloud, the highest point of each connected part looking up. That leaves open what is inside where parts are
    nested. Without ``radius``, it is 4 times the median distance between nearest neighbours for the smooth surface, and
    twice for splats.

    Texture coordinates: of the disk around the nearest point, from 0 to 1 in two directions. Part number: the point.

    References: R. Kolluri, "Provably good moving least squares" (SODA 2005); M. Alexa et al., "Computing and rendering
    point set surfaces" (TVCG 2003); H. Pfister et al., "Surfels" (SIGGRAPH 2000) for the splats.
    """

    tree_head = Derived("tree over the points", lambda cloud: cloud.fit().tree, _TreeHead)
    points: np.ndarray = array("(n, 3) measured points", np.float64, columns=3, unit="m")
    normals: np.ndarray | None = array("(n, 3) outward normals; None to estimate them", np.float64, columns=3,
                                       default=None)  # fmt: skip
    radius: Any = other("reach of the points, one number or one for each; None for a multiple of the spacing", _radius,
                        default=None, unit="m", plain=lambda r: r.tolist() if isinstance(r, np.ndarray) else r)  # fmt: skip
    surface: str = choice("what rays meet", ("smooth", "splats"), default="smooth")
    balls = derived_array("what rays read of the points", lambda cloud: cloud.fit().balls)

    def check(self) -> None:
        n = len(self.points)
        if not n:
            raise SceneError("PointCloud.points: got none; allowed: at least one")
        if self.normals is not None and (len(self.normals) != n or not self.normals.any(axis=1).all()):
            raise SceneError(f"PointCloud.normals: got {len(self.normals)} rows; allowed: one for each of the {n} points, "
                             "none of them zero")  # fmt: skip
        if isinstance(self.radius, np.ndarray) and len(self.radius) != n:
            raise SceneError(f"PointCloud.radius: got {len(self.radius)} numbers; allowed: one, or one for each of the "
                             f"{n} points")  # fmt: skip
        if n < 4 and (self.normals is None or self.radius is None):
            raise SceneError(f"PointCloud.points: got {n}; allowed: at least 4 where normals and radius are not given")

    def fit(self) -> Fit:
        """Normals, radii and tree, computed on the first call."""
        if "_fit" not in vars(self):
            object.__setattr__(self, "_fit", self._fit_points())
        return vars(self)["_fit"]

    def _fit_points(self) -> Fit:
        points, normals, radius, apart = self.points, self.normals, self.radius, math.nan
        if normals is None or radius is None:
            indices, distances = neighbourhood(points)
            apart = spacing(distances)
        if radius is None:
            radius = apart * (SPLAT_RADIUS if self.surface == "splats" else SMOOTH_RADIUS)
            if not 0 < radius < math.inf:
                raise SceneError("PointCloud.points: got all at one place; allowed: such a cloud with a radius given")
        normals = estimate_normals(points, indices) if normals is None else _unit(normals)
        radii = np.broadcast_to(np.asarray(radius, np.float64), len(points))
        reach = self._reach(normals, radii)
        tree = build(points - reach, points + reach, leaf_size=4)
        balls = aligned((len(points), 8), np.float64)
        balls[:, 0:3], balls[:, 3], balls[:, 4:7], balls[:, 7] = points, radii, normals, np.arange(len(points))
        ordered = aligned(balls.shape, np.float64)
        ordered[:] = balls[tree.order]
        return Fit(tree, ordered, normals, radii, apart)

    def _reach(self, normals: np.ndarray, radii: np.ndarray) -> np.ndarray:
        """Half extents of what lies around each point: a disk or a ball."""
        if self.surface == "splats":
            return radii[:, None] * np.sqrt(np.maximum(0.0, 1.0 - normals**2)) + 1e-12 * radii[:, None]
        return np.repeat(radii[:, None], 3, axis=1)

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        fit = self.fit()
        reach = self._reach(fit.normals, fit.radii)
        return (self.points - reach).min(axis=0), (self.points + reach).max(axis=0)


def _unit(normals: np.ndarray) -> np.ndarray:
    scaled = normals / np.abs(normals).max(axis=1, keepdims=True)
    return scaled / np.linalg.norm(scaled, axis=1, keepdims=True)


TREE_HEAD, _, _, MODE_WORD, BALLS_WORD = PointCloud.offsets()
assert TREE_HEAD == METHOD_SLOTS, "the tree must stand first in a cloud's row"
assert (MODE_WORD, BALLS_WORD) == (MODE, BALLS), "where point_splats says"


@implements(intersect, PointCloud)
def intersect_point_cloud(cloud: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> Hit:
    if i64_at(cloud, MODE) == SPLATS:
        return trace_splats(cloud, o, d, t_min, t_max)
    return trace_smooth(cloud, o, d, t_min, t_max)


@implements(surface, PointCloud)
def surface_of_point_cloud(cloud: Table, hit: Hit, p: Vec3) -> Surface:
    if i64_at(cloud, MODE) == SPLATS:
        return surface_of_splat(cloud, hit, p)
    return surface_of_smooth(cloud, hit, p)
