"""Pictures that shine: the field that holds one, and its pixels for kernels."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from sightray._jit import kernel
from sightray.errors import SceneError
from sightray.fields import REQUIRED, other
from sightray.mathlib.eights import I64x8, Vec3x8, gather8f
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, f32_at
from sightray.mathlib.vec import Vec3

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of linear Rec. 709


def picture(default: Any = REQUIRED) -> Any:
    """A field for a picture: a file, or an array."""
    return other("picture file, or linear floats of shape (h, w), (h, w, 1), (h, w, 3) or (h, w, 4)", _source,
                 default=default, plain=_plain)  # fmt: skip


def _source(value: Any) -> Any:
    """A path, or a read-only (h, w, channels) float32 array."""
    from sightray.images import Image

    if value is None:
        return None
    if isinstance(value, str | os.PathLike):
        return Path(value)
    try:
        return (value if isinstance(value, Image) else Image(value)).pixels
    except (TypeError, ValueError) as error:  # numbers in rows of unequal length, among others
        raise SceneError(f"{error}. Or give the path of a picture") from None


def _plain(value: Any) -> Any:
    return str(value) if isinstance(value, Path) else None if value is None else value.tolist()


def radiant_pixels(image: Any, who: str) -> np.ndarray:
    """Linear pixels, (h, w, 3) float32, read-only; a file is read, negative values count as 0, alpha is ignored.

    Raises
    ------
    SceneError
        If there are infinite or undefined numbers among them, or the file cannot be read.
    """
    from sightray.images import load_image

    where = image if isinstance(image, Path) else "the array"
    found = load_image(image).pixels if isinstance(image, Path) else image
    if not np.isfinite(found[..., :3]).all():
        raise SceneError(f"{who}.image: {where} holds infinite or undefined numbers; allowed: finite ones")
    pixels = np.ascontiguousarray(np.broadcast_to(np.maximum(found[..., :3], 0.0), (*found.shape[:2], 3)), np.float32)
    pixels.flags.writeable = False
    return pixels


@kernel
def pixel_at(pixels: Table, w: i64, column: i64, row: i64) -> Vec3:
    """Colour of a pixel of a picture w pixels wide; row 0 is on top."""
    at = 3 * (row * w + column)
    return Vec3(float(f32_at(pixels, at)), float(f32_at(pixels, at + 1)), float(f32_at(pixels, at + 2)), 0.0)


@kernel
def pixel8_at(pixels: Table, w: i64, column: I64x8, row: I64x8) -> Vec3x8:
    """`pixel_at` for eight pixels."""
    at = (row * w + column) * 3
    return Vec3x8(gather8f(pixels, at), gather8f(pixels, at + 1), gather8f(pixels, at + 2))
