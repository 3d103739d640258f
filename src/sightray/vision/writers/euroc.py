"""EuRoC MAV (ASL)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, ClassVar

import numpy as np

from sightray.vision.intrinsics import BROWN_CONRADY, KANNALA_BRANDT, PINHOLE, lens_of
from sightray.vision.rotations import quaternion
from sightray.vision.shot import Shot
from sightray.vision.writers.base import Note, Output, Writer, sequences

COLUMNS = ("#timestamp", "p_RS_R_x [m]", "p_RS_R_y [m]", "p_RS_R_z [m]", "q_RS_w []", "q_RS_x []", "q_RS_y []",
           "q_RS_z []", "v_RS_R_x [m s^-1]", "v_RS_R_y [m s^-1]", "v_RS_R_z [m s^-1]", "b_w_RS_S_x [rad s^-1]",
           "b_w_RS_S_y [rad s^-1]", "b_w_RS_S_z [rad s^-1]", "b_a_RS_S_x [m s^-2]", "b_a_RS_S_y [m s^-2]",
           "b_a_RS_S_z [m s^-2]")  # fmt: skip
LENSES = (PINHOLE, BROWN_CONRADY, KANNALA_BRANDT)


class EurocWriter(Writer):
    """EuRoC: for each sequence ``mav0/`` with cam0 ..., each data/, data.csv and sensor.yaml, and the true states.

    ``state_groundtruth_estimate0/data.csv`` has 17 columns: nanoseconds, position of the body in the world in metres,
    quaternion body to world with w first, velocity in the world, and biases of an IMU, which are 0 as there is none.
    The body is the first camera, so its axes are OpenCV's: +x right, +y down, +z forward. Velocities are differences of
    the positions before and after. ``sensor.yaml`` has ``T_BS``, camera to body, and intrinsics fu fv cu cv with the
    centre of the top-left pixel at (0, 0): 0.5 is subtracted from cu and cv; distortion is radial-tangential (k1 k2 p1 p2)
    or equidistant (k1 k2 k3 k4). Pictures are in colour.
    """

    label: ClassVar[str] = "euroc"
    bytes_per_pixel: ClassVar[float] = 3.0

    def accept(self, shot: Shot) -> None:
        self._lens(shot)

    def _lens(self, shot: Shot) -> Any:
        brown = getattr(shot.labels.camera, "model", "") == BROWN_CONRADY
        return lens_of(shot.labels.camera, self.label, LENSES, ("k3", "k4", "k5", "k6") if brown else ())

    def write(self, out: Output, shot: Shot) -> Note:
        lens, stamp = self._lens(shot), round(shot.time * 1e9)
        out.binary(f"{_folder(shot.sequence)}/cam{shot.camera}/data/{stamp}.png", shot.png)
        fisheye = lens.model == KANNALA_BRANDT
        return {
            **shot.facts(), "stamp": stamp, "intrinsics": [lens.fx, lens.fy, lens.cx - 0.5, lens.cy - 0.5],
            "model": "equidistant" if fisheye else "radial-tangential",
            "distortion": lens.several(*(("k1", "k2", "k3", "k4") if fisheye else ("k1", "k2", "p1", "p2"))),
        }  # fmt: skip

    def finish(self, out: Output, notes: Iterable[Note]) -> None:
        for sequence, found in sequences(notes):
            body = [note for note in found if note["camera"] == 0]
            folder = _folder(sequence)
            for camera in sorted({note["camera"] for note in found}):
                own = [note for note in found if note["camera"] == camera]
                lines = [f"{note['stamp']},{note['stamp']}.png\n" for note in own]
                out.text(f"{folder}/cam{camera}/data.csv", f"#timestamp [ns],filename\n{''.join(lines)}")
                out.text(f"{folder}/cam{camera}/sensor.yaml", _sensor(own[0], body[0], _rate(body)))
            states = f"{folder}/state_groundtruth_estimate0"
            out.text(f"{states}/data.csv", ",".join(COLUMNS) + "\n" + "".join(_states(body)))
            out.text(f"{states}/sensor.yaml", f"sensor_type: visual-inertial\ncomment: exact\n{_matrix(np.eye(4))}")


def _folder(sequence: int) -> str:
    return f"sequence_{sequence:04}/mav0"


def _rate(notes: list[Note]) -> float:
    return (len(notes) - 1) / (notes[-1]["time"] - notes[0]["time"]) if len(notes) > 1 else 0.0


def _states(notes: list[Note]) -> list[str]:
    poses = np.array([note["world_from_camera"] for note in notes])
    position, time = poses[:, :3, 3], np.array([note["time"] for note in notes])
    velocity = np.zeros_like(position)
    if len(notes) > 1:
        velocity = np.gradient(position, time, axis=0, edge_order=2 if len(notes) > 2 else 1)
    rows = []
    for note, p, v, pose in zip(notes, position, velocity, poses, strict=True):
        values = [*p.tolist(), *quaternion(pose[:3, :3]).tolist(), *v.tolist(), *[0.0] * 6]
        rows.append(",".join([str(note["stamp"]), *map(repr, values)]) + "\n")
    return rows


def _matrix(pose: np.ndarray) -> str:
    return f"T_BS:\n  cols: 4\n  rows: 4\n  data: {pose.ravel().tolist()}\n"


def _sensor(note: Note, body: Note, rate: float) -> str:
    relative = np.linalg.inv(body["world_from_camera"]) @ np.array(note["world_from_camera"])
    if note["camera"] == body["camera"]:
        relative = np.eye(4)
    return (
        f"sensor_type: camera\ncomment: camera {note['cameras'][note['camera']]}\n{_matrix(relative)}rate_hz: {rate!r}\n"
        f"resolution: [{note['width']}, {note['height']}]\ncamera_model: pinhole\nintrinsics: {note['intrinsics']}\n"
        f"distortion_model: {note['model']}\ndistortion_coefficients: {note['distortion']}\n"
    )
