"""OpenEXR through its official package: 32-bit floats, lossless, named channels.

A grey image is channel ``Y``; colour is ``R G B`` and alpha ``A``. Further layers are ``layer.R`` and so on. The pixels
of the data window are read; a display window around it is not filled in.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sightray.errors import FormatError, SceneError, UnsupportedError
from sightray.images.atomic import writing
from sightray.images.base import MAX_PIXELS, Codec, StrPath, as_float32, check_holds, check_size, decoding

_MAGIC = b"\x76\x2f\x31\x01"
_EXPANSION = 65536  # more than any compression of the format, DWA's zipped 8 x 8 blocks included, can expand
_COMPONENTS = {2: "XY", 3: "RGB", 4: "RGBA"}
_ORDER = "RGBAXYZWUV"  # in which the components of a layer are stacked again


def read(path: Path, max_pixels: int) -> NDArray[np.float32]:
    """Read the picture itself: R, G, B and A if there, else Y, else the one channel that there is."""
    channels = _read_channels(path, max_pixels)
    if {"R", "G", "B"} <= channels.keys():
        wanted = [name for name in "RGBA" if name in channels]
    elif "Y" in channels or len(channels) == 1:
        wanted = ["Y"] if "Y" in channels else list(channels)
    else:
        names = ", ".join(sorted(channels))
        raise UnsupportedError(f"{path}: EXR channels {names}; allowed: R G B [A], Y, or one channel. See read_layers")
    return np.stack([as_float32(channels[name]) for name in wanted], axis=2)


def write(path: Path, pixels: NDArray[Any]) -> None:
    """Write (h, w, 1 | 3 | 4) float32 as Y, R G B, or R G B A."""
    names = "Y" if pixels.shape[2] == 1 else "RGBA"
    _write_channels(path, {n: pixels[..., i] for n, i in zip(names, range(pixels.shape[2]), strict=False)})


def write_layers(
    path: StrPath, layers: Mapping[str, ArrayLike], *, components: Mapping[str, str] | None = None
) -> None:
    """Write several named layers of one size to one file, whole or not at all.

    Parameters
    ----------
    path : ``.exr`` file.
    layers : name -> (h, w) or (h, w, 1 to 4)
        float16 and float32 are kept, float64 becomes float32, non-negative integers and bools become uint32. A layer
        of one component is a channel of the layer's own name, others are ``name.R`` ...; the name ``""`` gives plain
        ``R G B``, ``Y`` for one component.
    components : layer name -> one letter per component, such as ``{"normal": "XYZ"}``
        By default ``XY``, ``RGB`` and ``RGBA`` for 2, 3 and 4.

    Raises
    ------
    SceneError
        No layer, layers of different size, a component string that does not fit, or values that EXR cannot hold.
    """
    components = {} if components is None else components
    channels: dict[str, NDArray[Any]] = {}
    for layer, values in layers.items():
        values = np.asarray(values)
        if values.ndim == 2:
            values = values[..., np.newaxis]
        if values.ndim != 3 or not 1 <= values.shape[2] <= 4 or values.size == 0:
            raise SceneError(f"{path}: layer '{layer}' of shape {values.shape}; allowed: (h, w) or (h, w, 1 to 4)")
        letters = components.get(layer, _COMPONENTS.get(values.shape[2], ""))
        if letters and (len(letters) != values.shape[2] or len(set(letters)) != len(letters)):
            raise SceneError(f"{path}: layer '{layer}' has {values.shape[2]} components, not '{letters}'")
        for i in range(values.shape[2]):
            name = ".".join(part for part in (layer, letters[i : i + 1]) if part) or "Y"
            if name in channels:
                raise SceneError(f"{path}: layer '{layer}' makes a second channel '{name}'")
            channels[name] = _storable(path, layer, values[..., i])
    if len({values.shape for values in channels.values()}) != 1:
        sizes = ", ".join(f"'{name}' {np.shape(values)[:2]}" for name, values in layers.items())
        raise SceneError(f"{path}: layers must be of one (height, width) and at least one; got {sizes or 'none'}")
    with writing(path) as aside:
        _write_channels(aside, channels)


def read_layers(path: StrPath, *, max_pixels: int = MAX_PIXELS) -> dict[str, NDArray[Any]]:
    """Read every layer: name -> (h, w, components) in the stored type (float16, float32 or uint32).

    ``a.b.R`` belongs to layer ``a.b``; single letters without a dot make the layer ``""``; any other undotted name is
    a layer of its own.
    """
    groups: dict[str, dict[str, NDArray[Any]]] = {}
    for name, values in _read_channels(Path(path), max_pixels).items():
        layer, dot, component = name.rpartition(".")
        if not dot and len(name) > 1:
            layer, component = name, ""
        groups.setdefault(layer, {})[component] = values
    order = {letter: str(i) for i, letter in enumerate(_ORDER)}
    return {
        layer: np.stack([group[c] for c in sorted(group, key=lambda c: order.get(c, c))], axis=2)
        for layer, group in groups.items()
    }


def _storable(path: StrPath, layer: str, values: NDArray[Any]) -> NDArray[Any]:
    """Values in one of the three sample types of the format."""
    if values.dtype == np.float16:
        return values
    if np.issubdtype(values.dtype, np.floating):
        return as_float32(values)
    if values.dtype.kind in "biu" and values.min() >= 0 and values.max() < 2**32:
        return values.astype(np.uint32)
    raise SceneError(f"{path}: layer '{layer}' of type {values.dtype}; allowed: floats, or integers in [0, 2**32)")


def _write_channels(path: Path, channels: Mapping[str, NDArray[Any]]) -> None:
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    try:
        with OpenEXR.File(header, {name: np.ascontiguousarray(v) for name, v in channels.items()}) as file:
            file.write(str(path))
    except RuntimeError as error:  # how the library says that the disk is full
        raise OSError(f"{path}: OpenEXR cannot write: {error}") from error


def _read_channels(path: Path, max_pixels: int) -> dict[str, NDArray[Any]]:
    """Every channel of the first part, (h, w) each."""
    import OpenEXR

    with open(path, "rb") as file:
        if (magic := file.read(4)) != _MAGIC:
            raise FormatError(f"not an EXR file: it begins with {magic!r}, not {_MAGIC!r}", path)
    with decoding(path, "EXR"):
        # Look at the header alone first, because the library takes memory for whatever size it promises.
        with OpenEXR.File(str(path), separate_channels=True, header_only=True) as file:
            header = dict(file.header())  # the file's own dict is emptied when it closes
        if header["type"] not in (OpenEXR.scanlineimage, OpenEXR.tiledimage):
            raise UnsupportedError(f"{path}: EXR of type {header['type'].name}; allowed: scanlineimage, tiledimage")
        low, high = (corner.astype(np.int64) for corner in header["dataWindow"])
        width, height = (high - low + 1).tolist()
        check_size(path, width, height, max_pixels)
        check_holds(path, width * height * 2 * len(header["channels"]) // _EXPANSION, os.path.getsize(path))

        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = {name: np.array(channel.pixels) for name, channel in file.channels().items()}
        if not channels or any(values.shape != (height, width) for values in channels.values()):
            raise UnsupportedError(f"{path}: EXR without channels, or with subsampled ones")
    return channels


CODECS = (Codec("EXR", (".exr",), read, write, channels=(1, 3, 4)),)
