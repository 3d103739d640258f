"""TUM RGB-D."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar

import numpy as np

from sightray.vision.intrinsics import BROWN_CONRADY, PINHOLE, lens_of
from sightray.vision.png16 import png16
from sightray.vision.rotations import quaternion
from sightray.vision.shot import Shot
from sightray.vision.writers.base import Note, Output, Writer, sequences

STEPS = 5000.0  # of depth in a metre


class TumWriter(Writer):
    """TUM RGB-D: for each sequence and camera rgb/, depth/, rgb.txt, depth.txt, groundtruth.txt, calibration.txt.

    ``groundtruth.txt`` has ``timestamp tx ty tz qx qy qz qw``, camera to world in metres with the quaternion's real part
    last; the camera's axes are OpenCV's: +x right, +y down, +z forward. Depth is z in that frame, 16-bit PNG, 5000 steps to
    the metre; 0 where there is none or it is beyond 13.107 m. ``calibration.txt`` has ``fx fy cx cy k1 k2 p1 p2 k3``, with
    the centre of the top-left pixel at (0, 0): 0.5 is subtracted from cx and cy. Times are seconds.
    """

    label: ClassVar[str] = "tum"
    layers: ClassVar[tuple[str, ...]] = ("depth",)
    bytes_per_pixel: ClassVar[float] = 3.5

    def accept(self, shot: Shot) -> None:
        lens_of(shot.labels.camera, self.label, (PINHOLE, BROWN_CONRADY), ("k4", "k5", "k6"))

    def write(self, out: Output, shot: Shot) -> Note:
        lens = lens_of(shot.labels.camera, self.label, (PINHOLE, BROWN_CONRADY), ("k4", "k5", "k6"))
        folder, stamp = sequence_folder(shot.sequence, shot.camera, shot.cameras), f"{shot.time:.6f}"
        out.binary(f"{folder}/rgb/{stamp}.png", shot.png)
        out.binary(f"{folder}/depth/{stamp}.png", png16(depth_codes(shot.labels.depth, STEPS)))
        numbers = [lens.fx, lens.fy, lens.cx - 0.5, lens.cy - 0.5, *lens.several("k1", "k2", "p1", "p2", "k3")]
        return {**shot.facts(), "stamp": stamp, "calibration": numbers}

    def finish(self, out: Output, notes: Iterable[Note]) -> None:
        for sequence, all_cameras in sequences(notes):
            for camera in sorted({note["camera"] for note in all_cameras}):
                found = [note for note in all_cameras if note["camera"] == camera]
                folder = sequence_folder(sequence, camera, found[0]["cameras"])
                for kind in ("rgb", "depth"):
                    lines = [f"{note['stamp']} {kind}/{note['stamp']}.png\n" for note in found]
                    out.text(f"{folder}/{kind}.txt", f"# timestamp filename\n{''.join(lines)}")
                lines = [_pose(note) for note in found]
                out.text(f"{folder}/groundtruth.txt", f"# timestamp tx ty tz qx qy qz qw\n{''.join(lines)}")
                out.text(f"{folder}/calibration.txt", " ".join(map(repr, found[0]["calibration"])) + "\n")


def sequence_folder(sequence: int, camera: int, cameras: Iterable[str]) -> str:
    """Folder of a sequence as one camera sees it."""
    names = list(cameras)
    return f"sequence_{sequence:04}" + (f"_{names[camera]}" if len(names) > 1 else "")


def depth_codes(depth: np.ndarray, steps: float) -> np.ndarray:
    """(h, w) uint16 of a depth in metres, `steps` to the metre; 0 where it is not finite or too far."""
    codes = np.rint(np.where(np.isfinite(depth), depth, np.inf) * steps)
    return np.where((codes > 0) & (codes < 2**16), codes, 0).astype(np.uint16)


def _pose(note: Note) -> str:
    pose = np.array(note["world_from_camera"])
    w, x, y, z = quaternion(pose[:3, :3]).tolist()
    return " ".join([note["stamp"], *map(repr, [*pose[:3, 3].tolist(), x, y, z, w])]) + "\n"
