"""The dataset and the picture of docs/datasets.md: ``python examples/datasets.py [FOLDER]``.

Writes the meshes of examples/tabletop.yaml and a copy of it into FOLDER (by default ``tabletop``), makes a small dataset
from it there, and lays its pictures and labels out as docs/images/datasets.png.
"""

from __future__ import annotations

import json
import math
import shutil
import sys
from pathlib import Path

import numpy as np
from PIL import Image

import sightray as sr
from sightray.formats.ply_write import write_ply
from sightray.vision.marks import mark_path
from sightray.vision.pictures import palette
from sightray.vision.recipe import load_recipe

HERE = Path(__file__).parent
COLUMNS, ROWS, SCALE = 4, 3, 2  # of the sheet; each picture at half its size


def knot(n: int = 240, m: int = 24) -> sr.Mesh:
    """A tube around a trefoil knot, closed and smooth."""
    t = np.arange(n) * 2 * np.pi / n
    line = np.stack([np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)], axis=1)
    along = np.roll(line, -1, 0) - np.roll(line, 1, 0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    side = np.cross(along, (0.0, 0.0, 1.0))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    v = (np.arange(m) * 2 * np.pi / m)[None, :, None]
    normals = np.cos(v) * side[:, None] + np.sin(v) * np.cross(along, side)[:, None]
    return sr.Mesh(vertices=(line[:, None] + 0.42 * normals).reshape(-1, 3), normals=normals.reshape(-1, 3),
                   faces=grid_faces(n, m))  # fmt: skip


def grid_faces(n: int, m: int) -> np.ndarray:
    """Triangles of an n x m grid whose ends meet, counter-clockwise from outside."""
    at = np.arange(n * m).reshape(n, m)
    a, b, c, d = at, np.roll(at, -1, 0), np.roll(np.roll(at, -1, 0), -1, 1), np.roll(at, -1, 1)
    return np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])


def star(points: int = 5, thickness: float = 0.35) -> sr.Mesh:
    """A star cut from a board."""
    n = 2 * points
    angles = np.arange(n) * 2 * math.pi / n
    radii = np.where(np.arange(n) % 2 == 0, 1.0, 0.45)
    outline = np.stack([radii * np.sin(angles), np.zeros(n), radii * np.cos(angles)], axis=1)
    up = np.array([0.0, thickness, 0.0])
    vertices = np.concatenate([outline, outline + up, [[0, 0, 0]], [up]])
    k, after = np.arange(n), (np.arange(n) + 1) % n
    low, high = np.full(n, 2 * n), np.full(n, 2 * n + 1)
    faces = np.concatenate([np.stack(f, -1) for f in (
        (k, low, after), (k + n, after + n, high), (k, after, after + n), (k, after + n, k + n))])  # fmt: skip
    return sr.Mesh(vertices=vertices, faces=faces)


def write_meshes(folder: Path) -> None:
    """teapot.ply, knot.ply and star.ply."""
    teapot = next(thing for thing in sr.load("teapot").objects if isinstance(thing, sr.Mesh))
    for name, mesh in (("teapot", teapot), ("knot", knot()), ("star", star())):
        write_ply(folder / f"{name}.ply", mesh)


def tile(root: Path, recipe: sr.vision.Recipe, frame: int) -> np.ndarray:
    """A picture; on its right half what is seen of each object in a colour, and the boxes that COCO holds."""
    pixels = np.asarray(Image.open(root / f"coco/images/{frame:06}.png")).astype(float) / 255
    ids = np.asarray(Image.open(root / f"coco/panoptic/{frame:06}.png")).astype(int) @ [1, 256, 65536]
    colors, half = palette(12), pixels.shape[1] // 2
    targets = recipe.take(frame).targets or ()
    note = json.loads(mark_path(root, frame).read_text())["notes"]["coco"][0]
    marked = 0.35 * pixels
    for k, index in enumerate(targets):
        marked[ids == index + 1] = 0.4 * pixels[ids == index + 1] + 0.6 * colors[k % 12]
    for segment in note["segments"]:
        if segment["thing"]:
            x, y, w, h = (int(v) for v in segment["bbox"])
            color = colors[targets.index(segment["id"] - 1) % 12]
            for edge in (np.s_[y : y + 3, x : x + w], np.s_[y + h - 3 : y + h, x : x + w], np.s_[y : y + h, x : x + 3],
                         np.s_[y : y + h, x + w - 3 : x + w]):  # fmt: skip
                marked[edge] = color
    pixels[:, half:] = marked[:, half:]
    pixels[:, half - 1 : half + 1] = 1.0
    h, w = pixels.shape[:2]
    return pixels.reshape(h // SCALE, SCALE, w // SCALE, SCALE, 3).mean(axis=(1, 3))


def main(folder: Path) -> None:
    """Make it all."""
    folder.mkdir(parents=True, exist_ok=True)
    write_meshes(folder)
    shutil.copy(HERE / "tabletop.yaml", folder)
    root = sr.vision.make_dataset(folder / "tabletop.yaml", folder / "data", frames=COLUMNS * ROWS, samples=16,
                                  formats=["bop", "coco", "exr"], progress=print)  # fmt: skip
    recipe = load_recipe(folder / "tabletop.yaml")
    tiles = [tile(root, recipe, k) for k in range(COLUMNS * ROWS)]
    sheet = np.concatenate([np.concatenate(tiles[r * COLUMNS : (r + 1) * COLUMNS], axis=1) for r in range(ROWS)])
    picture = HERE.parent / "docs" / "images" / "datasets.png"
    picture.parent.mkdir(exist_ok=True)
    Image.fromarray(np.rint(255 * sheet).astype(np.uint8)).save(picture)
    print(picture)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "tabletop"))
