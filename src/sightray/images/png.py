"""PNG and JPEG through Pillow: 8 bits of [0, 1] per channel; 16-bit PNG can be read.

Colour profiles, gamma chunks and EXIF orientation are ignored: the rows come as they are stored, taken as sRGB.
"""

from __future__ import annotations

import io
import struct
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from sightray.errors import FormatError, SceneError
from sightray.images.base import Codec, StrPath, check_holds, check_size, decoding

_PNG, _JPEG = b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff"
_SAMPLES = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}  # PNG colour type -> samples per pixel
_DEFLATE = 1032  # no deflate stream expands more
_JPEG_DENSITY = 4096  # pixels per byte; Huffman coding ends at 512 (one bit per 8 x 8 block)


def read(path: Path, max_pixels: int) -> NDArray[Any]:
    """Read a PNG or a JPEG, whichever it is, to (h, w, 1 | 3 | 4) codes: uint8, or uint16 from a 16-bit PNG.

    A palette is expanded, CMYK is converted, grey with alpha becomes RGB with alpha.
    """
    with open(path, "rb") as file:
        head = file.read(8)
        file.seek(0)
        if head == _PNG:
            return _read_png(path, file, max_pixels)
        if head.startswith(_JPEG):
            return _read_jpeg(path, file, max_pixels)
    raise FormatError(f"neither PNG nor JPEG: it begins with {head!r}", path)


def _read_png(path: Path, file: IO[bytes], max_pixels: int) -> NDArray[Any]:
    from PIL import PngImagePlugin

    width, height, depth, colour = _check_png(path, file, max_pixels)
    file.seek(0)
    with decoding(path, "PNG"):
        # Open the plugin itself: Image.open has a pixel limit of its own, process-wide, that warns at a third of ours.
        image = PngImagePlugin.PngImageFile(file)
        if depth == 16 and colour != 0:
            return _read_16_bit(file, image, colour)
        if depth == 16:
            return np.asarray(image).astype(np.uint16).reshape(height, width, 1)
        transparent = image.mode in ("LA", "PA") or "transparency" in image.info
        mode = "RGBA" if transparent else {"1": "L", "P": "RGB"}.get(image.mode, image.mode)
        return np.asarray(image.convert(mode)).reshape(height, width, -1)


def _check_png(path: Path, file: IO[bytes], max_pixels: int) -> tuple[int, int, int, int]:
    """Walk the chunks to IEND; give width, height, bit depth and colour type.

    Pillow forgives a missing end, and takes memory for the picture before it has seen that the data is too short.
    """
    size = file.seek(0, 2)
    file.seek(8)
    header, data = b"", 0
    while True:
        start = file.tell()
        length, kind = struct.unpack(">I4s", file.read(8).ljust(8, b"\0"))
        end = start + 12 + length  # length, kind and checksum are four bytes each
        if end > size:
            raise FormatError("truncated PNG: no IEND chunk", path)
        if not header:
            if kind != b"IHDR" or length != 13:
                raise FormatError(f"PNG begins with chunk {kind!r} of {length} bytes; allowed: IHDR of 13", path)
            header = file.read(13)
        if kind == b"IEND":
            break
        data += length if kind == b"IDAT" else 0
        file.seek(end)
    width, height, depth, colour = struct.unpack(">IIBB", header[:10])
    if colour not in _SAMPLES:
        raise FormatError(f"PNG colour type {colour}; allowed: {', '.join(map(str, _SAMPLES))}", path)
    check_size(path, width, height, max_pixels)
    check_holds(path, width * height * depth * _SAMPLES[colour] // 8 // _DEFLATE, data)
    return width, height, depth, colour


def _read_16_bit(file: IO[bytes], image: Any, colour: int) -> NDArray[np.uint16]:
    """Full 16 bits of colour or alpha, of which Pillow keeps the high byte only.

    Its decoder undoes the compression and the row filters before a "raw mode" picks bytes out of each pixel, so
    another raw mode over the same data gives the low bytes. ``;16L`` means little-endian and keeps each second byte,
    which in this big-endian file is the low one. Grey with alpha has four bytes a pixel: read them as if RGBA.
    """

    def picked(raw_mode: str) -> NDArray[np.uint16]:
        file.seek(0)
        fresh = type(image)(file)
        fresh.tile = [_with_raw_mode(fresh.tile[0], raw_mode)]
        return np.asarray(fresh).astype(np.uint16)

    if colour == 4:
        grey_high, grey_low, alpha_high, alpha_low = np.moveaxis(picked("RGBA"), 2, 0)
        grey = grey_high << 8 | grey_low
        return np.stack([grey, grey, grey, alpha_high << 8 | alpha_low], axis=2).astype(np.uint16)
    return (picked(f"{image.mode};16B") << 8 | picked(f"{image.mode};16L")).astype(np.uint16)


def _with_raw_mode(tile: Any, raw_mode: str) -> Any:
    """The tile descriptor with another raw mode: a plain tuple up to Pillow 10, a named one since."""
    return tile._replace(args=raw_mode) if hasattr(tile, "_replace") else (*tile[:3], raw_mode)


def _read_jpeg(path: Path, file: IO[bytes], max_pixels: int) -> NDArray[np.uint8]:
    from PIL import JpegImagePlugin

    size = file.seek(0, 2)
    file.seek(0)
    with decoding(path, "JPEG"):
        image = JpegImagePlugin.JpegImageFile(file)
        check_size(path, image.width, image.height, max_pixels)
        check_holds(path, image.width * image.height // _JPEG_DENSITY, size)
        codes = np.asarray(image if image.mode in ("L", "RGB") else image.convert("RGB"))
        return codes.reshape(image.height, image.width, -1)


def write_png(target: StrPath | IO[bytes], pixels: NDArray[np.uint8], *, compression: int = 6) -> None:
    """Write (h, w, 1 | 3 | 4) uint8 as PNG, to a path or a stream; `compression` 0 (fast) to 9 (small)."""
    if compression not in range(10):
        raise SceneError(f"PNG compression {compression!r}; allowed: 0 to 9")
    _to_pillow(pixels).save(target, format="PNG", compress_level=compression)


def png_bytes(pixels: NDArray[np.uint8], *, compression: int = 6) -> bytes:
    """A PNG file of (h, w) or (h, w, 1 | 3 | 4) uint8."""
    stream = io.BytesIO()
    write_png(stream, pixels.reshape(*pixels.shape[:2], -1), compression=compression)
    return stream.getvalue()


def write_jpeg(path: Path, pixels: NDArray[np.uint8], *, quality: int = 95) -> None:
    """Write (h, w, 1 | 3) uint8 as JPEG without chroma subsampling; `quality` 1 to 100, lossy even at 100."""
    if quality not in range(1, 101):
        raise SceneError(f"JPEG quality {quality!r}; allowed: 1 to 100")
    if max(pixels.shape[:2]) > 65500:
        raise SceneError(f"JPEG of {pixels.shape[1]} x {pixels.shape[0]} pixels; allowed: up to 65500 a side")
    _to_pillow(pixels).save(path, format="JPEG", quality=quality, subsampling=0)


def _to_pillow(pixels: NDArray[np.uint8]) -> Any:
    from PIL import Image

    return Image.fromarray(np.ascontiguousarray(pixels[..., 0] if pixels.shape[2] == 1 else pixels))


CODECS = (
    Codec("PNG", (".png",), read, write_png, channels=(1, 3, 4), bitmap=True),
    Codec("JPEG", (".jpg", ".jpeg"), read, write_jpeg, channels=(1, 3), bitmap=True),
)
