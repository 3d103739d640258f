"""Amodal masks."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.vision.layers.base import Layer
from sightray.vision.masks import check_room, paint_masks
from sightray.vision.pictures import Painting
from sightray.vision.rolling import crossings


class AmodalMasksLayer(Layer):
    """All of each object, also what others hide, (n, h, w) bool, in the order of ``labels.objects``.

    A pixel belongs to every object that the ray through its centre meets anywhere (`Scene.intersect_all`); what is seen
    of an object is a part of it.
    """

    label, picture = "amodal_masks", "own"

    def needs(self, frame: Any) -> tuple[str, ...]:
        check_room(frame, self.label, 1)
        return ("ray_origin", "ray_direction")

    def compute(self, frame: Any) -> np.ndarray:
        met = crossings(frame)
        masks = np.zeros((len(frame.objects), frame.height * frame.width), bool)
        row = np.full(len(frame.view.scene.objects), -1)
        row[[thing.index for thing in frame.objects]] = np.arange(len(frame.objects))
        masks[row[met.shape], met.ray] = True
        return masks.reshape(-1, frame.height, frame.width)

    def painting(self, labels: Any) -> Painting:
        """Each object in its colour, mixed where several are."""
        return paint_masks(labels, self)
