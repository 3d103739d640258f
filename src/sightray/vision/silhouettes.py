"""Whole outlines of objects, as if nothing stood before them, also beyond the edges of the picture."""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from sightray.scene.compile import flatten
from sightray.scene.scene import Scene
from sightray.vision.poses import outline_points
from sightray.vision.view import is_linear

MARGIN = 1.0  # beyond each edge that is still looked at, in sizes of the picture


class Silhouette(NamedTuple):
    """Which pixel centres lie within an object's outline.

    Attributes
    ----------
    left, top : column and row of the mask's first pixel; negative beyond the picture.
    mask : (h, w) bool; pixels around it are not in the outline.
    """

    left: int
    top: int
    mask: np.ndarray

    def pixels(self) -> int:
        """Pixels of the whole outline."""
        return int(self.mask.sum())

    def box(self) -> tuple[int, int, int, int] | None:
        """First column, first row, last column, last row of the outline; None if it has no pixel."""
        columns, rows = np.flatnonzero(self.mask.any(axis=0)), np.flatnonzero(self.mask.any(axis=1))
        if not len(columns):
            return None
        return (self.left + int(columns[0]), self.top + int(rows[0]), self.left + int(columns[-1]),
                self.top + int(rows[-1]))  # fmt: skip

    def within(self, width: int, height: int) -> np.ndarray:
        """The part in the picture: (height, width) bool."""
        found = np.zeros((height, width), bool)
        h, w = self.mask.shape
        x0, y0, x1, y1 = max(self.left, 0), max(self.top, 0), min(self.left + w, width), min(self.top + h, height)
        if x0 < x1 and y0 < y1:
            found[y0:y1, x0:x1] = self.mask[y0 - self.top : y1 - self.top, x0 - self.left : x1 - self.left]
        return found


class Outliner:
    """Finds silhouettes of a scene's objects: each alone is asked, by rays through the centres of the pixels around it."""

    def __init__(self, camera: Any, threads: int | None = None):
        self.camera, self.threads = camera, threads

    @cached_property
    def canvas(self) -> tuple[int, int, int, int]:
        """Columns and rows that are looked at: first column, first row, and those after the last."""
        width, height = self.camera.width, self.camera.height
        x, y = round(MARGIN * width), round(MARGIN * height)
        return -x, -y, width + x, height + y

    def silhouette(self, thing: Any) -> Silhouette:
        """The silhouette of one object of a scene: a shape, group or instance."""
        alone = Scene(thing)
        left, top, right, bottom = self._window(alone)
        if left >= right or top >= bottom:
            return Silhouette(left, top, np.zeros((0, 0), bool))
        columns, rows = np.arange(left, right) + 0.5, np.arange(top, bottom) + 0.5
        origins, directions = self.camera.rays(np.stack(np.meshgrid(columns, rows), axis=-1))
        return Silhouette(left, top, alone.occluded(origins, directions, threads=self.threads))

    def _window(self, alone: Scene) -> tuple[int, int, int, int]:
        """Pixels within which all of the object is seen: around its corners, or all if one has no image."""
        points = np.concatenate([item.transform.point(outline_points(item.shape)) for item in flatten(alone)])
        with np.errstate(invalid="ignore", divide="ignore"):
            seen = self.camera.project(points)
        left, top, right, bottom = self.canvas
        if not np.isfinite(seen).all() or not is_linear(self.camera):  # bent lenses do not keep hulls
            return self.canvas
        low, high = np.floor(seen.min(axis=0)) - 2, np.ceil(seen.max(axis=0)) + 2
        return (int(np.clip(low[0], left, right)), int(np.clip(low[1], top, bottom)),
                int(np.clip(high[0], left, right)), int(np.clip(high[1], top, bottom)))  # fmt: skip
