"""Densities from files: NumPy's ``.npy``, and ``.vol`` as Mitsuba's grid volumes are stored."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from sightray.errors import SceneError, unknown

SUFFIXES = (".npy", ".vol")
VOL_HEADER = np.dtype([("magic", "S3"), ("version", "u1"), ("encoding", "<i4"), ("size", "<i4", 3), ("channels", "<i4"),
                       ("box", "<f4", 6)])  # fmt: skip
FLOATS = 1  # the encoding of 32-bit floats


def read_densities(path: str | os.PathLike[str]) -> np.ndarray:
    """(nz, ny, nx) numbers of a file, x running fastest in ``.vol``; of a ``.vol`` its box is left aside.

    Raises
    ------
    SceneError
        If there is no such file, or it holds something else, or less than it says.
    """
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise SceneError(f"{path}: {unknown('suffix', path.suffix, SUFFIXES)}")
    try:
        if path.suffix.lower() == ".vol":
            return _read_vol(path)
        # A map cannot be larger than its file: a header that lies is found out before memory is taken.
        return np.array(np.load(path, mmap_mode="r", allow_pickle=False))
    except (OSError, ValueError, EOFError) as error:
        raise SceneError(f"{path}: {getattr(error, 'strerror', None) or error}; allowed: a file of densities") from None


def _read_vol(path: Path) -> np.ndarray:
    """Version 3: "VOL", 32-bit floats, nx ny nz, one channel, a box, then the densities."""
    data = path.read_bytes()
    if len(data) < VOL_HEADER.itemsize:
        raise ValueError("it is too short")
    head = np.frombuffer(data, VOL_HEADER, 1)[0]
    if head["magic"] != b"VOL" or head["version"] != 3:
        raise ValueError("it does not begin as a volume of version 3 does")
    if head["encoding"] != FLOATS or head["channels"] != 1:
        raise ValueError(f"encoding {head['encoding']}, {head['channels']} channels; only one of 32-bit floats is read")
    shape = tuple(int(n) for n in head["size"][::-1])
    count = shape[0] * shape[1] * shape[2]
    if min(shape) < 1 or len(data) < VOL_HEADER.itemsize + 4 * count:
        raise ValueError(f"it is too short for {shape[2]} x {shape[1]} x {shape[0]} densities")
    return np.frombuffer(data, "<f4", count, VOL_HEADER.itemsize).reshape(shape)
