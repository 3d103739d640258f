"""Mirror spheres that spell a letter: a scene that fits on a business card."""

from __future__ import annotations

import sightray as sr

ROWS = ("###", "#  ", "###", "  #", "###")


def build() -> sr.Scene:
    chrome = sr.Phong(diffuse=0.04, specular=0.6, shininess=99, mirror=0.72)
    floor = sr.Phong(
        diffuse=sr.Checker(even=(0.6, 0.08, 0.06), odd=0.62, scale=1.0, mode="solid"), ambient=0.8, specular=0
    )
    balls = [
        sr.Sphere(center=(1.05 * (x - 1), 0.5 + 1.05 * (4 - y), -0.25 * (4 - y)), radius=0.5, material=chrome)
        for y, row in enumerate(ROWS) for x, mark in enumerate(row) if mark == "#"
    ]  # fmt: skip
    return sr.Scene(
        *balls,
        sr.Plane(point=(0, 0, 0), normal=(0, 1, 0), material=floor),
        sr.RectangleLight(corner=(5, 9, 5), edge_u=(2, 0, -2), edge_v=(1.5, 0, 1.5), radiance=22, grid=3, visible=False),
        camera=sr.PerspectiveCamera(eye=(4.6, 3.4, 9.5), target=(0.1, 2.35, 0), vfov=36, width=640, height=480),
        background=(0.35, 0.52, 0.75), ambient=0.2, samples=9, name="spheres",
    )  # fmt: skip
