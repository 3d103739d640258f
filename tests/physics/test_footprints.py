"""What surfaces tell textures: how wide a ray is in the space of the shape, and which way round pictures lie."""

from __future__ import annotations

import numpy as np
import pytest

import sightray as sr

BUMPS = sr.NormalMap(
    material=sr.Lambert(albedo=1.0), map=(0.5, 0.75, 0.5 + 0.5 * np.sqrt(0.75))
)  # 30 degrees up along v
CORNERS = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
UVS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)


def brightness(shape, **lamp):
    """Of a wall that faces the viewer."""
    camera = sr.PerspectiveCamera(eye=(0, 0, 5), target=(0, 0, 0), vfov=10, width=4, height=4)
    scene = sr.Scene(shape, sr.DirectionalLight(**lamp), camera=camera, ambient=0.0)
    return float(np.asarray(sr.render(scene, sr.DirectLighting(), samples=1)).mean())


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("turned", [False, True])
def test_relief_rises_along_v_however_the_picture_lies(mirrored, turned):
    """Light from above meets slopes that face up, also where u runs backwards and where an instance is a mirror image."""
    uvs = UVS * (-1, 1) if mirrored else UVS
    wall = sr.Mesh(vertices=CORNERS, faces=[[0, 1, 2], [0, 2, 3]], uvs=uvs, material=BUMPS)
    if turned:
        wall = sr.Instance(of=wall, transform=sr.Transform.scale(-1, 1, 1))
    above = brightness(wall, direction=(0, -np.sin(np.pi / 6), -np.cos(np.pi / 6)), irradiance=np.pi)
    assert abs(above - 1.0) < 1e-6  # the light is along the bent normal
    across = brightness(wall, direction=(np.sin(np.pi / 6), 0, -np.cos(np.pi / 6)), irradiance=np.pi)
    assert abs(across - 0.75) < 1e-6


def floor_to_the_horizon(albedo, samples, scale=1.0):
    material = sr.Phong(diffuse=0, specular=0, ambient=albedo)
    corner, u, v = np.array([[-100, 0, 30], [200, 0, 0], [0, 0, -200]]) / scale
    floor = sr.Rectangle(corner=corner, edge_u=u, edge_v=v, material=material)
    floor = sr.Instance(of=floor, transform=sr.Transform.scale(scale))
    camera = sr.PerspectiveCamera(eye=(0.3, 2, 20), target=(0.1, 0, 0), width=100, height=60)
    return np.asarray(sr.render(sr.Scene(floor, camera=camera, ambient=1.0), sr.Whitted(), samples=samples))[24:, :, 0]


@pytest.mark.parametrize("scale", [1.0, 10.0])
def test_solid_textures_far_away_are_their_mean(scale):
    """The footprint is measured in the space of the shape, so a scaled floor looks the same."""
    board = sr.Checker(even=0, odd=1, scale=scale, mode="solid")
    tiles = sr.Bitmap(image=np.array([[0.0, 1.0], [1.0, 0.0]], np.float32), filter="nearest", scale=100)  # as wide
    converged = floor_to_the_horizon(tiles, 1024, scale)
    error = np.sqrt(np.mean((floor_to_the_horizon(board, 1, scale) - converged) ** 2))
    assert error < 0.4 * np.sqrt(np.mean((floor_to_the_horizon(tiles, 1, scale) - converged) ** 2))
    noise = floor_to_the_horizon(sr.Noise(scale=3 * scale, octaves=1), 1, scale)
    assert noise[:3].std() < 1e-3 < 0.05 < noise[-5:].std()


def test_footprints_shrink_as_samples_grow():
    """The samples of a pixel share its width among them, so a filtered board converges to the same picture."""
    board = sr.Checker(even=0, odd=1, scale=1.0, mode="solid")
    tiles = sr.Bitmap(image=np.array([[0.0, 1.0], [1.0, 0.0]], np.float32), filter="nearest", scale=100)
    converged = floor_to_the_horizon(tiles, 1024)
    filtered = np.sqrt(np.mean((floor_to_the_horizon(board, 64) - converged) ** 2))
    assert filtered < 0.6 * np.sqrt(np.mean((floor_to_the_horizon(tiles, 64) - converged) ** 2))
