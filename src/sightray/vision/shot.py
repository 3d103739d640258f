"""A `Shot`: one picture of a dataset with its labels, and where it belongs."""

from __future__ import annotations

import io
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from sightray.images import Image
from sightray.images.png import write_png
from sightray.lights.base import Light
from sightray.vision.labels import Labels
from sightray.vision.silhouettes import Outliner, Silhouette

COMPRESSION = 3  # of PNG pictures: a noisy picture gets no smaller by more


@dataclass(frozen=True, eq=False)
class Shot:
    """One picture of a dataset: what writers write.

    Parameters
    ----------
    labels : with the layers that the writers ask for.
    image : the picture; None if none was made.
    frame : number of the moment, from 0; all cameras of a rig see the same moment.
    camera, cameras : index and names of the cameras.
    sequence, step : which sequence of pictures it belongs to, and its place in that, from 0.
    time : seconds since the sequence began.
    targets : indices, as in ``labels.objects``, of the objects that the dataset is about; None for all that are no
        lights and have an end.
    threads : for writers that cast rays of their own.
    """

    labels: Labels
    image: Image | None = None
    frame: int = 0
    camera: int = 0
    cameras: tuple[str, ...] = ("camera",)
    sequence: int = 0
    step: int = 0
    time: float = 0.0
    targets: tuple[int, ...] | None = None
    threads: int | None = field(default=None, repr=False)

    @property
    def id(self) -> int:
        """A number for the picture that no other has: frames in order, the cameras of each in turn."""
        return self.frame * len(self.cameras) + self.camera

    @property
    def place(self) -> int:
        """The same within its sequence."""
        return self.step * len(self.cameras) + self.camera

    @property
    def scene(self) -> Any:
        """What is seen."""
        return self.labels._frame.view.scene

    @cached_property
    def png(self) -> bytes:
        """The picture as a PNG file; black if there is none."""
        labels = self.labels
        codes = np.zeros((labels.height, labels.width, 3), np.uint8) if self.image is None else self.image.to_bytes()
        if codes.shape[2] == 1:
            codes = np.repeat(codes, 3, axis=2)
        stream = io.BytesIO()
        write_png(stream, codes[..., :3], compression=COMPRESSION)
        return stream.getvalue()

    @cached_property
    def objects(self) -> tuple[Any, ...]:
        """The entries of ``labels.objects`` that the dataset is about."""
        if self.targets is not None:
            return tuple(thing for thing in self.labels.objects if thing.index in self.targets)
        lamps = {k for k, thing in enumerate(self.scene.objects) if isinstance(thing, Light)}
        return tuple(
            thing for thing in self.labels.objects
            if thing.index not in lamps and np.isfinite(thing.lower).all() and np.isfinite(thing.upper).all()
        )  # fmt: skip

    @cached_property
    def silhouettes(self) -> tuple[Silhouette, ...]:
        """The whole outline of each of `objects`."""
        outliner = Outliner(self.labels.camera, self.threads)
        return tuple(outliner.silhouette(self.scene.objects[thing.index]) for thing in self.objects)

    def facts(self) -> dict[str, Any]:
        """What every writer notes of a picture, ready for JSON."""
        return {
            "id": self.id, "frame": self.frame, "camera": self.camera, "cameras": list(self.cameras),
            "sequence": self.sequence, "step": self.step, "time": self.time,
            "width": self.labels.width, "height": self.labels.height,
            "world_from_camera": self.labels.world_from_camera.tolist(),
        }  # fmt: skip
