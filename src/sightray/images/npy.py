"""NPY, NumPy's own array file: float32, lossless."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sightray.errors import FormatError
from sightray.images.base import Codec, as_float32, check_size, decoding


def read(path: Path, max_pixels: int) -> NDArray[np.float32]:
    """Read an array (h, w) or (h, w, 1 | 3 | 4) of any real float type, converted to float32."""
    # Map instead of load: a header that promises more than the file holds is refused before memory is taken.
    # Pickled objects would run code, so they are never accepted; a corrupt header can make its parser warn.
    with decoding(path, "NPY"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        values: NDArray[Any] = np.lib.format.open_memmap(path, mode="r")
    if not np.issubdtype(values.dtype, np.floating):
        raise FormatError(f"NPY array of type {values.dtype}; allowed: float16, float32, float64", path)
    if values.ndim == 2:
        values = values[..., np.newaxis]
    if values.ndim != 3 or values.shape[2] not in (1, 3, 4):
        raise FormatError(f"NPY array of shape {values.shape}; allowed: (height, width, 1, 3 or 4)", path)
    check_size(path, values.shape[1], values.shape[0], max_pixels)
    return as_float32(np.array(values))


def write(path: Path, pixels: NDArray[Any]) -> None:
    """Write (h, w, c) float32."""
    with open(path, "wb") as file:  # an open file, because np.save would add ".npy" to a path that ends in ".NPY"
        np.save(file, pixels.astype(np.float32, copy=False), allow_pickle=False)


CODECS = (Codec("NPY", (".npy",), read, write, channels=(1, 3, 4)),)
