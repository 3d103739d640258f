"""transforms.json, as NeRF programs read it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, ClassVar

import numpy as np

from sightray.vision.intrinsics import BROWN_CONRADY, KANNALA_BRANDT, PINHOLE, lens_of
from sightray.vision.shot import Shot
from sightray.vision.writers.base import Note, Output, Writer

OPENGL_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])  # and back
MODELS = {PINHOLE: "PINHOLE", BROWN_CONRADY: "OPENCV", KANNALA_BRANDT: "OPENCV_FISHEYE"}


class TransformsWriter(Writer):
    """Poses and intrinsics for NeRF programs: ``transforms.json``, and the pictures in ``images/``.

    ``transform_matrix`` is camera to world, 4 x 4 row-major, in metres; the camera's axes are OpenGL's: +x right, +y up,
    and it looks along -z, so the columns of y and z are turned round. The world stays as it is (right-handed, +y up
    unless the scene says otherwise). Each frame has ``fl_x fl_y cx cy w h`` in pixels with the centre of the top-left
    pixel at (0.5, 0.5), as nerfstudio has it: nothing is shifted. ``camera_model`` is PINHOLE, OPENCV (k1 k2 k3 p1 p2) or
    OPENCV_FISHEYE (k1 k2 k3 k4); the rational k4 k5 k6 of OpenCV cannot be stated.
    """

    label: ClassVar[str] = "transforms"
    bytes_per_pixel: ClassVar[float] = 3.0

    def accept(self, shot: Shot) -> None:
        self._lens(shot)

    def _lens(self, shot: Shot) -> Any:
        models = (PINHOLE, BROWN_CONRADY, KANNALA_BRANDT)
        brown = getattr(shot.labels.camera, "model", "") == BROWN_CONRADY
        return lens_of(shot.labels.camera, self.label, models, ("k4", "k5", "k6") if brown else ())

    def write(self, out: Output, shot: Shot) -> Note:
        lens, name = self._lens(shot), f"images/{shot.id:06}.png"
        out.binary(name, shot.png)
        pose = shot.labels.world_from_camera @ OPENGL_FROM_OPENCV
        return {
            "file_path": name, "transform_matrix": pose.tolist(), "camera_model": MODELS[lens.model],
            "fl_x": lens.fx, "fl_y": lens.fy, "cx": lens.cx, "cy": lens.cy, "w": shot.labels.width,
            "h": shot.labels.height, **lens.coefficients, "time": shot.time,
        }  # fmt: skip

    def finish(self, out: Output, notes: Iterable[Note]) -> None:
        frames = list(notes)
        shared = {key: frames[0][key] for key in ("camera_model",)} if frames else {}
        out.json("transforms.json", {**shared, "frames": frames})
