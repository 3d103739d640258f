"""Costs as colours: a map in perceptual order, and a picture with a scale in numbers."""

from __future__ import annotations

import numpy as np

BAR, MARGIN, LETTERS = 14, 6, 12  # pixels: height of the colour bar, space around it, height of its numbers


def paint(costs: np.ndarray) -> np.ndarray:
    """Costs (h, w) as colours, with a bar from 0 to the highest below: (h + strip, w, 3) float, linear Rec. 709."""
    width = costs.shape[1]
    most = max(1, int(costs.max()))
    strip = np.zeros((BAR + LETTERS + 3 * MARGIN, width, 3))
    if width > 2 * MARGIN + 1:
        strip[MARGIN : MARGIN + BAR, MARGIN:-MARGIN] = heat(np.linspace(0, 1, width - 2 * MARGIN))
        steps = 5 if width >= 60 * 5 else 2
        for part in np.linspace(0, 1, steps):
            write(strip, f"{most * part:.4g}" if part < 1 else str(most), part)
    return np.concatenate([heat(costs / most), strip])


def write(strip: np.ndarray, text: str, part: float) -> None:
    """Write a number below the colour bar, at a part of its length."""
    from PIL import Image, ImageDraw, ImageFont

    font = ImageFont.load_default()
    left, top, right, bottom = font.getbbox(text)
    size = (int(np.ceil(right - left)), int(np.ceil(bottom - top)))
    letters = Image.new("L", size)
    ImageDraw.Draw(letters).text((-left, -top), text, fill=255, font=font)
    mask = np.asarray(letters, float)[: LETTERS + MARGIN] / 255

    # Centre it at its place, but inside the picture.
    width = strip.shape[1]
    mask = mask[:, :width]
    x = int(np.clip(MARGIN + part * (width - 2 * MARGIN) - mask.shape[1] / 2, 0, width - mask.shape[1]))
    y = BAR + 2 * MARGIN
    strip[y : y + mask.shape[0], x : x + mask.shape[1]] = mask[..., None]


def heat(value: np.ndarray) -> np.ndarray:
    """Colours of numbers from 0 to 1: from dark violet by red to pale yellow, (..., 3) linear Rec. 709.

    The lightness L* of CIELAB (CIE 1976) grows in proportion to the number, so that equal differences look alike, and
    prints in grey say the same. Meanwhile the hue turns once through a third of the circle; the colours are saturated in
    the middle, where the gamut has room.
    """
    v = np.clip(np.asarray(value, float), 0, 1)[..., None]
    lightness = 6 + 88 * v
    hue = np.radians(-65 + 165 * v)
    chroma = 18 + 46 * np.sin(np.pi * v**0.9) + 24 * v
    f = (lightness + 16) / 116 + np.concatenate(
        [chroma * np.cos(hue) / 500, 0 * v, -chroma * np.sin(hue) / 200], axis=-1
    )
    linear = np.where(f > 6 / 29, f**3, 3 * (6 / 29) ** 2 * (f - 4 / 29)) * [0.95047, 1.0, 1.08883]  # X Y Z, D65
    rgb = linear @ np.array([[3.2404542, -0.969266, 0.0556434], [-1.5371385, 1.8760108, -0.2040259],
                             [-0.4985314, 0.041556, 1.0572252]])  # fmt: skip
    # Colours outside the gamut move towards the grey of the same luminance.
    grey = linear[..., 1:2]
    below = np.where(rgb < 0, grey / np.maximum(grey - rgb, 1e-9), 1.0).min(axis=-1, keepdims=True)
    above = np.where(rgb > 1, (1 - grey) / np.maximum(rgb - grey, 1e-9), 1.0).min(axis=-1, keepdims=True)
    return np.clip(grey + (rgb - grey) * np.minimum(below, above), 0.0, 1.0)
