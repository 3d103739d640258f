"""PNG files with 16 bits per channel, one or three channels: what Pillow does not write.

Reference: ISO/IEC 15948:2004, Portable Network Graphics.
"""

from __future__ import annotations

import struct
import zlib

import numpy as np

_GREY, _COLOUR, _UP = 0, 2, 2
LEVEL = 4  # of zlib: a tenth larger than 9 at a tenth of the time


def png16(values: np.ndarray) -> bytes:
    """A PNG file of (height, width) or (height, width, 3) uint16.

    Rows are stored as differences from the row above (filter 2), byte by byte.
    """
    height, width = values.shape[:2]
    rows = np.ascontiguousarray(values, ">u2").view(np.uint8).reshape(height, -1)
    filtered = np.empty((height, 1 + rows.shape[1]), np.uint8)
    filtered[:, 0] = _UP
    filtered[0, 1:] = rows[0]
    np.subtract(rows[1:], rows[:-1], out=filtered[1:, 1:])
    head = struct.pack(">IIBBBBB", width, height, 16, _COLOUR if values.ndim == 3 else _GREY, 0, 0, 0)
    parts = [(b"IHDR", head), (b"IDAT", zlib.compress(filtered.tobytes(), LEVEL)), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, data) for kind, data in parts)


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
