"""The contract of label layers.

A layer is asked for by its `label`, and states in its class what its values mean: `unit`, `frame` (the coordinates of
vectors), `columns`, `dtype`, and `background`, the value of pixels whose ray meets nothing. `picture` names the colour
map of `vision.pictures`.

There are two kinds. **Pixel layers** implement the kernel `fill`: all of them are computed in one pass over the picture,
from records of the rays through the pixels' centres (`vision.record`); `detail` says how much of a record they read.
**Other layers** override `compute`, and get what they `need`, other layers by label, computed before.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from sightray._jit import method
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table
from sightray.registry import Member
from sightray.vision.record import RAY_ONLY

if TYPE_CHECKING:
    from sightray.vision.frame import Frame
    from sightray.vision.labels import Labels
    from sightray.vision.pictures import Painting


class Layer(Member, family="vision.layers"):
    """Base of all label layers."""

    label: ClassVar[str] = ""
    unit: ClassVar[str] = ""
    frame: ClassVar[str] = ""  # world, camera, object or pixel
    columns: ClassVar[int] = 1
    dtype: ClassVar[type] = np.float64  # of pixel layers: float64 or int32
    background: ClassVar[float] = math.nan
    picture: ClassVar[str] = ""  # colour map; "" for layers that are no pictures
    detail: ClassVar[int] = RAY_ONLY
    letters: ClassVar[str] = ""  # of the columns, as channels of an EXR file
    object_frames: ClassVar[bool] = False  # whether `fill` reads the frame's OBJECT_FRAMES

    def needs(self, frame: Frame) -> tuple[str, ...]:
        """Labels of the layers that `compute` reads; `SceneError` if the request lacks something, such as a next view."""
        return ()

    def pixelwise(self, frame: Frame) -> bool:
        """Whether `fill` does it."""
        return fill in type(self).kernels

    def columns_in(self, frame: Frame) -> int:
        """Numbers for each pixel, where that depends on the scene."""
        return self.columns

    def compute(self, frame: Frame) -> Any:
        """The layer, from the others in ``frame.values``."""
        raise NotImplementedError(f"{type(self).__name__} does not say how it is computed")

    def painting(self, labels: Labels) -> Painting:
        """The layer in colours, with a legend."""
        from sightray.vision.pictures import by_map

        return by_map(labels, self)

    @classmethod
    def summary(cls) -> str:
        """The first sentence about the layer."""
        return " ".join((cls.__doc__ or "").split("\n\n")[0].split())


@method(0)
def fill(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    """Write the values of the pixels of a tile: `count` records, each to the row of `out` that its PIXEL says."""
    raise NotImplementedError
