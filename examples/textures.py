"""Every kind of texture: `python examples/textures.py FOLDER` saves a sheet of them, and a floor to the horizon."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import sightray as sr

T = sr.Transform


def sheet() -> sr.Scene:
    """Eight textures on balls and boxes."""
    textures = [
        sr.Noise(scale=2),
        sr.Noise(scale=2, turbulence=True, contrast=2.5, dark=(0.8, 0.7, 0.15), light=(0.6, 0.04, 0.02)),
        sr.Marble(scale=1.5),
        sr.Wood(axis=(0.2, 1, 0.1), scale=8),
        sr.Gradient(along="y", begin=-1, end=1, colors=[(0.1, 0.2, 0.7), (0.8, 0.8, 0.8), (0.7, 0.15, 0.1)]),
        sr.Triplanar(x=sr.Checker(even=(0.7, 0.2, 0.2), odd=0.7, scale=3), y=sr.Checker(even=(0.2, 0.6, 0.2), scale=3),
                     z=sr.Checker(even=(0.2, 0.3, 0.8), odd=0.7, scale=3)),
        sr.UvTransform(texture=sr.Checker(scale=8), rotate=30, scale=(2, 1)),
        sr.Multiply(a=sr.Noise(mode="uv", scale=6, octaves=2, dark=0.4), b=(0.9, 0.5, 0.2)),
    ]  # fmt: skip
    objects = []
    for k, texture in enumerate(textures):
        material = sr.Lambert(albedo=texture)
        shape = sr.Sphere(material=material)
        if k in (2, 3):
            shape = sr.Box(lower=(-0.8,) * 3, upper=(0.8,) * 3, material=material)
        place = T.translate(k % 4 * 2.4 - 3.6, 1.2 - k // 4 * 2.4, 0) @ T.rotate((0.3, 1, 0), 30)
        objects.append(sr.Instance(of=shape, transform=place))
    camera = sr.PerspectiveCamera(eye=(0, 0, 11), target=(0, 0, 0), vfov=27, width=800, height=420)
    return sr.Scene(*objects, sr.PointLight(position=(4, 6, 12), intensity=550), camera=camera, background=0.6, ambient=0.1)


def floor(filter: str) -> sr.Scene:
    """Tiles as a picture, to the horizon."""
    tiles = np.kron(np.indices((8, 8)).sum(0) % 2, np.ones((16, 16)))[..., None].astype(np.float32)
    material = sr.Lambert(albedo=sr.Bitmap(image=0.1 + 0.7 * tiles, filter=filter, scale=60))
    ground = sr.Rectangle(corner=(-100, 0, 30), edge_u=(200, 0, 0), edge_v=(0, 0, -200), material=material)
    camera = sr.PerspectiveCamera(eye=(0, 2, 20), target=(0, 0.5, 0), width=400, height=200)
    sun = sr.DirectionalLight(direction=(0, -1, -0.3), irradiance=3.0)
    return sr.Scene(ground, sun, camera=camera, background=(0.4, 0.6, 0.9))


if __name__ == "__main__":
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    folder.mkdir(parents=True, exist_ok=True)
    sr.render(sheet(), sr.Whitted(), samples=16).save(folder / "textures.png")
    halves = [np.asarray(sr.render(floor(filter), sr.Whitted(), samples=1)) for filter in ("bilinear", "trilinear")]
    sr.Image(np.concatenate(halves, axis=1)).save(folder / "trilinear.png")
