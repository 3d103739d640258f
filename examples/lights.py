"""Six ways to light a teapot, as one picture: python examples/lights.py [lights.png] [samples]"""

from __future__ import annotations

import sys

import numpy as np

import sightray as sr
from sightray.scenes.teapot import teapot_mesh

WIDTH, HEIGHT = 320, 240
FLOOR = sr.Plane(point=(0, 0, 0), normal=(0, 1, 0), material=sr.Lambert(albedo=0.5))
CAMERA = sr.PerspectiveCamera(eye=(0.6, 1.9, 4.6), target=(0, 0.62, 0), vfov=34, width=WIDTH, height=HEIGHT)
POT = teapot_mesh(transform=sr.Transform.scale(0.45))


def studio() -> np.ndarray:
    """A dark studio with a soft box at the left, a strip of blue at the right and a warm floor: lat-long radiance."""
    picture = np.full((64, 128, 3), 0.03)
    picture[14:30, 34:50] = 7
    picture[10:40, 88:92] = (1, 3, 8)
    picture[40:] = (0.12, 0.09, 0.06)
    return picture


def stripes() -> np.ndarray:
    """Coloured stripes, each known by its neighbours, as scanners throw them."""
    colours = np.array([(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (0, 1, 1), (1, 0, 1)], float)
    order = np.random.default_rng(4).integers(1, 6, 40).cumsum() % 6
    return np.repeat(colours[order][None], 30, axis=0)


def lamps(count: int) -> list[sr.SphereLight]:
    """Little lamps of all colours over the floor, most of them far away."""
    rng = np.random.default_rng(1)
    at = np.stack([rng.uniform(-8, 8, count), rng.uniform(0.03, 0.3, count), rng.uniform(-9, 3, count)], axis=1)
    colours = rng.uniform(0, 7, (count, 3))
    return [sr.SphereLight(center=p, radius=0.018, radiance=c) for p, c in zip(at, colours, strict=True)]


def scenes() -> list[sr.Scene]:
    """The six, row by row."""
    matte = POT.replace(material=sr.Lambert(albedo=0.6))
    shiny = POT.replace(material=sr.Phong(diffuse=0.25, specular=0.5, shininess=60))
    glowing = POT.replace(material=sr.Emitter(radiance=(2.2, 1.2, 0.5)))
    ball = sr.Sphere(center=(1.25, 0.35, 1), radius=0.35, material=sr.Mirror())
    projector = sr.ProjectorLight(image=stripes(), eye=(-2.4, 2.2, 4), target=(0, 0.6, 0), vfov=22, intensity=70)
    return [
        sr.Scene(FLOOR, shiny, ball, sr.EnvironmentLight(image=studio()), camera=CAMERA),
        sr.Scene(FLOOR, matte, ball, sr.SunSky(direction=(-0.7, 0.8, 0.6), scale=0.008), camera=CAMERA),
        sr.Scene(FLOOR, matte, ball, sr.SunSky(direction=(-1, 0.13, 0.5), turbidity=3.5, scale=0.016), camera=CAMERA),
        sr.Scene(FLOOR, matte, projector, sr.EnvironmentLight(radiance=0.01), camera=CAMERA),
        sr.Scene(FLOOR, glowing, ball, camera=CAMERA),
        sr.Scene(FLOOR, matte, ball, *lamps(10_000), camera=CAMERA),
    ]


def main(path: str = "lights.png", samples: str = "256") -> None:
    pictures = [np.asarray(sr.render(s, sr.PathTracer(max_depth=4), samples=int(samples))) for s in scenes()]
    rows = [np.concatenate(pictures[k : k + 3], axis=1) for k in (0, 3)]
    sr.Image(np.concatenate(rows)).save(path)


if __name__ == "__main__":
    main(*sys.argv[1:])
