"""The five stages of the lecture as one labelled strip: ``python examples/lecture_stages.py [strip.png]``."""

from __future__ import annotations

import sys

import numpy as np
from PIL import Image, ImageDraw, ImageFont

import sightray as sr

STAGES = {
    "ray casting": {"illumination": False, "shadows": False, "reflections": False, "refractions": False},
    "+ local illumination": {"shadows": False, "reflections": False, "refractions": False},
    "+ shadows": {"reflections": False, "refractions": False},
    "+ reflections": {"refractions": False},
    "+ refractions": {},
}


def strip(scene: sr.Scene) -> Image.Image:
    """Render each stage and put them side by side, each with its name below."""
    pictures = [sr.render(scene, sr.Whitted(**switches)).to_bytes() for switches in STAGES.values()]
    height, width, _ = pictures[0].shape
    canvas = Image.new("RGB", (width * len(pictures), height + 32), "white")
    draw = ImageDraw.Draw(canvas)
    for index, (name, picture) in enumerate(zip(STAGES, pictures, strict=True)):
        canvas.paste(Image.fromarray(np.ascontiguousarray(picture)), (index * width, 0))
        draw.text((index * width + width / 2, height + 6), name, "black", ImageFont.load_default(18), anchor="ma")
    return canvas


if __name__ == "__main__":
    path = sys.argv[1] if len(sys.argv) > 1 else "lecture_stages.png"
    scene = sr.load("stage5-refractions")
    strip(scene.replace(camera=scene.camera.resized(320, 240))).save(path)
    print(path)
