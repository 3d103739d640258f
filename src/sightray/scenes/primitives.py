"""Every shape there is, each on its own plinth with its name."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import sightray as sr
from sightray.registry import members
from sightray.scenes._lettering import lettering
from sightray.scenes.teapot import teapot_mesh

COLUMNS = 5
PITCH = 2.6


def specimens() -> dict[str, Any]:
    """One example of each shape, about one metre in size, standing on y = 0: class name -> shape."""
    star = [(math.sin(k * math.pi / 5) * r, 0.75 + math.cos(k * math.pi / 5) * r, 0.0)
            for k, r in enumerate([0.75, 0.32] * 5)]  # fmt: skip
    hole = [(0.17 * math.cos(a), 0.75 + 0.17 * math.sin(a), 0.0) for a in np.linspace(0, 2 * math.pi, 24)[:-1]]
    up = sr.Transform.translate
    return {
        "Sphere": sr.Sphere(center=(0, 0.7, 0), radius=0.7),
        "Plane": sr.Plane(point=(0, 0, 0), normal=(0, 1, 0)),
        "Disk": sr.Disk(center=(0, 0.7, 0), normal=(0, 0.35, 1), radius=0.7, inner_radius=0.25),
        "Rectangle": sr.Rectangle(corner=(-0.6, 0.1, 0.25), edge_u=(1.2, 0, 0), edge_v=(0, 1.1, -0.5)),
        "Box": sr.Box(lower=(-0.55, 0, -0.55), upper=(0.55, 1.1, 0.55), transform=sr.Transform.rotate((0, 1, 0), 30)),
        "Triangle": sr.Triangle(a=(-0.75, 0.05, 0.2), b=(0.75, 0.05, 0.2), c=(0, 1.35, -0.2)),
        "Mesh": sr.Instance(of=teapot_mesh(8), transform=sr.Transform.scale(0.3)),
        "Polygon": sr.Polygon(outline=star, holes=[hole]),
        "Cylinder": sr.Cylinder(base=(0, 0, 0), top=(0, 1.3, 0), radius=0.5),
        "Cone": sr.Cone(base=(0, 0, 0), top=(0, 1.3, 0), base_radius=0.65, top_radius=0.2),
        "Quadric": sr.Quadric.hyperboloid_of_one_sheet(radii=(0.3, 0.3, 0.45), height=0.7),
        "Torus": sr.Torus(center=(0, 0.7, 0), axis=(0, 0.5, 1), major_radius=0.5, minor_radius=0.2),
        "Implicit": sr.Implicit(
            expression="(x**2 + 9/4*y**2 + z**2 - 1)**3 - x**2*z**3 - 9/80*y**2*z**3",
            lower=(-1.3, -1.3, -1.3), upper=(1.3, 1.3, 1.3),
            transform=up(0, 0.62, 0) @ sr.Transform.scale(0.6) @ sr.Transform.rotate((1, 0, 0), -90),
        ),
    }  # fmt: skip
