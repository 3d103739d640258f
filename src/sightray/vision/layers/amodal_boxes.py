"""Amodal boxes."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.fields import flag
from sightray.vision.layers.base import Layer
from sightray.vision.masks import boxes_of, paint_boxes
from sightray.vision.pictures import Painting
from sightray.vision.silhouettes import Outliner


class AmodalBoxesLayer(Layer):
    """Box around all of each object, hidden or not, (n, 4): left, top, right, bottom; in the picture, or `beyond` it.

    Edges of pixels in continuous coordinates, so width is right - left; NaN for objects without a pixel. Rows follow
    ``labels.objects``. With `beyond`, what the edges of the picture cut off counts too, up to one picture's size each
    way, as in BOP's ``bbox_obj``; objects without end, such as planes, then reach to that border.
    """

    beyond: bool = flag("whether boxes reach beyond the picture", default=False)
    label, unit, frame, picture = "amodal_boxes", "pixels", "pixel", "own"

    def needs(self, frame: Any) -> tuple[str, ...]:
        return ("instance",) if self.beyond else ("amodal_masks", "instance")

    def compute(self, frame: Any) -> np.ndarray:
        if not self.beyond:
            return boxes_of(frame.values["amodal_masks"])
        outliner = Outliner(frame.view.camera, frame.threads)
        found = np.full((len(frame.objects), 4), np.nan)
        for k, thing in enumerate(frame.objects):
            box = outliner.silhouette(frame.view.middle.objects[thing.index]).box()
            if box is not None:
                found[k] = box[0], box[1], box[2] + 1, box[3] + 1
        return found

    def painting(self, labels: Any) -> Painting:
        """The boxes over what is seen, as far as they are in the picture."""
        return paint_boxes(labels, self)
