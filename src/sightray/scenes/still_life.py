"""Glass and mirror balls on a table under one lamp: caustics, which few paths find."""

from __future__ import annotations

import numpy as np

import sightray as sr

RADIUS = 0.5


def table_top() -> sr.Mesh:
    """A square board with its back wall, as one mesh."""
    corners = [(-4, 0, 3), (4, 0, 3), (4, 0, -2.5), (-4, 0, -2.5), (4, 4, -2.5), (-4, 4, -2.5)]
    faces = [(0, 1, 2), (0, 2, 3), (3, 2, 4), (3, 4, 5)]
    return sr.Mesh(vertices=np.array(corners, float), faces=faces, material=sr.Lambert(albedo=(0.7, 0.66, 0.6)))


def build() -> sr.Scene:
    glass, mirror = sr.Glass(ior=1.5), sr.Mirror(reflectance=0.9)
    matte = sr.Lambert(albedo=(0.2, 0.35, 0.6))
    balls = [(-1.2, 0.3, glass), (-0.1, -0.6, mirror), (1.0, 0.5, glass), (1.7, -1.2, matte), (-2.2, -1.3, mirror)]
    return sr.Scene(
        table_top(),
        *[sr.Sphere(center=(x, RADIUS, z), radius=RADIUS, material=m) for x, z, m in balls],
        sr.RectangleLight(corner=(-1.0, 4.3, 0.8), edge_u=(2, 0, 0), edge_v=(0, -0.5, 1.2), radiance=12, grid=2),
        camera=sr.PerspectiveCamera(eye=(0, 2.4, 5.5), target=(0, 0.5, -0.3), vfov=36, width=512, height=384),
        samples=64, integrator=sr.PathTracer(max_depth=12), name="still-life",
    )  # fmt: skip
