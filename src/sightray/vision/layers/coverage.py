"""Coverage."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.fields import integer
from sightray.vision.layers.base import Layer
from sightray.vision.layers.instance import InstanceLayer
from sightray.vision.legend import Swatches
from sightray.vision.masks import check_room
from sightray.vision.pictures import NOTHING, Painting, palette, title

_INSTANCE = InstanceLayer()


class CoverageLayer(Layer):
    """Share of each pixel that each object covers, (h, w, n + 1): ``labels.objects`` in order, then the background.

    Counted over `samples` x `samples` rays through the middles of the pixel's equal cells, so shares are multiples of
    ``1 / samples**2`` and sum to 1. The only layer that does not belong to the pixel's centre.
    """

    samples: int = integer("rays along a side of each pixel", default=4, at_least=1, at_most=16)
    label, picture = "coverage", "own"

    def needs(self, frame: Any) -> tuple[str, ...]:
        check_room(frame, self.label, 16)
        return ()

    def compute(self, frame: Any) -> np.ndarray:
        (instance,) = frame.run([_INSTANCE], scale=self.samples)
        n, count = self.samples, len(frame.objects) + 1
        column = np.full(len(frame.view.scene.objects) + 1, count - 1)  # the last entry is that of -1
        column[[thing.index for thing in frame.objects]] = np.arange(count - 1)
        cells = column[instance].reshape(frame.height, n, frame.width, n).swapaxes(1, 2)
        pixel = np.arange(frame.width * frame.height).reshape(frame.height, frame.width, 1, 1)
        counts = np.bincount((pixel * count + cells).ravel(), minlength=frame.width * frame.height * count)
        return counts.reshape(frame.height, frame.width, count) / n**2

    def painting(self, labels: Any) -> Painting:
        """Colours of objects, mixed by their shares."""
        colors = np.concatenate([palette(len(labels.objects)), [NOTHING]])
        entries = [(c, thing.name or thing.kind) for c, thing in zip(colors, labels.objects, strict=False)]
        return Painting(labels[self.label] @ colors, Swatches(entries, title(self)))
