"""Middlebury: .flo and .pfm."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable
from typing import Any, ClassVar

import numpy as np

from sightray.errors import SceneError
from sightray.vision.intrinsics import lens_of
from sightray.vision.shot import Shot
from sightray.vision.writers.base import Note, Output, Writer, sequences
from sightray.vision.writers.tum import sequence_folder

UNKNOWN = 1e10  # flow that is not there: anything beyond 1e9


class MiddleburyWriter(Writer):
    """Middlebury: pictures, optical flow as ``.flo``, disparity as ``.pfm``, and ``calib.txt`` of a pair in stereo.

    ``.flo``: "PIEH" (the float 202021.25), width and height as int32, then rows of u, v from the top, float32; pixels to
    the right and down, 1e10 where there is none. ``.pfm``: "Pf", negative scale, float32 rows from the *bottom*; x in the
    left picture less x in the right one, in pixels, infinite where there is none. All little-endian. Differences of
    pixels do not depend on where centres are; ``calib.txt`` (cam0, cam1, doffs, baseline in mm, width, height, ndisp) has
    the centre of the top-left pixel at (0, 0): 0.5 is subtracted from cx and cy. Depth in mm is then
    baseline f / (d + doffs), along OpenCV's +z.
    """

    label: ClassVar[str] = "middlebury"
    next_layers: ClassVar[tuple[str, ...]] = ("flow",)
    stereo_layers: ClassVar[tuple[str, ...]] = ("disparity",)
    bytes_per_pixel: ClassVar[float] = 11.0

    def accept(self, shot: Shot) -> None:
        if "flow" not in shot.labels and "disparity" not in shot.labels:
            raise SceneError("middlebury: neither flow nor disparity; allowed: sequences, or rigs in stereo")

    def write(self, out: Output, shot: Shot) -> Note:
        labels, folder = shot.labels, sequence_folder(shot.sequence, shot.camera, shot.cameras)
        note: Note = {**shot.facts()}
        out.binary(f"{folder}/image/{shot.step:06}.png", shot.png)
        if "flow" in labels:
            out.binary(f"{folder}/flow/{shot.step:06}.flo", flo(labels.flow))
        if "disparity" in labels:
            out.binary(f"{folder}/disparity/{shot.step:06}.pfm", pfm(labels.disparity))
            note["K"] = lens_of(labels.camera, self.label).matrix(-0.5).tolist()
            finite = labels.disparity[np.isfinite(labels.disparity)]
            note["most"] = float(finite.max(initial=0.0))
        return note

    def finish(self, out: Output, notes: Iterable[Note]) -> None:
        for sequence, found in sequences(notes):
            pair = [note for note in found if note["step"] == found[0]["step"] and "K" in note]
            if len(pair) == 2:
                most = max(note["most"] for note in found)
                folder = sequence_folder(sequence, 0, pair[0]["cameras"])
                out.text(f"{folder}/calib.txt", _calibration(pair, most))


def flo(flow: np.ndarray) -> bytes:
    """A .flo file of a flow in pixels, (h, w, 2)."""
    height, width = flow.shape[:2]
    values = np.where(np.isfinite(flow).all(axis=-1, keepdims=True), flow, UNKNOWN)
    return b"PIEH" + struct.pack("<ii", width, height) + values.astype("<f4").tobytes()


def pfm(values: np.ndarray) -> bytes:
    """A PFM file of one channel, (h, w)."""
    height, width = values.shape
    finite = np.where(np.isnan(values), np.inf, values)
    return f"Pf\n{width} {height}\n-1.0\n".encode() + finite[::-1].astype("<f4").tobytes()


def _calibration(pair: list[Note], most: float) -> str:
    left, right = (np.array(note["K"]) for note in pair)
    baseline = np.linalg.inv(pair[0]["world_from_camera"]) @ np.array(pair[1]["world_from_camera"])
    lines: dict[str, Any] = {
        "cam0": _rows(left), "cam1": _rows(right), "doffs": repr(float(right[0, 2] - left[0, 2])),
        "baseline": repr(1000 * float(baseline[0, 3])), "width": pair[0]["width"], "height": pair[0]["height"],
        "ndisp": math.ceil(most) + 1,
    }  # fmt: skip
    return "".join(f"{key}={value}\n" for key, value in lines.items())


def _rows(k: np.ndarray) -> str:
    return "[" + "; ".join(" ".join(map(repr, row)) for row in k.tolist()) + "]"
