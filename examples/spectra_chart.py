"""Draw the basis reflectances and the ColorChecker: python examples/spectra_chart.py [spectra.png]"""

from __future__ import annotations

import sys

import numpy as np
from PIL import Image as Picture
from PIL import ImageDraw, ImageFont

from sightray import spectra
from sightray.images.transfer import srgb_encode

WIDTH, CURVES, FIELD, GAP = 960, 360, 110, 14  # pixels
LEFT, TOP, FINE = 46, 14, 3  # everything is drawn FINE times as large, then reduced
FROM_NM, TO_NM = 380, 730
BACKGROUND, INK = (20, 20, 20), (170, 170, 170)


def byte_colour(rgb: np.ndarray) -> tuple[int, ...]:
    """sRGB bytes of a linear colour, brought into [0, 1]."""
    return tuple(np.round(255 * srgb_encode(np.clip(rgb, 0, 1))).astype(int).tolist())


def draw_basis(draw: ImageDraw.ImageDraw, font: ImageFont.FreeTypeFont | ImageFont.ImageFont) -> None:
    """Reflectance by wavelength of red, green and blue, over a strip of the colours that wavelengths have."""
    right, bottom = WIDTH - GAP, CURVES - 50
    x = lambda nm: FINE * (LEFT + (np.asarray(nm) - FROM_NM) / (TO_NM - FROM_NM) * (right - LEFT))  # noqa: E731
    y = lambda value: FINE * (bottom - np.asarray(value) * (bottom - TOP))  # noqa: E731
    for value in (0.0, 0.25, 0.5, 0.75, 1.0):
        draw.line([(x(FROM_NM), y(value)), (x(TO_NM), y(value))], fill=(60, 60, 60), width=FINE)
        draw.text((FINE * (LEFT - 8), y(value)), f"{value:.2f}", fill=INK, font=font, anchor="rm")
    for nm in range(400, TO_NM, 50):
        draw.text((x(nm), FINE * (CURVES - 12)), f"{nm} nm", fill=INK, font=font, anchor="mm")

    pure = spectra.rgb_bar() / spectra.rgb_bar().max()
    for nm in np.arange(FROM_NM, TO_NM, 0.25):
        colour = pure[int(nm) - 360]
        colour = 0.9 * (colour - min(0.0, colour.min())) + 0.003  # add white until no part is negative
        draw.rectangle([x(nm), FINE * (bottom + 8), x(nm + 0.25), FINE * (CURVES - 24)], fill=byte_colour(colour))

    at = (spectra.WAVELENGTHS >= FROM_NM) & (spectra.WAVELENGTHS <= TO_NM)
    for curve, colour in zip(spectra.basis().T, ((235, 70, 60), (70, 200, 80), (80, 130, 255)), strict=True):
        points = list(zip(x(spectra.WAVELENGTHS[at]).tolist(), y(curve[at]).tolist(), strict=True))
        draw.line(points, fill=colour, width=3 * FINE, joint="curve")


def draw_colorchecker(draw: ImageDraw.ImageDraw) -> None:
    """The chart's fields: above under D65, below under a tungsten lamp whose white is taken as white.

    The lower right quarter of each is not the measured reflectance but the one that its RGB is given by the basis.
    """
    wide = (WIDTH - GAP) / 6 - GAP
    lamp_white = spectra.illuminant("A").normalised().rgb()
    for i, measured in enumerate(spectra.colorchecker().values()):
        left, top = GAP + i % 6 * (wide + GAP), CURVES + GAP + i // 6 * (FIELD + GAP)
        rgb = measured.rgb("D65")
        quarters = {
            (left, top, left + wide, top + FIELD): rgb,
            (left, top + FIELD / 2, left + wide / 2, top + FIELD): measured.rgb("A") / lamp_white,
            (left + wide / 2, top + FIELD / 2, left + wide, top + FIELD): spectra.reflectance(rgb).rgb("A")
            / lamp_white,
        }
        for place, colour in quarters.items():
            draw.rectangle([FINE * v for v in place], fill=byte_colour(colour))


def main(path: str = "spectra.png") -> None:
    height = CURVES + GAP + 4 * (FIELD + GAP)
    picture = Picture.new("RGB", (FINE * WIDTH, FINE * height), BACKGROUND)
    draw = ImageDraw.Draw(picture)
    draw_basis(draw, ImageFont.load_default(size=FINE * 13))
    draw_colorchecker(draw)
    picture.resize((WIDTH, height), Picture.Resampling.LANCZOS).save(path)
    print(path)


if __name__ == "__main__":
    main(*sys.argv[1:])
