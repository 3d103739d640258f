"""COLMAP's sparse model."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from typing import Any, ClassVar

import numpy as np

from sightray.fields import integer
from sightray.vision.intrinsics import BROWN_CONRADY, KANNALA_BRANDT, PINHOLE, Lens, lens_of
from sightray.vision.rotations import quaternion
from sightray.vision.shot import Shot
from sightray.vision.writers.base import Note, Output, Writer

MODEL_IDS = {"PINHOLE": 1, "OPENCV": 4, "OPENCV_FISHEYE": 5, "FULL_OPENCV": 6}
LENSES = (PINHOLE, BROWN_CONRADY, KANNALA_BRANDT)


class ColmapWriter(Writer):
    """COLMAP: ``sparse/0/{cameras,images,points3D}`` as .txt and .bin, and the pictures in ``images/``.

    Poses are world to camera, a quaternion w x y z and a translation in metres, in OpenCV's axes: +x right, +y down,
    +z forward. Intrinsics and points in pictures have the centre of the top-left pixel at (0.5, 0.5), as COLMAP has it:
    nothing is shifted. Models: PINHOLE, OPENCV, FULL_OPENCV (where k3 ... k6 are not zero), OPENCV_FISHEYE. Binary files
    are little-endian. The points are true ones: on the surfaces that are seen, at the centres of `points` pixels of each
    picture that lie evenly over it, each with a track of that one picture, an error of 0, and the picture's colour.
    """

    label: ClassVar[str] = "colmap"
    layers: ClassVar[tuple[str, ...]] = ("position",)
    bytes_per_pixel: ClassVar[float] = 3.0
    points: int = integer("points of each picture", default=400, at_least=0, at_most=1_000_000)

    def accept(self, shot: Shot) -> None:
        lens_of(shot.labels.camera, self.label, LENSES)

    def write(self, out: Output, shot: Shot) -> Note:
        name = f"{shot.id:06}.png"
        out.binary(f"images/{name}", shot.png)
        camera_from_world = shot.labels.camera_from_world
        lens = lens_of(shot.labels.camera, self.label, LENSES)
        model, parameters = _model(lens)
        row, column = _spread(shot.labels.height, shot.labels.width, self.points)
        seen = np.isfinite(shot.labels.position[row, column]).all(axis=-1)
        row, column = row[seen], column[seen]
        colors = np.zeros((len(row), 3), int) if shot.image is None else shot.image.to_bytes()[row, column, :3]
        return {
            "name": name, "lens": [model, shot.labels.width, shot.labels.height, parameters],
            "pose": [*quaternion(camera_from_world[:3, :3]).tolist(), *camera_from_world[:3, 3].tolist()],
            "xy": np.stack([column + 0.5, row + 0.5], axis=-1).tolist(),
            "xyz": shot.labels.position[row, column].tolist(), "rgb": colors.tolist(),
        }  # fmt: skip

    def finish(self, out: Output, notes: Iterable[Note]) -> None:
        for suffix, form in (("txt", _Text()), ("bin", _Binary())):
            for part in ("cameras", "images", "points3D"):
                data = b"".join(getattr(form, part)(list(getattr(_Model(notes), part)())))
                out.binary(f"sparse/0/{part}.{suffix}", data)


def _model(lens: Lens) -> tuple[str, list[float]]:
    """Name and numbers of a camera model."""
    own = [lens.fx, lens.fy, lens.cx, lens.cy]
    if lens.model == PINHOLE:
        return "PINHOLE", own
    if lens.model == KANNALA_BRANDT:
        return "OPENCV_FISHEYE", own + lens.several("k1", "k2", "k3", "k4")
    if any(lens.several("k3", "k4", "k5", "k6")):
        return "FULL_OPENCV", own + lens.several("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
    return "OPENCV", own + lens.several("k1", "k2", "p1", "p2")


def _spread(height: int, width: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of `count` pixels that lie evenly over a picture (the R2 sequence of M. Roberts, 2018)."""
    step = 1.0 / 1.32471795724474602596 ** np.array([1.0, 2.0])
    xy = (0.5 + np.arange(count)[:, None] * step) % 1.0
    cells = np.unique((xy[:, 1] * height).astype(int) * width + (xy[:, 0] * width).astype(int))
    return cells // width, cells % width


