"""A hall with a thousand small lamps of all colours: what choosing lights well is worth."""

from __future__ import annotations

import numpy as np

import sightray as sr
from sightray.scenes.teapot import teapot_mesh

COUNT = 1000
HALL = ((-6.0, 0.0, -6.0), (6.0, 4.0, 6.0))


def lamps() -> list[sr.RectangleLight]:
    """Little panels below the ceiling and along the walls, facing inwards or down."""
    rng = np.random.default_rng(7)
    found = []
    for _ in range(COUNT):
        x, z = rng.uniform(-5.8, 5.8, 2)
        y, size = rng.uniform(1.5, 3.9), rng.uniform(0.02, 0.05)
        hue = rng.dirichlet((1.0, 1.0, 1.0)) * rng.uniform(2.0, 40.0)
        found.append(sr.RectangleLight(
            corner=(x, y, z), edge_u=(size, 0, 0), edge_v=(0, 0, size), radiance=tuple(hue), grid=1
        ))  # fmt: skip
    return found


def build() -> sr.Scene:
    hall = sr.Box(lower=HALL[0], upper=HALL[1], material=sr.Lambert(albedo=(0.75, 0.72, 0.68)))
    pots = [
        sr.Instance(of=POT, transform=sr.Transform.translate(x, 0, z) @ sr.Transform.rotate((0, 1, 0), 50 * x + 20 * z)
                    @ sr.Transform.scale(0.35))
        for x, z in [(-3, -2), (0, -3), (3, -2), (-1.5, 0.5), (2, 1)]
    ]  # fmt: skip
    return sr.Scene(
        hall, *pots, *lamps(),
        camera=sr.PerspectiveCamera(eye=(0, 1.8, 5.8), target=(0, 0.8, -1), vfov=55, width=512, height=384),
        samples=64, integrator=sr.PathTracer(max_depth=4), name="thousand-lights",
    )  # fmt: skip


POT = teapot_mesh(segments=8, material=sr.Lambert(albedo=(0.8, 0.6, 0.4)), name="teapot")
