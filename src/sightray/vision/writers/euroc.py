"""EuRoC MAV (ASL)."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, ClassVar

import numpy as np

from sightray.fields import integer, number
from sightray.vision.imu import Noise, rates, sample
from sightray.vision.intrinsics import BROWN_CONRADY, KANNALA_BRANDT, PINHOLE, lens_of
from sightray.vision.rotations import quaternion
from sightray.vision.shot import Shot
from sightray.vision.writers.base import Note, Output, Writer, sequences

COLUMNS = ("#timestamp", "p_RS_R_x [m]", "p_RS_R_y [m]", "p_RS_R_z [m]", "q_RS_w []", "q_RS_x []", "q_RS_y []",
           "q_RS_z []", "v_RS_R_x [m s^-1]", "v_RS_R_y [m s^-1]", "v_RS_R_z [m s^-1]", "b_w_RS_S_x [rad s^-1]",
           "b_w_RS_S_y [rad s^-1]", "b_w_RS_S_z [rad s^-1]", "b_a_RS_S_x [m s^-2]", "b_a_RS_S_y [m s^-2]",
           "b_a_RS_S_z [m s^-2]")  # fmt: skip
IMU_COLUMNS = ("#timestamp [ns]", "w_RS_S_x [rad s^-1]", "w_RS_S_y [rad s^-1]", "w_RS_S_z [rad s^-1]",
               "a_RS_S_x [m s^-2]", "a_RS_S_y [m s^-2]", "a_RS_S_z [m s^-2]")  # fmt: skip
LENSES = (PINHOLE, BROWN_CONRADY, KANNALA_BRANDT)


class EurocWriter(Writer):
    """EuRoC: for each sequence ``mav0/`` with cam0 ..., each data/, data.csv and sensor.yaml, an IMU, and the true states.

    ``state_groundtruth_estimate0/data.csv`` has 17 columns: nanoseconds, position of the body in the world in metres,
    quaternion body to world with w first, velocity in the world, and the biases of the IMU. The body is the first camera
    and the IMU, so its axes are OpenCV's: +x right, +y down, +z forward. ``sensor.yaml`` has ``T_BS``, camera to body, and
    intrinsics fu fv cu cv with the centre of the top-left pixel at (0, 0): 0.5 is subtracted from cu and cv; distortion is
    radial-tangential (k1 k2 p1 p2) or equidistant (k1 k2 k3 k4). Pictures are in colour.

    ``imu0/data.csv`` has angular velocity, rad/s, and specific force, m/s², in the body's axes, from the first picture to
    the last: at rest the force is `gravity` upwards, the world's +y. Samples are exact (see `vision.imu`) but for the noise
    that the writer's options state, as `imu0/sensor.yaml` does. Where no trajectory is known there is no ``imu0``, and
    velocities are differences of the positions before and after.
    """

    label: ClassVar[str] = "euroc"
    bytes_per_pixel: ClassVar[float] = 3.0
    imu_rate: float = number("samples of the IMU in a second; 0 for none", default=200.0, at_least=0, at_most=1e5)
    gravity: float = number("acceleration of what falls", default=9.80665, at_least=0, unit="m/s²")
    gyro_density: float = number("white noise of the gyroscope", default=0.0, at_least=0, unit="rad/s/√Hz")
    gyro_walk: float = number("random walk of its bias", default=0.0, at_least=0, unit="rad/s²/√Hz")
    accel_density: float = number("white noise of the accelerometer", default=0.0, at_least=0, unit="m/s²/√Hz")
    accel_walk: float = number("random walk of its bias", default=0.0, at_least=0, unit="m/s³/√Hz")
    seed: int = integer("names the noise", default=0, at_least=0)

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
            **shot.facts(), **self._inertia(shot), "stamp": stamp,
            "intrinsics": [lens.fx, lens.fy, lens.cx - 0.5, lens.cy - 0.5],
            "model": "equidistant" if fisheye else "radial-tangential",
            "distortion": lens.several(*(("k1", "k2", "k3", "k4") if fisheye else ("k1", "k2", "p1", "p2"))),
        }  # fmt: skip

    def _inertia(self, shot: Shot) -> Note:
        """Samples of the exact IMU until the next picture, each after its number; and the body's velocity."""
        if shot.trajectory is None or shot.camera != 0:
            return {}
        numbers = range(0)
        if self.imu_rate > 0:
            end = shot.time * self.imu_rate + 1e-6 if shot.next_time is None else shot.next_time * self.imu_rate - 1e-6
            numbers = range(math.ceil(shot.time * self.imu_rate - 1e-6), math.floor(end) + 1)
        down = np.array([0.0, -self.gravity, 0.0])
        samples = [[k, *sample(shot.trajectory, k / self.imu_rate, down).tolist()] for k in numbers]
        return {"imu": samples, "velocity": rates(shot.trajectory, shot.time).velocity.tolist()}

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
            biases = self._unit(out, folder, sequence, body)
            out.text(f"{states}/data.csv", ",".join(COLUMNS) + "\n" + "".join(_states(body, biases)))
            out.text(f"{states}/sensor.yaml", f"sensor_type: visual-inertial\ncomment: exact\n{_matrix(np.eye(4))}")

    def _unit(self, out: Output, folder: str, sequence: int, body: list[Note]) -> np.ndarray:
        """Write ``imu0``, if there are samples; the biases at the times of the pictures, (n, 6)."""
        samples = np.array([row for note in body for row in note.get("imu", ())]).reshape(-1, 7)
        if not len(samples):
            return np.zeros((len(body), 6))
        noise = Noise(self.gyro_density, self.gyro_walk, self.accel_density, self.accel_walk)
        white, biases = noise.draw(len(samples), self.imu_rate, (self.seed << 32) + sequence)
        rows = [
            ",".join([str(round(k * 1e9 / self.imu_rate)), *map(repr, values)]) + "\n"
            for k, values in zip(samples[:, 0].tolist(), (samples[:, 1:] + biases + white).tolist(), strict=True)
        ]
        out.text(f"{folder}/imu0/data.csv", ",".join(IMU_COLUMNS) + "\n" + "".join(rows))
        out.text(
            f"{folder}/imu0/sensor.yaml",
            f"sensor_type: imu\ncomment: exact but for the noise below\n{_matrix(np.eye(4))}rate_hz: {self.imu_rate!r}\n"
            f"gyroscope_noise_density: {self.gyro_density!r}\ngyroscope_random_walk: {self.gyro_walk!r}\n"
            f"accelerometer_noise_density: {self.accel_density!r}\naccelerometer_random_walk: {self.accel_walk!r}\n",
        )
        times = [note["time"] * self.imu_rate - 1e-6 for note in body]
        return biases[np.searchsorted(samples[:-1, 0], times)]


def _folder(sequence: int) -> str:
    return f"sequence_{sequence:04}/mav0"


def _rate(notes: list[Note]) -> float:
    return (len(notes) - 1) / (notes[-1]["time"] - notes[0]["time"]) if len(notes) > 1 else 0.0


def _states(notes: list[Note], biases: np.ndarray) -> list[str]:
    poses = np.array([note["world_from_camera"] for note in notes])
    position, time = poses[:, :3, 3], np.array([note["time"] for note in notes])
    velocity = np.zeros_like(position)
    if len(notes) > 1:
        velocity = np.gradient(position, time, axis=0, edge_order=2 if len(notes) > 2 else 1)
    velocity = np.array([note.get("velocity", v) for note, v in zip(notes, velocity, strict=True)])
    rows = []
    for note, p, v, pose, bias in zip(notes, position, velocity, poses, biases, strict=True):
        values = [*p.tolist(), *quaternion(pose[:3, :3]).tolist(), *v.tolist(), *bias.tolist()]
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
