"""PFM, the Portable Float Map: three lines of text, then float32 samples with the bottom row first. Lossless."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sightray.errors import FormatError
from sightray.images.base import Codec, as_float32, check_holds, check_size

# kind, width, height, scale; one white space byte (or a Windows line end) precedes the samples
_HEADER = re.compile(rb"P([Ff])\s+(\d{1,10})\s+(\d{1,10})\s+([-+.\dEe]{1,32})(?:\r\n|\s)")


def read(path: Path, max_pixels: int) -> NDArray[np.float32]:
    """Read ``Pf`` (h, w, 1) or ``PF`` (h, w, 3). The scale's sign gives the byte order; its size is ignored.

    Multiplying by the size would be wrong for the Middlebury stereo sets, whose disparities come unscaled beside a
    scale of 1/255, and nearly all other writers put 1.
    """
    with open(path, "rb") as file:
        head = file.read(128)
        match = _HEADER.match(head)
        if match is None:
            raise FormatError(f"not a PFM header: {head[:24]!r}; allowed: 'PF' or 'Pf', width, height, scale", path)
        kind, width, height = match[1], int(match[2]), int(match[3])
        try:
            scale = float(match[4])
        except ValueError:
            scale = 0.0
        if scale == 0 or not math.isfinite(scale):
            raise FormatError(f"PFM scale {match[4].decode()!r}; allowed: a number other than 0", path)

        # Compare with the file's length before any array is made.
        check_size(path, width, height, max_pixels)
        channels = 3 if kind == b"F" else 1
        count = width * height * channels
        check_holds(path, 4 * count, file.seek(0, 2) - match.end())
        file.seek(match.end())
        values = np.fromfile(file, dtype="<f4" if scale < 0 else ">f4", count=count)
    if values.size != count:
        raise FormatError("truncated while it was read", path)
    return as_float32(values.reshape(height, width, channels)[::-1])


def write(path: Path, pixels: NDArray[Any]) -> None:
    """Write (h, w, 1 or 3) float32, little-endian."""
    height, width, channels = pixels.shape
    with open(path, "wb") as file:
        file.write(f"{'PF' if channels == 3 else 'Pf'}\n{width} {height}\n-1.0\n".encode("ascii"))
        file.write(np.ascontiguousarray(pixels[::-1], dtype="<f4").data)


CODECS = (Codec("PFM", (".pfm",), read, write, channels=(1, 3)),)
