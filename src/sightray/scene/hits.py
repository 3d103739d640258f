"""What queries answer: arrays under plain names. What costs time is computed when it is first asked for."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple

import numpy as np


class Details(NamedTuple):
    """What is computed about hits on first access; rows are rays."""

    uv: np.ndarray
    normal: np.ndarray
    shading_normal: np.ndarray
    position: np.ndarray


class Hits:
    """The nearest hit of each ray. All arrays have the batch's shape, called (...) below.

    ``t``, ``shape`` and ``primitive`` are there at once; all else is computed for all rays when it is first asked for,
    from the arrays of rays, which are not copied: do not change these before.

    Attributes
    ----------
    t : (...) float64
        Where the ray meets the surface: at origin + t * direction. Infinite for a miss.
    shape : (...) int32
        Index in ``scene.objects`` of what was hit; -1 for a miss.
    primitive : (...) int32
        Which triangle of a mesh (row of ``faces``), or part of another shape; -1 for a miss.
    item : (...) int32
        Index in ``Hits.items``: shapes with their places, after groups were opened and instances followed. -1 for a miss.
    hit : (...) bool
        Whether anything was hit.
    uv : (..., 2) float64
        Texture coordinates; for meshes without ``uvs`` the barycentric weights of the second and third corner. NaN for
        a miss.
    normal : (..., 3) float64, world
        Geometric normal, unit length, pointing outward. NaN for a miss.
    shading_normal : (..., 3) float64, world
        Normal that lighting uses, unit length. NaN for a miss.
    position : (..., 3) float64, world
        Point that was hit; on meshes computed from the triangle's corners. NaN for a miss.
    """

    def __init__(self, t: np.ndarray, shape: np.ndarray, primitive: np.ndarray, item: np.ndarray,
                 describe: Callable[[Hits], Details]):  # fmt: skip
        self.t, self.shape, self.primitive, self.item = t, shape, primitive, item
        self._describe = describe

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        return f"<Hits {self.t.shape}: {int(np.count_nonzero(self.hit))} of {self.t.size} rays hit>"

    @cached_property
    def hit(self) -> np.ndarray:
        return self.shape >= 0

    @cached_property
    def _details(self) -> Details:
        return self._describe(self)

    @property
    def uv(self) -> np.ndarray:
        return self._details.uv

    @property
    def normal(self) -> np.ndarray:
        return self._details.normal

    @property
    def shading_normal(self) -> np.ndarray:
        return self._details.shading_normal

    @property
    def position(self) -> np.ndarray:
        return self._details.position


class Layers(NamedTuple):
    """Every surface along each ray, sorted by t; ray number i (of the flattened batch) has rows offsets[i] to offsets[i+1].

    Attributes
    ----------
    offsets : (n + 1,) int64
        First row of each ray, and the number of all rows.
    ray : (m,) int64
        Ray of each row.
    t : (m,) float64
        Where the surface is met.
    shape : (m,) int32
        Index in ``scene.objects``.
    primitive : (m,) int32
        Triangle of a mesh, or part of another shape.
    entering : (m,) bool
        Whether the ray comes from the outer side, against the normal. On closed surfaces entering and leaving alternate.
    item : (m,) int32
        Index of the shape at its place, as in `Hits`.
    """

    offsets: np.ndarray
    ray: np.ndarray
    t: np.ndarray
    shape: np.ndarray
    primitive: np.ndarray
    entering: np.ndarray
    item: np.ndarray

    def of_ray(self, index: int) -> slice:
        """The rows of one ray."""
        return slice(int(self.offsets[index]), int(self.offsets[index + 1]))


class ClosestPoints(NamedTuple):
    """The nearest point of the meshes to each point; arrays have the batch's shape (...).

    Attributes
    ----------
    point : (..., 3) float64, world
        The nearest point; NaN where there is none.
    distance : (...) float64
        How far it is; infinite where there is none: for points that are not finite.
    shape : (...) int32
        Index in ``scene.objects`` of the mesh; -1 where there is none.
    primitive : (...) int32
        Triangle: row of ``faces``; -1 where there is none.
    uv : (..., 2) float64
        Barycentric weights of the triangle's second and third corner; NaN where there is none.
    """

    point: np.ndarray
    distance: np.ndarray
    shape: np.ndarray
    primitive: np.ndarray
    uv: np.ndarray
