"""Radiance HDR (RGBE): three 8-bit mantissas and a shared exponent; 76 decades, one part in 256.

Lossy: each channel is off by at most 1/256 of the pixel's largest channel. Negative values and NaN are stored as 0,
values above 1.69e38 as that; grey becomes RGB and alpha is left out. A mantissa m stands for m, as in nearly every
reader, not for m + 1/2 as in Radiance's own, so black stays black.

References: G. Ward, "Real Pixels", Graphics Gems II, 1991; Radiance's filefmts document, "Pictures".
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sightray.errors import FormatError, UnsupportedError
from sightray.images.base import Codec, check_holds, check_size

_LARGEST = 255.0 * 2.0**119  # mantissa 255 at exponent 255
_RUN_WIDTHS = range(8, 32768)  # widths of scan lines that the run-length code can express
_SHORTEST_RUN = 4  # a run packet costs two bytes and may split a literal, which costs a third
_SIZE = re.compile(rb"([-+])([XY]) (\d{1,10}) ([-+])([XY]) (\d{1,10})\s*")


def read(path: Path, max_pixels: int) -> NDArray[np.float32]:
    """Read to (h, w, 3) float32 >= 0, divided by the header's EXPOSURE; any of the eight scan orders."""
    with open(path, "rb") as file:
        start, exposure, (sign_a, axis_a, count_a), (sign_b, axis_b, count_b) = _parse_header(path, file.read(65536))
        check_size(path, count_b if axis_a == b"Y" else count_a, count_a if axis_a == b"Y" else count_b, max_pixels)
        longest = count_a * (4 + 8 * count_b)  # every component of every pixel a run of one
        length = min(file.seek(0, 2) - start, longest)
        file.seek(start)
        body = memoryview(file.read(length))

    # Decode scan lines (count_a of them) of count_b pixels, then turn them to rows from the top, left to right.
    if count_b in _RUN_WIDTHS and body[:2] == b"\x02\x02" and len(body) > 2 and body[2] < 128:
        rgbe = _decode_runs(path, body, count_a, count_b)
    else:
        rgbe = _decode_flat(path, body, count_a, count_b)
    if axis_a == b"X":
        rgbe = rgbe.swapaxes(0, 1)
    signs = {axis_a: sign_a, axis_b: sign_b}
    rgbe = rgbe[:: 1 if signs[b"Y"] == b"-" else -1, :: 1 if signs[b"X"] == b"+" else -1]
    pixels = _from_rgbe(rgbe)
    return pixels if exposure == 1 else pixels / np.float32(exposure)


def write(path: Path, pixels: NDArray[Any]) -> None:
    """Write (h, w, 3) float32 with run-length coded scan lines (flat where the width allows no runs)."""
    height, width, _ = pixels.shape
    rgbe = _to_rgbe(pixels)
    with open(path, "wb") as file:
        file.write(f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode("ascii"))
        if width not in _RUN_WIDTHS:
            file.write(rgbe.tobytes())
            return
        for row in rgbe:
            file.write(bytes((2, 2, width >> 8, width & 255)))
            for component in row.T:
                file.write(_encode_runs(np.ascontiguousarray(component)))


def _to_rgbe(pixels: NDArray[Any]) -> NDArray[np.uint8]:
    """(h, w, 3) floats to (h, w, 4) bytes, rounded to nearest."""
    x = np.clip(np.nan_to_num(pixels.astype(np.float64), nan=0.0, posinf=_LARGEST), 0.0, _LARGEST)
    exponent = np.frexp(x.max(axis=2))[1]  # largest channel = [0.5, 1) * 2**exponent
    mantissa = np.minimum(np.floor(np.ldexp(x, 8 - exponent[..., np.newaxis]) + 0.5), 255.0)
    mantissa[exponent < -127] = 0.0
    stored = np.where(mantissa.max(axis=2) > 0, exponent + 128, 0)
    return np.concatenate([mantissa, stored[..., np.newaxis]], axis=2).astype(np.uint8)


def _from_rgbe(rgbe: NDArray[np.uint8]) -> NDArray[np.float32]:
    exponent = rgbe[..., 3:].astype(np.int32)
    unit = np.ldexp(np.float32(1), exponent - 136)
    return rgbe[..., :3].astype(np.float32) * np.where(exponent == 0, np.float32(0), unit)


def _encode_runs(line: NDArray[np.uint8]) -> bytes:
    """One component of one scan line: ``128 + n, value`` for a run of n <= 127, ``n, values`` for n <= 128 literals."""
    edges = np.flatnonzero(np.diff(line)) + 1
    starts = np.concatenate([[0], edges])
    lengths = np.diff(np.concatenate([starts, [line.size]]))
    long = lengths >= _SHORTEST_RUN
    out, raw, done = bytearray(), line.tobytes(), 0
    for start, length in [*zip(starts[long].tolist(), lengths[long].tolist(), strict=True), (line.size, 0)]:
        for i in range(done, start, 128):
            literal = raw[i : min(i + 128, start)]
            out.append(len(literal))
            out += literal
        for i in range(0, length, 127):
            out += bytes((128 + min(127, length - i), raw[start]))
        done = start + length
    return bytes(out)


