"""KITTI 2015: stereo, optical flow and scene flow."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar

import numpy as np

from sightray.errors import SceneError
from sightray.vision.intrinsics import lens_of
from sightray.vision.layers.occlusion import hidden_from
from sightray.vision.png16 import png16
from sightray.vision.shot import Shot
from sightray.vision.writers.base import Note, Output, Writer
from sightray.vision.writers.kitti import FIRST, disparity_codes, flow_codes

FOLDER = "training"


class Kitti2015Writer(Writer):
    """KITTI 2015's benchmark of stereo, flow and scene flow: ``training/`` with pairs of pictures and what is true of them.

    Each picture NNNNNN, counted over all sequences, is the first of a pair, ``_10``, and the next one of its sequence
    the second, ``_11``; of a sequence's last picture, and of pictures apart, there is no flow and no ``_11``.

    - ``image_2``, ``image_3``: the left and the right camera, or the only one.
    - ``flow_occ``, ``flow_noc``: 16-bit PNG, u 64 + 2¹⁵, v 64 + 2¹⁵, valid; pixels to the right and down, of the left
      camera. Valid is 0 beyond 512 pixels, and in ``noc`` where the point is hidden or beyond the border in the second
      picture.
    - ``disp_occ_0``, ``disp_noc_0``: 16-bit PNG, 256 d, of the left camera; 0 where there is none, as at infinity, and in
      ``noc`` where the point is hidden from the right camera, or beyond its border.
    - ``disp_occ_1``: the disparity that the point of the first left picture has at the time of the second pair.
    - ``calib_cam_to_cam/NNNNNN.txt``: S_rect (size), R_rect (the identity) and P_rect, 3 x 4, of the cameras 00 ... 03, of
      which 00 and 01 repeat 02 and 03. The centre of the top-left pixel is (0, 0) there: 0.5 is subtracted from cx and cy.
    """

    label: ClassVar[str] = "kitti2015"
    layers: ClassVar[tuple[str, ...]] = ("position",)
    next_layers: ClassVar[tuple[str, ...]] = ("flow", "occlusion", "out_of_view", "next_position")
    stereo_layers: ClassVar[tuple[str, ...]] = ("disparity",)
    bytes_per_pixel: ClassVar[float] = 12.0

    def accept(self, shot: Shot) -> None:
        lens_of(shot.labels.camera, self.label)
        if len(shot.cameras) > 2:
            raise SceneError(f"kitti2015: got {len(shot.cameras)} cameras; allowed: one, or two side by side")

    def write(self, out: Output, shot: Shot) -> Note:
        labels, name = shot.labels, f"{shot.frame:06}"
        pictures = f"{FOLDER}/image_{FIRST + shot.camera}"
        out.binary(f"{pictures}/{name}_10.png", shot.png)
        if shot.step > 0:
            out.binary(f"{pictures}/{shot.frame - 1:06}_11.png", shot.png)
        if shot.camera == 0:
            if "flow" in labels and shot.next_time is not None:
                seen = ~(labels.occlusion | labels.out_of_view)
                out.binary(f"{FOLDER}/flow_occ/{name}_10.png", png16(flow_codes(labels.flow)))
                out.binary(f"{FOLDER}/flow_noc/{name}_10.png", png16(flow_codes(labels.flow, seen)))
            if "disparity" in labels:
                self._stereo(out, shot, name)
        return {**shot.facts(), "K": lens_of(labels.camera, self.label).matrix(-0.5).tolist()}

    def _stereo(self, out: Output, shot: Shot, name: str) -> None:
        """Disparities of the left camera."""
        labels, disparity = shot.labels, shot.labels.disparity
        out.binary(f"{FOLDER}/disp_occ_0/{name}_10.png", png16(disparity_codes(disparity)))
        seen = ~hidden_in_stereo(shot)
        out.binary(f"{FOLDER}/disp_noc_0/{name}_10.png", png16(disparity_codes(np.where(seen, disparity, 0))))
        if "next_position" in labels and shot.next_time is not None:
            forward = labels.views["next"].camera_from_world[2]
            depth = labels.next_position @ forward[:3] + forward[3]
            baseline = abs(labels.camera_from_world[0] @ labels.views["stereo"].world_from_camera[:, 3])
            with np.errstate(divide="ignore", invalid="ignore"):
                later = np.where(depth > 0, lens_of(labels.camera, self.label).fx * baseline / depth, 0)
            later[np.isnan(labels.position[..., 0])] = 0
            out.binary(f"{FOLDER}/disp_occ_1/{name}_10.png", png16(disparity_codes(later)))

    def finish(self, out: Output, notes: Iterable[Note]) -> None:
        first: Note = {}
        for note in notes:
            if note["camera"] == 0:
                first = note
            if note["camera"] == len(note["cameras"]) - 1:
                text = _calibration([first, note] if note is not first else [first])
                out.text(f"{FOLDER}/calib_cam_to_cam/{note['frame']:06}.txt", text)


def hidden_in_stereo(shot: Shot) -> np.ndarray:
    """Whether the point of a pixel is hidden from the other camera or beyond its border, (h, w) bool."""
    labels = shot.labels
    rows, columns = np.indices((labels.height, labels.width))
    pixels = np.stack([columns + 0.5 - labels.disparity, rows + 0.5], axis=-1).reshape(-1, 2)
    hidden = hidden_from(labels._frame, "stereo", labels.position.reshape(-1, 3), pixels)
    return (hidden | ~labels.views["stereo"].within(pixels)).reshape(labels.height, labels.width)


def _calibration(notes: list[Note]) -> str:
    """The cameras of one moment."""
    first = np.array(notes[0]["world_from_camera"])
    lines = []
    for number, note in enumerate([*notes, *notes] if len(notes) == 2 else [*notes] * 4):
        matrix = np.array(note["K"]) @ (np.linalg.inv(note["world_from_camera"]) @ first)[:3]
        lines += [f"S_rect_{number:02}: {note['width']:e} {note['height']:e}\n",
                  f"R_rect_{number:02}: {_numbers(np.eye(3))}\n", f"P_rect_{number:02}: {_numbers(matrix)}\n"]  # fmt: skip
    return "".join(lines)


def _numbers(matrix: np.ndarray) -> str:
    return " ".join(map(repr, matrix.ravel().tolist()))
