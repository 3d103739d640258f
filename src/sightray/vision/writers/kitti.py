"""KITTI: odometry, optical flow and disparity."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar

import numpy as np

from sightray.vision.intrinsics import lens_of
from sightray.vision.png16 import png16
from sightray.vision.shot import Shot
from sightray.vision.writers.base import Note, Output, Writer, sequences

FLOW_STEPS, FLOW_ZERO, DISPARITY_STEPS, MOST = 64.0, 2.0**15, 256.0, 2.0**16 - 1
LASER = np.array([[0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [1.0, 0.0, 0.0, 0.0]])  # x forward, y left, z up
FIRST = 2  # KITTI's cameras 0 and 1 are grey, the left one in colour is 2


class KittiWriter(Writer):
    """KITTI: ``poses/SS.txt`` and ``sequences/SS/`` with pictures, calib.txt, times.txt, flow and disparity.

    - ``image_2``, ``image_3`` ...: the cameras of a rig in order, the left one first.
    - ``poses/SS.txt``: a line of 12 numbers per picture, the upper 3 x 4 of the first camera's pose in the frame of its
      first picture, metres; axes are OpenCV's: +x right, +y down, +z forward.
    - ``calib.txt``: P0 ... P3, 3 x 4 projections from the first camera's frame. The centre of the top-left pixel is (0, 0)
      there: 0.5 is subtracted from cx and cy. P0 and P1 repeat P2 and P3. ``Tr`` is the pose in that frame of a laser at the
      first camera, x forward, y left, z up: there is none, but readers want to know.
    - ``flow_occ``, ``flow_noc``: 16-bit PNG to the next picture, u 64 + 2¹⁵, v 64 + 2¹⁵, valid; pixels to the right and
      down. Valid is 0 where |u| or |v| is beyond 512 pixels, and what is hidden or beyond the border in ``noc``.
    - ``disp_occ_0``: 16-bit PNG, 256 d; 0 where there is none or d is not above 0, as at infinity. Of the left camera.

    The folders of flow and disparity, which KITTI keeps in another benchmark, stand beside the pictures; `kitti2015` has
    that benchmark's own layout.
    """

    label: ClassVar[str] = "kitti"
    layers: ClassVar[tuple[str, ...]] = ()
    next_layers: ClassVar[tuple[str, ...]] = ("flow", "occlusion", "out_of_view")
    stereo_layers: ClassVar[tuple[str, ...]] = ("disparity",)
    bytes_per_pixel: ClassVar[float] = 9.0

    def accept(self, shot: Shot) -> None:
        lens_of(shot.labels.camera, self.label)

    def write(self, out: Output, shot: Shot) -> Note:
        labels, folder, name = shot.labels, f"sequences/{shot.sequence:02}", f"{shot.step:06}.png"
        out.binary(f"{folder}/image_{FIRST + shot.camera}/{name}", shot.png)
        if shot.camera == 0 and "flow" in labels:
            seen = ~(labels.occlusion | labels.out_of_view)
            out.binary(f"{folder}/flow_occ/{name}", png16(flow_codes(labels.flow)))
            out.binary(f"{folder}/flow_noc/{name}", png16(flow_codes(labels.flow, seen)))
        if shot.camera == 0 and "disparity" in labels:
            out.binary(f"{folder}/disp_occ_0/{name}", png16(disparity_codes(labels.disparity)))
        return {**shot.facts(), "K": lens_of(labels.camera, self.label).matrix(-0.5).tolist()}

    def finish(self, out: Output, notes: Iterable[Note]) -> None:
        for sequence, found in sequences(notes):
            lead = [note for note in found if note["camera"] == 0]
            poses = np.array([note["world_from_camera"] for note in lead])
            relative = np.linalg.inv(poses[0]) @ poses
            relative[0] = np.eye(4)
            out.text(f"poses/{sequence:02}.txt", "".join(_line(pose[:3]) for pose in relative))
            folder = f"sequences/{sequence:02}"
            out.text(f"{folder}/times.txt", "".join(f"{note['time']:e}\n" for note in lead))
            out.text(f"{folder}/calib.txt", _calibration([note for note in found if note["step"] == lead[0]["step"]]))


def flow_codes(flow: np.ndarray, valid: np.ndarray | None = None) -> np.ndarray:
    """(h, w, 3) uint16 of a flow in pixels, (h, w, 2)."""
    codes = np.rint(np.where(np.isfinite(flow), flow, np.inf) * FLOW_STEPS + FLOW_ZERO)
    good = ((codes >= 0) & (codes <= MOST)).all(axis=-1)
    if valid is not None:
        good &= valid
    result = np.zeros((*flow.shape[:2], 3), np.uint16)
    result[good, :2] = codes[good]
    result[..., 2] = good
    return result


def disparity_codes(disparity: np.ndarray) -> np.ndarray:
    """(h, w) uint16 of a disparity in pixels; small ones become 1, not 0, which says that there is none."""
    good = (disparity > 0) & (disparity * DISPARITY_STEPS <= MOST)
    codes = np.maximum(np.rint(np.where(good, disparity, 0) * DISPARITY_STEPS), 1)
    return np.where(good, codes, 0).astype(np.uint16)


def _calibration(notes: list[Note]) -> str:
    """P0 ... of the cameras of one moment."""
    first = np.array(notes[0]["world_from_camera"])
    matrices = [np.array(n["K"]) @ (np.linalg.inv(n["world_from_camera"]) @ first)[:3] for n in notes]
    lines = [f"P{k}: {_line(matrix)}" for k, matrix in enumerate(matrices[:FIRST])]
    lines += [f"P{FIRST + k}: {_line(matrix)}" for k, matrix in enumerate(matrices)]
    return "".join([*lines, f"Tr: {_line(LASER)}"])


def _line(matrix: np.ndarray) -> str:
    return " ".join(map(repr, matrix.ravel().tolist())) + "\n"
