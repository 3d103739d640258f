"""A teapot with a painted glaze in the open, lit by a picture of the whole sky."""

from __future__ import annotations

import numpy as np

import sightray as sr
from sightray.scenes.teapot import teapot_mesh

SUN = np.array([0.5, 0.6, 0.62]) / np.linalg.norm([0.5, 0.6, 0.62])


def sky(height: int = 128) -> np.ndarray:
    """A lat-long picture, (height, 2 height, 3): blue above, hazy at the horizon, a small sun, brown ground."""
    row, column = np.mgrid[:height, : 2 * height]
    theta, phi = (row + 0.5) / height * np.pi, ((column + 0.5) / (2 * height) - 0.5) * 2 * np.pi
    d = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)], axis=-1)
    up = d[..., 1:2]
    haze = np.exp(-4 * np.abs(up))
    above = (1 - haze) * (0.16, 0.32, 0.75) + haze * (0.8, 0.85, 0.95)
    below = (1 - haze) * (0.16, 0.13, 0.1) + haze * (0.3, 0.28, 0.25)
    sun = 400.0 * np.exp((d @ SUN - 1)[..., None] / 4e-4) * (1.0, 0.9, 0.75)
    return np.where(up > 0, above + sun, below).astype(np.float32)


def glaze(side: int = 256) -> np.ndarray:
    """A painted pattern that repeats, (side, side, 3)."""
    y, x = (np.mgrid[:side, :side] + 0.5) / side * 2 * np.pi
    waves = 0.5 + 0.5 * np.sin(4 * x + 1.5 * np.sin(3 * y)) * np.cos(6 * y)
    petals = (np.abs(np.sin(4 * x)) + np.abs(np.sin(4 * y)) > 1.75)[..., None]
    paint = waves[..., None] * (0.75, 0.78, 0.8) + (1 - waves[..., None]) * (0.08, 0.16, 0.45)
    return np.where(petals, (0.75, 0.2, 0.1), paint).astype(np.float32)


def build() -> sr.Scene:
    pot = teapot_mesh(segments=16, material=sr.Lambert(albedo=sr.Bitmap(image=glaze())), name="teapot")
    floor = sr.Mesh(vertices=[(-30, 0, 30), (30, 0, 30), (30, 0, -30), (-30, 0, -30)], faces=[(0, 1, 2), (0, 2, 3)],
                    material=sr.Lambert(albedo=(0.45, 0.42, 0.38)), name="ground")  # fmt: skip
    return sr.Scene(
        pot, floor, sr.EnvironmentLight(image=sky(), grid=2),
        camera=sr.PerspectiveCamera(eye=(2.6, 4.6, 8.6), target=(0.1, 1.2, 0), vfov=34, width=512, height=384),
        samples=64, integrator=sr.PathTracer(max_depth=6, light_samples=4), name="teapot-under-sky",
    )  # fmt: skip