class _Model:
    """Cameras, pictures and points, numbered from 1."""

    def __init__(self, notes: Iterable[Note]):
        self.notes = notes

    def cameras(self) -> Iterator[Any]:
        """Number, model, width, height and parameters of each different camera."""
        for number, key in enumerate(self._numbers(), 1):
            yield number, *key

    def _numbers(self) -> dict[Any, int]:
        keys = dict.fromkeys(_key(note) for note in self.notes)
        return {key: number for number, key in enumerate(keys, 1)}

    def images(self) -> Iterator[Any]:
        """Number, pose, camera, name, and x, y and point's number of each of its points."""
        numbers, first = self._numbers(), 1
        for number, note in enumerate(self.notes, 1):
            points = [(x, y, first + k) for k, (x, y) in enumerate(note["xy"])]
            yield number, note["pose"], numbers[_key(note)], note["name"], points
            first += len(points)

    def points3D(self) -> Iterator[Any]:
        """Number, place, colour, and the picture and the place in its list where the point is seen."""
        number = 1
        for image, note in enumerate(self.notes, 1):
            for k, (xyz, rgb) in enumerate(zip(note["xyz"], note["rgb"], strict=True)):
                yield number, xyz, rgb, image, k
                number += 1


def _key(note: Note) -> Any:
    model, width, height, parameters = note["lens"]
    return model, width, height, tuple(parameters)


class _Text:
    """Lines of the .txt files; pictures have two each."""

    def cameras(self, rows: list[Any]) -> Iterator[bytes]:
        yield f"# Camera list: CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n# Number of cameras: {len(rows)}\n".encode()
        for number, model, width, height, parameters in rows:
            yield f"{number} {model} {width} {height} {_words(parameters)}\n".encode()

    def images(self, rows: list[Any]) -> Iterator[bytes]:
        yield b"# Image list: IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME; then X, Y, POINT3D_ID for each point\n"
        for number, pose, camera, name, points in rows:
            yield f"{number} {_words(pose)} {camera} {name}\n".encode()
            yield (" ".join(f"{x!r} {y!r} {point}" for x, y, point in points) + "\n").encode()

    def points3D(self, rows: list[Any]) -> Iterator[bytes]:
        yield b"# Point list: POINT3D_ID, X, Y, Z, R, G, B, ERROR, then IMAGE_ID, POINT2D_IDX for each view\n"
        for number, xyz, rgb, image, place in rows:
            yield f"{number} {_words(xyz)} {_words(rgb)} 0.0 {image} {place}\n".encode()


def _words(values: Iterable[Any]) -> str:
    return " ".join(map(repr, values))


class _Binary:
    """Parts of the .bin files: counts first, everything little-endian."""

    def cameras(self, rows: list[Any]) -> Iterator[bytes]:
        yield struct.pack("<Q", len(rows))
        for number, model, width, height, parameters in rows:
            yield struct.pack(f"<iiQQ{len(parameters)}d", number, MODEL_IDS[model], width, height, *parameters)

    def images(self, rows: list[Any]) -> Iterator[bytes]:
        yield struct.pack("<Q", len(rows))
        for number, pose, camera, name, points in rows:
            yield struct.pack("<i7di", number, *pose, camera) + name.encode() + b"\0" + struct.pack("<Q", len(points))
            yield b"".join(struct.pack("<ddq", *point) for point in points)

    def points3D(self, rows: list[Any]) -> Iterator[bytes]:
        yield struct.pack("<Q", len(rows))
        for number, xyz, rgb, image, place in rows:
            yield struct.pack("<Q3d3BdQii", number, *xyz, *rgb, 0.0, 1, image, place)
