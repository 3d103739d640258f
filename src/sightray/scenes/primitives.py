"""Every shape there is, each on its own plinth with its name."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import sightray as sr
from sightray.scenes._lettering import plate
from sightray.scenes.teapot import teapot_mesh

COLUMNS = 5
PITCH_X, PITCH_Z = 2.25, 3.3
COLORS = (
    (0.8, 0.25, 0.15),
    (0.85, 0.6, 0.12),
    (0.25, 0.55, 0.25),
    (0.15, 0.4, 0.7),
    (0.5, 0.25, 0.6),
    (0.15, 0.6, 0.6),
)


def specimens() -> dict[str, Any]:
    """One example of each shape, about one metre in size, standing on y = 0: class name -> object."""
    star = [(math.sin(k * math.pi / 5) * r, 0.78 + math.cos(k * math.pi / 5) * r, 0.0)
            for k, r in enumerate([0.75, 0.32] * 5)]  # fmt: skip
    hole = [(0.17 * math.cos(a), 0.78 + 0.17 * math.sin(a), 0.0) for a in np.linspace(0, 2 * math.pi, 24)[:-1]]
    z, a = 1 - (2 * np.arange(400) + 1) / 400, 2.399963 * np.arange(400)  # a spiral of even steps, by the golden angle
    cloud = np.stack([np.sqrt(1 - z * z) * np.cos(a), z, np.sqrt(1 - z * z) * np.sin(a)], axis=1)
    lift, turn, size = sr.Transform.translate, sr.Transform.rotate, sr.Transform.scale
    return {
        "Sphere": sr.Sphere(center=(0, 0.7, 0), radius=0.7),
        "Disk": sr.Disk(center=(0, 0.7, 0), normal=(0, 0.35, 1), radius=0.7, inner_radius=0.25),
        "Rectangle": sr.Rectangle(corner=(-0.6, 0.05, 0.25), edge_u=(1.2, 0, 0), edge_v=(0, 1.1, -0.5)),
        "Box": sr.Box(lower=(-0.5, 0, -0.5), upper=(0.5, 1.0, 0.5), transform=turn((0, 1, 0), 30)),
        "Triangle": sr.Triangle(a=(-0.75, 0.05, 0.2), b=(0.75, 0.05, 0.2), c=(0, 1.35, -0.2)),
        "Mesh": sr.Instance(of=teapot_mesh(8), transform=size(0.3)),
        "Polygon": sr.Polygon(outline=star, holes=[hole]),
        "Cylinder": sr.Cylinder(base=(0, 0, 0), top=(0, 1.2, 0), radius=0.5),
        "Cone": sr.Cone(base=(0, 0, 0), top=(0, 1.3, 0), base_radius=0.65, top_radius=0.2),
        "Quadric": sr.Instance(
            of=sr.Quadric.hyperboloid(radii=(0.28, 0.42, 0.28), height=1.3),
            transform=lift(0, 0.65, 0),
        ),
        "Torus": sr.Torus(center=(0, 0.7, 0), axis=(0, 0.5, 1), major_radius=0.5, minor_radius=0.2),
        "Implicit": sr.Implicit(
            expression="(x**2 + 9/4*y**2 + z**2 - 1)**3 - x**2*z**3 - 9/80*y**2*z**3",
            lower=(-1.3, -0.8, -1.2), upper=(1.3, 0.8, 1.3),
            transform=lift(0, 0.6, 0) @ size(0.58) @ turn((1, 0, 0), -90),
        ),
        "PointCloud": sr.PointCloud(points=cloud * (0.6, 0.7, 0.6) + (0, 0.7, 0), surface="splats", radius=0.06),
    }  # fmt: skip


def build() -> sr.Scene:
    floor = sr.Phong(diffuse=0.62, ambient=0.62, specular=0, mirror=0.08)
    things: list[Any] = [sr.Plane(point=(0, 0, 0), normal=(0, 1, 0), material=floor, name="Plane")]
    things.append(plate("Plane", (3.3, 0.16, 6.65), 0.32))
    for index, (name, shape) in enumerate(specimens().items()):
        color = COLORS[index % len(COLORS)]
        x = (index % COLUMNS - (COLUMNS - 1) / 2) * PITCH_X
        z = (index // COLUMNS) * PITCH_Z - 1.0
        material = sr.Phong(diffuse=color, ambient=color, specular=0.35, shininess=50)
        things.append(sr.Instance(of=shape, transform=sr.Transform.translate(x, 0, z), material=material, name=name))
        things.append(plate(name, (x, 0.16, z + 1.05), 0.32))
    return sr.Scene(
        *things,
        sr.RectangleLight(corner=(-6, 11, 6), edge_u=(3, 0, 0), edge_v=(0, -2, 2), radiance=14, grid=2, visible=False),
        sr.PointLight(position=(9, 8, 10), intensity=36),
        camera=sr.PerspectiveCamera(eye=(0, 10.5, 15.5), target=(0, 0.2, 2.6), vfov=34, width=800, height=600),
        background=(0.7, 0.78, 0.88), ambient=0.25, samples=4, name="primitives",
    )  # fmt: skip
