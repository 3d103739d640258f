"""The Utah teapot: 32 Bézier patches, tessellated, on a checkered table."""

from __future__ import annotations

import numpy as np

import sightray as sr
from sightray.mathlib.bezier import Grid, merge, tessellate
from sightray.scenes._teapot_patches import MIRRORED, TURNED


def patches() -> list[np.ndarray]:
    """The 32 control grids, each (4, 4, 3): z up, spout towards +x."""
    found = []
    for turned in TURNED.values():
        control = np.array(turned)
        for _ in range(4):
            found.append(control)
            control = np.stack([-control[..., 1], control[..., 0], control[..., 2]], axis=-1)
    for mirrored in MIRRORED.values():
        control = np.array(mirrored)
        # Turning the grid about keeps the normals of the mirror image outside.
        found += [control, (control * (1, -1, 1))[:, ::-1]]
    return found


def teapot_grid(segments: int = 16) -> Grid:
    """The whole pot as triangles: ``64 segments²`` of them, less those that collapse."""
    return merge([tessellate(control, segments) for control in patches()])


def teapot_mesh(segments: int = 16, **options: object) -> sr.Mesh:
    """The pot as a `Mesh`, y up, standing on y = 0."""
    grid = teapot_grid(segments)
    turn = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], np.float64)  # (x, y, z) -> (x, z, -y)
    vertices, normals = grid.vertices @ turn.T, grid.normals @ turn.T
    return sr.Mesh(vertices=vertices, faces=grid.faces, normals=normals, uvs=grid.uvs, **options)


def build() -> sr.Scene:
    glaze = sr.Phong(diffuse=(0.75, 0.28, 0.12), specular=0.35, shininess=60, ambient=(0.75, 0.28, 0.12), mirror=0.08)
    table = sr.Phong(
        diffuse=sr.Checker(even=(0.85, 0.82, 0.75), odd=(0.25, 0.3, 0.36), scale=1.0, mode="solid"),
        ambient=0.5, mirror=0.12, specular=0,
    )  # fmt: skip
    return sr.Scene(
        teapot_mesh(material=glaze, name="teapot"),
        sr.Plane(point=(0, 0, 0), normal=(0, 1, 0), material=table, name="table"),
        sr.RectangleLight(corner=(-5, 9, 4), edge_u=(3, 0, 0), edge_v=(0, -2, 2), radiance=10, grid=3, visible=False),
        sr.PointLight(position=(7, 5, 6), intensity=20),
        camera=sr.PerspectiveCamera(eye=(2.6, 5.2, 8.6), target=(0.1, 1.2, 0), vfov=36, width=640, height=480),
        background=(0.62, 0.72, 0.85), ambient=0.18, samples=9, name="teapot",
    )  # fmt: skip
