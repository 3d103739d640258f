"""Boxes in space."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.vision.layers.base import Layer
from sightray.vision.legend import Swatches
from sightray.vision.masks import backdrop, draw_line
from sightray.vision.pictures import Painting, palette, title


class Boxes3dLayer(Layer):
    """Corners in the world, (n, 8, 3), of the box around each object in its own frame; infinite for planes and the like.

    Corner k takes x from the upper end if bit 0 of k is set, y by bit 1, z by bit 2. Tight, also in
    turned groups, but for quadrics and implicit surfaces, whose clipping boxes are enclosed there.
    """

    label, unit, frame, picture = "boxes_3d", "m", "world", "own"

    def needs(self, frame: Any) -> tuple[str, ...]:
        return ("instance",)

    def compute(self, frame: Any) -> np.ndarray:
        bits = (np.arange(8)[:, None] >> np.arange(3)) & 1
        boxes = [np.where(bits == 1, thing.upper, thing.lower) for thing in frame.objects]
        poses = [thing.world_from_object for thing in frame.objects]
        with np.errstate(invalid="ignore"):
            return np.array([box @ m[:3, :3].T + m[:3, 3] for box, m in zip(boxes, poses, strict=True)])

    def painting(self, labels: Any) -> Painting:
        """The edges of the boxes over what is seen."""
        colors = palette(len(labels.objects))
        pixels = backdrop(labels, colors)
        with np.errstate(invalid="ignore"):
            corners = labels.camera.project(labels[self.label])
        for color, corner in zip(colors, corners, strict=True):
            for k in range(8):
                for bit in (1, 2, 4):
                    if not k & bit:
                        draw_line(pixels, corner[k], corner[k | bit], color)
        entries = [(c, f"{o.index} {o.name or o.kind}") for c, o in zip(colors, labels.objects, strict=True)]
        return Painting(pixels, Swatches(entries, title(self)))
