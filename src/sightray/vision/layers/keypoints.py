"""Keypoints."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.errors import SceneError, unknown
from sightray.vision.layers.base import Layer
from sightray.vision.legend import Swatches
from sightray.vision.masks import backdrop, draw_line
from sightray.vision.pictures import Painting, palette, title
from sightray.vision.rolling import clear_sight, object_points, seen_from

OUTSIDE, HIDDEN, VISIBLE = 0, 1, 2  # COCO's values of visibility
NEAR = 1e-6  # of the way to a keypoint: what is met closer to it is the surface that it lies on


class KeypointsLayer(Layer):
    """Where given points of objects are seen: for each name an (n, 3) array of x, y and visibility.

    The option `keypoints` of `label` names them, in each object's own frame. Visibility is as in COCO: 2 visible, 1 in
    the picture but hidden (by anything, the object itself included), 0 outside of it; x and y are NaN behind the
    camera. It is found by a ray that must come within a millionth of its way to the point. Under a rolling shutter, points
    of what moves are where the row that sees them finds them.
    """

    label, unit, frame, picture = "keypoints", "pixels", "pixel", "own"

    def needs(self, frame: Any) -> tuple[str, ...]:
        return ("instance",)

    def compute(self, frame: Any) -> dict[str, np.ndarray]:
        if not frame.keypoints:
            raise SceneError(
                "label: keypoints: missing; give keypoints={'name of an object': (n, 3) points in its frame}"
            )
        known = {thing.name: thing for thing in frame.objects if thing.name}
        found = {}
        for name, points in frame.keypoints.items():
            if name not in known:
                raise SceneError(f"label: keypoints: {unknown('object', str(name), known)}")
            inside = np.asarray(points, np.float64)
            if inside.ndim != 2 or inside.shape[1] != 3:
                raise SceneError(f"label: keypoints: '{name}': got shape {inside.shape}; allowed: (n, 3)")
            found[name] = self._seen(frame, known[name], inside)
        return found

    def _seen(self, frame: Any, thing: Any, inside: np.ndarray) -> np.ndarray:
        view = frame.view
        if view.blurred:
            pixels, points = seen_from(view, lambda times: object_points(view, thing.index, inside, times), len(inside))
            clear = clear_sight(frame, points, pixels)
        else:
            pose = thing.world_from_object
            points = inside @ pose[:3, :3].T + pose[:3, 3]
            pixels = view.project(points)
            clear = view.sees(points, pixels, frame.threads, NEAR)
        visibility = np.where(view.within(pixels), HIDDEN, OUTSIDE)
        visibility[clear & (visibility == HIDDEN)] = VISIBLE
        return np.concatenate([pixels, visibility[:, None]], axis=1)

    def painting(self, labels: Any) -> Painting:
        """Crosses: white where a point is visible, red where it is hidden."""
        pixels = backdrop(labels, palette(len(labels.objects)))
        colors = {HIDDEN: np.array([1.0, 0.3, 0.2]), VISIBLE: np.array([1.0, 1.0, 1.0])}
        for points in labels[self.label].values():
            for x, y, visibility in points:
                for step in ((4, 0), (0, 4)):
                    if visibility != OUTSIDE:
                        draw_line(pixels, np.array([x, y]) - step, np.array([x, y]) + step, colors[int(visibility)])
        entries = [(colors[VISIBLE], "visible"), (colors[HIDDEN], "hidden")]
        return Painting(pixels, Swatches(entries, title(self)))
