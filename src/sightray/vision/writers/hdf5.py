"""HDF5."""

from __future__ import annotations

import json
from typing import Any, ClassVar

import numpy as np

from sightray.errors import UnsupportedError
from sightray.fields import text
from sightray.vision.label import as_layer
from sightray.vision.save import facts, plain
from sightray.vision.shot import Shot
from sightray.vision.writers.base import Note, Output, Writer
from sightray.vision.writers.exr import DEFAULT, split_names


class Hdf5Writer(Writer):
    """One ``NNNNNN.h5`` for each picture: ``colors``, ``radiance``, a dataset for each label layer, and the camera.

    ``colors`` is (h, w, 3) uint8, sRGB; ``radiance`` float32, linear Rec. 709; layers are as `Labels` has them (float64
    or int32, -1 for nothing), with ``unit`` and ``frame`` as attributes. ``camera/intrinsics`` is K with the centre of the
    top-left pixel at (0.5, 0.5): nothing is shifted; ``camera/world_from_camera`` has OpenCV's axes (+x right, +y down,
    +z forward) and metres. ``about`` holds the rest as JSON: objects, classes, lights. With a next picture flow and
    occlusion are added, in stereo disparity. Needs h5py: ``pip install sightray[hdf5]``.
    """

    label: ClassVar[str] = "hdf5"
    next_layers: ClassVar[tuple[str, ...]] = ("flow", "occlusion")
    stereo_layers: ClassVar[tuple[str, ...]] = ("disparity",)
    bytes_per_pixel: ClassVar[float] = 40.0
    names: str = text("label layers, commas between", default=DEFAULT)

    def accept(self, shot: Shot) -> None:
        _h5py()
        for name in split_names(self.names):
            as_layer(name)

    def wanted(self, following: bool, stereo: bool) -> tuple[str, ...]:
        return split_names(self.names) + super().wanted(following, stereo)

    def write(self, out: Output, shot: Shot) -> Note:
        h5py, labels = _h5py(), shot.labels
        with out.path(f"{shot.id:06}.h5") as aside, h5py.File(aside, "w") as file:
            if shot.image is not None:
                _put(file, "colors", shot.image.to_bytes()[..., :3])
                _put(file, "radiance", shot.image.pixels[..., :3])
            for name in self.wanted("flow" in labels, "disparity" in labels):
                layer, values = as_layer(name), labels[name]
                if isinstance(values, np.ndarray):
                    one = _put(file, name, values)
                    one.attrs["unit"], one.attrs["frame"] = layer.unit, layer.frame
            if labels.intrinsics is not None:
                file["camera/intrinsics"] = labels.intrinsics
            file["camera/world_from_camera"] = labels.world_from_camera
            file["about"] = json.dumps({**facts(labels), **plain(shot.facts())})
        return {}


def _h5py() -> Any:
    try:
        import h5py
    except ImportError:
        raise UnsupportedError("hdf5: h5py is not installed; pip install 'sightray[hdf5]'") from None
    return h5py


def _put(file: Any, name: str, values: np.ndarray) -> Any:
    return file.create_dataset(name, data=values, compression="gzip", compression_opts=4, shuffle=values.size > 0)
