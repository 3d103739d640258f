"""Transfer curves: from linear floats to the bytes of a bitmap, and back."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

_SLAB = 1 << 20  # values encoded at a time: bounds the float64 temporaries, which for 4K RGB would be 200 MB each


def srgb_encode(linear: NDArray[Any]) -> NDArray[np.float64]:
    """sRGB signal in [0, 1] of linear values in [0, 1].

    References: IEC 61966-2-1:1999.
    """
    x = np.asarray(linear, dtype=np.float64)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.power(x, 1 / 2.4) - 0.055)


def srgb_decode(signal: NDArray[Any]) -> NDArray[np.float64]:
    """Linear values in [0, 1] of an sRGB signal in [0, 1]; the inverse of `srgb_encode`."""
    s = np.asarray(signal, dtype=np.float64)
    return np.where(s <= 0.04045, s / 12.92, np.power((s + 0.055) / 1.055, 2.4))


def _srgb_bytes(x: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.floor(255.0 * srgb_encode(x) + 0.5)


def _round_bytes(x: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.floor(255.0 * x + 0.5)


def _floor_bytes(x: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.floor(255.0 * x)


def _gamma_bytes(x: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.floor(255.0 * np.power(x, 1 / 2.2))


# name -> (rule for colour, rule for alpha); alpha is a coverage, so no curve ever bends it
TRANSFERS: dict[str, tuple[Callable[..., NDArray[np.float64]], Callable[..., NDArray[np.float64]]]] = {
    "srgb": (_srgb_bytes, _round_bytes),
    "floor": (_floor_bytes, _floor_bytes),
    "gamma2.2": (_gamma_bytes, _floor_bytes),
}


def encode_bytes(pixels: NDArray[np.float32], transfer: str) -> NDArray[np.uint8]:
    """Bytes of linear pixels (h, w, c) by the rule called `transfer`; NaN becomes 0, +inf 255, -inf 0."""
    height, width, channels = pixels.shape
    colours = min(channels, 3)
    colour_rule, alpha_rule = TRANSFERS[transfer]
    out = np.empty(pixels.shape, dtype=np.uint8)
    rows = max(1, _SLAB // (width * channels))
    for top in range(0, height, rows):
        slab = pixels[top : top + rows].astype(np.float64)
        slab = np.clip(np.nan_to_num(slab, copy=False, nan=0.0, posinf=1.0, neginf=0.0), 0.0, 1.0)
        out[top : top + rows, :, :colours] = colour_rule(slab[..., :colours])
        out[top : top + rows, :, colours:] = alpha_rule(slab[..., colours:])
    return out


def decode_codes(codes: NDArray[Any], *, linear: bool) -> NDArray[np.float32]:
    """Linear floats of a bitmap's uint8 or uint16 codes (h, w, c); `linear` skips the sRGB curve.

    A table of all 256 or 65536 answers costs one power per code instead of one per pixel.
    """
    signal = np.arange(np.iinfo(codes.dtype).max + 1) / np.iinfo(codes.dtype).max
    plain = signal.astype(np.float32)
    if linear:
        return plain[codes]
    colours = min(codes.shape[2], 3)
    out = np.empty(codes.shape, dtype=np.float32)
    out[..., :colours] = srgb_decode(signal).astype(np.float32)[codes[..., :colours]]
    out[..., colours:] = plain[codes[..., colours:]]
    return out
