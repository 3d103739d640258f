"""A small, finely tessellated teapot in a huge stadium: where uniform grids fail."""

from __future__ import annotations

import math

import numpy as np

import sightray as sr
from sightray.scenes.teapot import teapot_mesh

SEGMENTS = 30  # of each of the 32 patches: 57 000 triangles
ROWS, SEATS = 10, 72  # of the stands
LENGTH, WIDTH, RISE, TREAD = 105.0, 68.0, 2.0, 3.5  # metres, of a football field; and of a row


def stands() -> sr.Mesh:
    """Rows of steps around the field, along a rounded rectangle."""
    angle = np.linspace(0, 2 * np.pi, SEATS, endpoint=False)
    power = 0.5  # of a superellipse
    outline = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    outline = np.sign(outline) * np.abs(outline) ** power
    rings = []
    for row in range(ROWS + 1):
        across = (np.array([LENGTH, WIDTH]) / 2 + 8.0 + TREAD * row) * outline
        for height in (RISE * row, RISE * (row + 1)):
            rings.append(np.stack([across[:, 0], np.full(SEATS, height), across[:, 1]], axis=1))
    n = len(rings)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n - 1), np.arange(SEATS), indexing="ij"))
    a, b = i * SEATS + j, i * SEATS + (j + 1) % SEATS
    faces = np.concatenate([np.stack([a, a + SEATS, b], axis=1), np.stack([b, a + SEATS, b + SEATS], axis=1)])
    return sr.Mesh(vertices=np.concatenate(rings), faces=faces, material=sr.Phong(
        diffuse=(0.42, 0.44, 0.5), ambient=(0.42, 0.44, 0.5), specular=0), name="stands")  # fmt: skip


def build() -> sr.Scene:
    glaze = sr.Phong(diffuse=(0.75, 0.28, 0.12), specular=0.35, shininess=60, ambient=(0.75, 0.28, 0.12))
    grass = sr.Phong(
        diffuse=sr.Checker(even=(0.16, 0.42, 0.14), odd=(0.2, 0.5, 0.17), scale=5.5, mode="solid"),
        ambient=(0.18, 0.46, 0.16), specular=0,
    )  # fmt: skip
    far = 0.5 * math.hypot(LENGTH, WIDTH)
    return sr.Scene(
        teapot_mesh(SEGMENTS, material=glaze, transform=sr.Transform.scale(0.08), name="teapot"),
        stands(),
        sr.Rectangle(corner=(-far, -0.001, -far), edge_u=(0, 0, 2 * far), edge_v=(2 * far, 0, 0), material=grass),
        sr.DirectionalLight(direction=(-0.5, -0.8, -0.4), irradiance=1.5),
        camera=sr.PerspectiveCamera(eye=(0.42, 0.3, 0.86), target=(0.02, 0.24, 0), vfov=48, width=640, height=480),
        background=(0.55, 0.7, 0.9), ambient=0.25, samples=9, name="teapot in a stadium",
    )  # fmt: skip
