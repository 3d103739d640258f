"""The pictures of docs/measuring.md: ``python examples/measuring.py [FOLDER]``, by default docs/images.

``shadow_mask.png``: a scanned torus, as a mesh and as a cloud of points, its shadow areas under a rectangular light.
``back_project.png``: the corners of a grid in a distorted picture, and the points that they are on the surface.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

import sightray as sr

LAMP = sr.RectangleLight(corner=(1.2, 4, 0.6), edge_u=(0.9, 0, 0), edge_v=(0, 0, 0.9), visible=False)
FLOOR = sr.Plane(point=(0, 0, 0), normal=(0, 1, 0))
LIT, BACKGROUND = (236, 226, 196), (33, 33, 41)
ATTACHED, CAST = (196, 92, 60), (38, 66, 128)


def torus_points(n: int, m: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (n m, 3) on a leaning torus, metres, and its normals there."""
    a, b = np.meshgrid(np.arange(n) * 2 * np.pi / n, np.arange(m) * 2 * np.pi / m, indexing="ij")
    normals = np.stack([np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b)], axis=-1).reshape(-1, 3)
    middle = 0.8 * np.stack([np.cos(a), np.sin(a), 0 * a], axis=-1).reshape(-1, 3)
    turn = sr.Transform.rotate((1, 0.4, 0), 35).matrix[:3, :3]
    return (middle + 0.28 * normals) @ turn.T + (0, 1.15, 0), normals @ turn.T


def torus_mesh(n: int = 160, m: int = 48) -> sr.Mesh:
    """The torus as triangles."""
    points, _ = torus_points(n, m)
    at = np.arange(n * m).reshape(n, m)
    a, b, c, d = at, np.roll(at, -1, 0), np.roll(np.roll(at, -1, 0), -1, 1), np.roll(at, -1, 1)
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return sr.Mesh(vertices=points, faces=faces)


def torus_cloud(n: int = 160, m: int = 48) -> sr.PointCloud:
    """The torus as measured points."""
    points, normals = torus_points(n, m)
    return sr.PointCloud(points=points, normals=normals)


def colored(mask) -> np.ndarray:
    """A `ShadowMask` in colours, (h, w, 3) uint8: between lit and cast by the fraction that is seen."""
    seen = np.nan_to_num(mask.visible_fraction)[..., None]
    pixels = seen * LIT + (1 - seen) * np.where(mask.attached[..., None], ATTACHED, CAST)
    return np.where(mask.background[..., None], BACKGROUND, pixels).astype(np.uint8)


def shadows() -> Image.Image:
    """The mesh's mask and the cloud's, side by side."""
    camera = sr.PerspectiveCamera(eye=(-1.2, 3.6, 5.2), target=(-0.3, 0.5, -0.2), vfov=42, width=380, height=320)
    masks = [sr.vision.shadow_mask([FLOOR, thing], camera, LAMP) for thing in (torus_mesh(), torus_cloud())]
    return Image.fromarray(np.concatenate([colored(mask) for mask in masks], axis=1))


def reconstruction() -> Image.Image:
    """Left a picture with strong distortion and the pixels that are asked; right their points, seen from aside."""
    pose = sr.PerspectiveCamera(eye=(0, 3.0, 3.2), target=(0, 0.9, 0)).world_from_camera()
    camera = sr.CalibratedCamera(width=380, height=320, fx=330, k1=-0.3, k2=0.08, pose=pose)
    aside = sr.PerspectiveCamera(eye=(-4.6, 2.6, 2.6), target=(0, 0.75, 0), vfov=36, width=380, height=320)
    mesh, half = torus_mesh(), []
    pixels = np.stack(np.meshgrid(np.arange(8.25, 380, 14), np.arange(8.25, 320, 14)), axis=-1).reshape(-1, 2)
    found = sr.vision.back_project(pixels, camera, [mesh, FLOOR])
    for view, places in ((camera, pixels), (aside, aside.project(found.points))):
        scene = sr.Scene(mesh, FLOOR, sr.PointLight(position=(1, 5, 3), intensity=60), camera=view)
        picture = Image.fromarray(sr.render(scene, samples=4).to_bytes())
        draw = ImageDraw.Draw(picture)
        for (x, y), shape in zip(places, found.shape, strict=True):
            if shape == 0 and np.isfinite(x):
                draw.ellipse((x - 2.5, y - 2.5, x + 1.5, y + 1.5), fill=(230, 60, 40))
        half.append(np.asarray(picture))
    return Image.fromarray(np.concatenate(half, axis=1))


def main(folder: str = "") -> None:
    target = Path(folder) if folder else Path(__file__).parent.parent / "docs" / "images"
    target.mkdir(parents=True, exist_ok=True)
    shadows().save(target / "shadow_mask.png")
    reconstruction().save(target / "back_project.png")


if __name__ == "__main__":
    main(*sys.argv[1:2])
