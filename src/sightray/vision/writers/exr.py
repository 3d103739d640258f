"""OpenEXR with a layer for each label."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from sightray.errors import SceneError
from sightray.fields import text
from sightray.images.exr import write_layers
from sightray.vision.label import as_layer
from sightray.vision.shot import Shot
from sightray.vision.writers.base import Note, Output, Writer

DEFAULT = "depth,normal,instance,semantic"


class ExrWriter(Writer):
    """One ``NNNNNN.exr`` for each picture: the light itself as R G B, and label layers beside it, without loss.

    R G B are linear Rec. 709, 32-bit floats. A layer of one component is ``NAME.Y``, others ``NAME.X NAME.Y NAME.Z`` or so.
    Floats are 32-bit; ids (instance, semantic ...) are unsigned 32-bit and one more than in `Labels`, so that 0 is
    nothing. Rows are from the top. Units and frames are those of the layers (metres; OpenCV's axes in cameras); values
    in pixels are differences or, as the centres are, on the scale on which the top-left pixel's centre is (0.5, 0.5):
    nothing is shifted. With a next picture flow and occlusion are added, in stereo disparity.
    """

    label: ClassVar[str] = "exr"
    next_layers: ClassVar[tuple[str, ...]] = ("flow", "occlusion")
    stereo_layers: ClassVar[tuple[str, ...]] = ("disparity",)
    bytes_per_pixel: ClassVar[float] = 25.0
    names: str = text("label layers for pixels, commas between", default=DEFAULT)

    def accept(self, shot: Shot) -> None:
        for name in split_names(self.names):
            if not as_layer(name).letters:
                raise SceneError(f"exr: names: '{name}' is no layer for pixels")

    def wanted(self, following: bool, stereo: bool) -> tuple[str, ...]:
        return split_names(self.names) + super().wanted(following, stereo)

    def write(self, out: Output, shot: Shot) -> Note:
        labels, name = shot.labels, f"{shot.id:06}.exr"
        channels: dict[str, np.ndarray] = {}
        components: dict[str, str] = {}
        if shot.image is not None:
            channels[""] = shot.image.pixels[..., :3]
        for layer in self.wanted("flow" in labels, "disparity" in labels):
            values, letters = labels[layer], as_layer(layer).letters
            channels[layer] = values + 1 if values.dtype.kind == "i" else values
            components[layer] = letters
        with out.path(name) as aside:
            write_layers(aside, channels, components=components)
        return {}


def split_names(names: str) -> tuple[str, ...]:
    """Names with commas between them."""
    return tuple(dict.fromkeys(name.strip() for name in names.split(",") if name.strip()))
