"""Legends: a strip below a picture that says what its colours stand for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

LINE, MARGIN, BAR = 14, 6, 12  # pixels: height of a line of writing, space around it, height of a colour bar


class Bar(NamedTuple):
    """A colour bar between two numbers."""

    low: float
    high: float
    colors: Callable[[np.ndarray], np.ndarray]  # numbers 0 to 1 -> (n, 3) sRGB
    text: str


class Swatches(NamedTuple):
    """Named colours: (3,) sRGB and text each."""

    entries: Sequence[tuple[np.ndarray, str]]
    text: str


class Patch(NamedTuple):
    """A small picture, (n, n, 3) sRGB, and what it means."""

    pixels: np.ndarray
    text: str


Legend = Bar | Swatches | Patch


def strip(legend: Legend, width: int) -> np.ndarray:
    """The legend as a strip of that width: (height, width, 3) sRGB signal, white on black."""
    if isinstance(legend, Bar):
        return _bar(legend, width)
    if isinstance(legend, Patch):
        return _patch(legend, width)
    return _swatches(legend, width)


def _bar(legend: Bar, width: int) -> np.ndarray:
    out = np.zeros((BAR + 2 * LINE + 2 * MARGIN, width, 3))
    length = max(1, width - 2 * MARGIN)
    out[MARGIN : MARGIN + BAR, MARGIN : MARGIN + length] = legend.colors(np.linspace(0, 1, length))[: width - MARGIN]
    low, high = f"{legend.low:.4g}", f"{legend.high:.4g}"
    write(out, low, MARGIN, MARGIN + BAR)
    write(out, high, width - MARGIN - text_width(high), MARGIN + BAR)
    if width >= 260:
        middle = f"{0.5 * (legend.low + legend.high):.4g}"
        write(out, middle, (width - text_width(middle)) // 2, MARGIN + BAR)
    write(out, legend.text, MARGIN, MARGIN + BAR + LINE)
    return out


def _patch(legend: Patch, width: int) -> np.ndarray:
    side = legend.pixels.shape[0]
    out = np.zeros((max(side, LINE) + 2 * MARGIN, width, 3))
    out[MARGIN : MARGIN + side, MARGIN : MARGIN + side] = legend.pixels[:, : max(0, width - MARGIN)]
    lines = legend.text.split("\n")
    top = (out.shape[0] - LINE * len(lines)) // 2
    for k, line in enumerate(lines):
        write(out, line, side + 2 * MARGIN, top + k * LINE)
    return out


def _swatches(legend: Swatches, width: int) -> np.ndarray:
    places, x, y = [], MARGIN, MARGIN + (LINE if legend.text else 0)
    for color, name in legend.entries:
        needed = BAR + 4 + text_width(name) + 2 * MARGIN
        if x > MARGIN and x + needed > width:
            x, y = MARGIN, y + LINE + 2
        places.append((x, y, color, name))
        x += needed
    out = np.zeros((y + LINE + MARGIN, width, 3))
    if legend.text:
        write(out, legend.text, MARGIN, MARGIN // 2)
    for x, y, color, name in places:
        out[y + 1 : y + BAR, x : x + BAR] = color
        write(out, name, x + BAR + 4, y)
    return out


def text_width(text: str) -> int:
    """Width of a line of writing, pixels."""
    from PIL import ImageFont

    left, _, right, _ = ImageFont.load_default().getbbox(text)
    return int(np.ceil(right - left))


def write(out: np.ndarray, text: str, x: int, y: int) -> None:
    """Write a line of text with its top-left corner at x, y, but not left of the border; what does not fit is cut off."""
    x = max(x, 0)
    from PIL import Image, ImageDraw, ImageFont

    height, width = out.shape[:2]
    text = text.replace("²", "^2")  # which the font does not have
    if not text or x >= width or y >= height:
        return
    letters = Image.new("L", (max(1, width - x), min(LINE, height - y)))
    ImageDraw.Draw(letters).text((0, 0), text, fill=255, font=ImageFont.load_default())
    mask = np.asarray(letters, float)[..., None] / 255
    here = out[y : y + mask.shape[0], x : x + mask.shape[1]]
    here[:] = np.maximum(here, mask)
