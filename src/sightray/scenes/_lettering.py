"""Plates with writing on them, for scenes that label what they show."""

from __future__ import annotations

import numpy as np

import sightray as sr


def lettering(text: str, size: int = 48) -> np.ndarray:
    """Dark text on a light plate: (height, width, 3) float32, linear, drawn with Pillow's own font."""
    from PIL import Image, ImageDraw, ImageFont

    font = ImageFont.load_default(size)
    left, _, right, _ = font.getbbox(text)
    margin = size // 3
    plate = Image.new("L", (int(right - left) + 2 * margin, int(size * 1.2) + margin), 235)
    ImageDraw.Draw(plate).text((margin - left, margin // 2), text, font=font, fill=25)
    grey = (np.asarray(plate, np.float32) / 255) ** 2.2
    return np.repeat(grey[..., None], 3, axis=2)


def plate(text: str, center: tuple[float, float, float], height: float, tilt: float = 0.5) -> sr.Rectangle:
    """A plate with its middle at `center`, facing +z and leaning back by `tilt` (depth per height)."""
    image = lettering(text)
    width = height * image.shape[1] / image.shape[0]
    x, y, z = center
    return sr.Rectangle(
        corner=(x - width / 2, y - height / 2, z + tilt * height / 2), edge_u=(width, 0, 0),
        edge_v=(0, height, -tilt * height),
        material=_paper(image), name=text,
    )  # fmt: skip


def _paper(image: np.ndarray) -> sr.Phong:
    texture = sr.Bitmap(image=image, wrap="clamp")
    return sr.Phong(diffuse=texture, ambient=texture)
