"""A `Shot`: one picture of a dataset with its labels, and where it belongs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from sightray.images import Image
from sightray.images.png import png_bytes
from sightray.lights.base import Light
from sightray.vision.labels import Labels
from sightray.vision.silhouettes import Outliner, Silhouette
from sightray.vision.trajectory import Trajectory

PICTURE = "picture"  # name of what the camera's own sensor delivers, among those of depth sensors
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
    trajectory : how the first camera moves, over `time`; None if it is not known, or pictures are apart.
    next_time : when the next picture of the sequence is taken; None for the last one.
    targets : indices, as in ``labels.objects``, of the objects that the dataset is about; None for all that are no
        lights and have an end.
    threads : for writers that cast rays of their own.
    delivered : what a camera's `Sensor` made of the picture, (h, w, 3) or (h, w) whole numbers of `bits` bits; None
        without a sensor.
    measured : what depth sensors measured, (h, w) metres each, by their names.
    devices : the sensors in words, by the same names; the camera's is "picture".
    """

    labels: Labels
    image: Image | None = None
    frame: int = 0
    camera: int = 0
    cameras: tuple[str, ...] = ("camera",)
    sequence: int = 0
    step: int = 0
    time: float = 0.0
    trajectory: Trajectory | None = field(default=None, repr=False)
    next_time: float | None = None
    targets: tuple[int, ...] | None = None
    threads: int | None = field(default=None, repr=False)
    delivered: np.ndarray | None = field(default=None, repr=False)
    bits: int = 8
    measured: Mapping[str, np.ndarray] = field(default_factory=dict, repr=False)
    devices: Mapping[str, str] = field(default_factory=dict, repr=False)

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
        """The picture as a PNG file of 8 bits, colours; as its sensor delivers it, if it has one; black if there is none."""
        labels = self.labels
        if self.delivered is not None:
            scaled = np.floor(self.delivered * (255 / (2**self.bits - 1)) + 0.5)
            codes = scaled.astype(np.uint8).reshape(labels.height, labels.width, -1)
        elif self.image is not None:
            codes = self.image.to_bytes()
        else:
            codes = np.zeros((labels.height, labels.width, 3), np.uint8)
        if codes.shape[2] == 1:
            codes = np.repeat(codes, 3, axis=2)
        return png_bytes(codes[..., :3], compression=COMPRESSION)

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
