"""Poses."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.vision.layers.base import Layer
from sightray.vision.legend import Swatches
from sightray.vision.masks import backdrop, draw_line
from sightray.vision.pictures import Painting, palette, title


class PosesLayer(Layer):
    """Pose of each object in the camera's frame, (n, 4, 4): ``camera_from_object``, in the order of ``labels.objects``.

    With the object's own transform as it is stated; a scale in it stays in the matrix.
    """

    label, unit, frame, picture = "poses", "m", "camera", "own"

    def needs(self, frame: Any) -> tuple[str, ...]:
        return ("instance",)

    def compute(self, frame: Any) -> np.ndarray:
        return frame.view.camera_from_world @ np.array([thing.world_from_object for thing in frame.objects])

    def painting(self, labels: Any) -> Painting:
        """Axes of each object's frame: x red, y green, z blue, half as long as its box."""
        pixels = backdrop(labels, palette(len(labels.objects)))
        axes = np.eye(3) * 0.85 + 0.15
        for thing in labels.objects:
            diagonal = float(np.linalg.norm(thing.upper - thing.lower))
            size = 0.5 * diagonal if np.isfinite(diagonal) else 1.0
            ends = np.concatenate([np.zeros((1, 3)), np.eye(3) * size])
            pose = thing.world_from_object
            with np.errstate(invalid="ignore"):
                there = labels.camera.project(ends @ pose[:3, :3].T + pose[:3, 3])
            for axis in range(3):
                draw_line(pixels, there[0], there[1 + axis], axes[axis])
        return Painting(pixels, Swatches(list(zip(axes, "xyz", strict=True)), f"{title(self)}: axes of each object"))