def _decode_runs(path: Path, body: memoryview, lines: int, width: int) -> NDArray[np.uint8]:
    check_holds(path, lines * (4 + 4 * 2 * -(-width // 127)), len(body))
    planes = bytearray(lines * 4 * width)
    head, at, done = bytes((2, 2, width >> 8, width & 255)), 0, 0
    try:
        for line in range(lines):
            if body[at : at + 4] != head:
                raise FormatError(f"scan line {line} begins with {bytes(body[at : at + 4])!r}, not {head!r}", path)
            at += 4
            for end in range(done + width, done + 4 * width + 1, width):
                while done < end:
                    code = body[at]
                    count = code - 128 if code > 128 else code
                    if not 0 < count <= end - done:
                        raise FormatError(f"scan line {line}: run of {count} with {end - done} pixels to go", path)
                    if code > 128:
                        planes[done : done + count] = bytes((body[at + 1],)) * count
                        at += 2
                    else:
                        literal = body[at + 1 : at + 1 + count]
                        if len(literal) < count:
                            raise IndexError
                        planes[done : done + count] = literal
                        at += 1 + count
                    done += count
    except IndexError:
        raise FormatError(f"truncated in scan line {line} of {lines}", path) from None
    return np.frombuffer(planes, np.uint8).reshape(lines, 4, width).swapaxes(1, 2)


def _decode_flat(path: Path, body: memoryview, lines: int, width: int) -> NDArray[np.uint8]:
    """Four bytes a pixel; ``1 1 1 n`` repeats the pixel before it n times, a second such marker n * 256 times."""
    needed = lines * width
    stored = np.frombuffer(body[: min(len(body), 4 * needed) // 4 * 4], np.uint8).reshape(-1, 4)
    marker = (stored[:, :3] == 1).all(axis=1)
    if not marker.any():
        check_holds(path, 4 * needed, len(body))
        return stored.reshape(lines, width, 4)

    # Give every pixel and marker its count, stop where the picture is full, and repeat the last pixel seen.
    index = np.arange(len(stored))
    pixel = np.maximum.accumulate(np.where(marker, -1, index))
    shift = 8 * np.clip(index - pixel - 1, 0, 4)
    counts = np.where(marker, stored[:, 3].astype(np.int64) << shift, 1)
    counts = np.minimum(counts, needed + 1)  # too many is too many; a sum of 40-bit counts could overflow
    used = int(np.searchsorted(np.cumsum(counts), needed)) + 1
    if pixel[0] < 0 or used > len(stored) or counts[:used].sum() != needed:
        raise FormatError(f"flat scan lines do not add up to {lines} x {width} pixels", path)
    return stored[np.repeat(pixel[:used], counts[:used])].reshape(lines, width, 4)


def _parse_header(path: Path, head: bytes) -> tuple[int, float, tuple[bytes, bytes, int], tuple[bytes, bytes, int]]:
    """Start of the scan lines, exposure, and (sign, axis, count) of the outer and the inner direction."""
    if not head.startswith((b"#?RADIANCE", b"#?RGBE")):
        raise FormatError(f"not a Radiance file: it begins with {head[:10]!r}, not '#?RADIANCE'", path)
    text, blank, rest = head.partition(b"\n\n")
    size, end, _ = rest.partition(b"\n")
    match = _SIZE.fullmatch(size)
    if not blank or not end or match is None or match[2] == match[5]:
        raise FormatError(f"size line {size[:40]!r}; allowed: like '-Y 480 +X 640', after an empty line", path)
    exposure = 1.0
    for number, line in enumerate(text.split(b"\n"), start=1):
        name, _, value = (part.strip() for part in line.partition(b"="))
        if name == b"FORMAT" and value == b"32-bit_rle_xyze":
            raise UnsupportedError(f"{path}: XYZE pixels; allowed: 32-bit_rle_rgbe")
        if name == b"FORMAT" and value != b"32-bit_rle_rgbe":
            raise FormatError(f"FORMAT={value[:40].decode('latin-1')}; allowed: 32-bit_rle_rgbe", path, number)
        if name == b"EXPOSURE":
            exposure *= _positive(path, number, value)
    if not 1e-30 < exposure < 1e30:
        raise FormatError(f"EXPOSURE values multiply to {exposure}; allowed: 1e-30 to 1e30", path)
    start = len(text) + len(blank) + len(size) + len(end)
    return start, exposure, (match[1], match[2], int(match[3])), (match[4], match[5], int(match[6]))


def _positive(path: Path, line: int, text: bytes) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < float("inf"):
        raise FormatError(f"EXPOSURE={text[:40].decode('latin-1')}; allowed: a positive number", path, line)
    return value


CODECS = (Codec("Radiance HDR", (".hdr",), read, write, channels=(3,)),)
