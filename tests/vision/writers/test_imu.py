"""The IMU of the EuRoC writer: against closed forms, and integrated again."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest
import yaml
from example_shots import example_scene

import sightray as sr
from sightray.vision import write_shots
from sightray.vision.animation import Animation
from sightray.vision.imu import Noise, rates, sample
from sightray.vision.rotations import matrix
from sightray.vision.shot import Shot
from sightray.vision.trajectory import Keyframes, Orbit, Still, Trajectory
from sightray.vision.writers.euroc import EurocWriter

G = 9.80665
DOWN = np.array([0, -G, 0])


def shots(trajectory: Trajectory, frames: int = 5, rate: float = 10.0) -> list[Shot]:
    """A sequence of pictures on a trajectory."""
    moving = Animation(example_scene(), camera=trajectory)
    times = np.arange(frames + 1) / rate
    return [
        Shot(sr.label(moving.at(now), "instance"), frame=k, step=k, time=now, trajectory=trajectory,
             next_time=then if k + 1 < frames else None)
        for k, (now, then) in enumerate(zip(times[:-1].tolist(), times[1:].tolist(), strict=True))
    ]  # fmt: skip


def written(tmp_path, trajectory: Trajectory, **options) -> tuple[np.ndarray, np.ndarray, dict]:
    """What ``imu0/data.csv`` and the true states say, and ``imu0/sensor.yaml``."""
    folder = write_shots(shots(trajectory), tmp_path, EurocWriter(**options)) / "euroc/sequence_0000/mav0"
    rows, states = (
        np.loadtxt(folder / name / "data.csv", delimiter=",") for name in ("imu0", "state_groundtruth_estimate0")
    )
    return rows, states, yaml.safe_load((folder / "imu0/sensor.yaml").read_text())


def test_at_rest_an_imu_feels_the_ground_push_upwards(tmp_path):
    pose = sr.PerspectiveCamera(eye=(0, 1, 3), target=(0, 0, 0)).world_from_camera()
    rows, states, sensor = written(tmp_path, Still(pose), gravity=9.81)
    assert np.abs(rows[:, 1:4]).max() <= 1e-12
    assert np.abs(rows[:, 4:] @ pose[:3, :3].T - (0, 9.81, 0)).max() <= 1e-9
    assert (states[:, 8:] == 0).all()
    assert sensor["sensor_type"] == "imu"
    assert np.reshape(sensor["T_BS"]["data"], (4, 4)).tolist() == np.eye(4).tolist()


def test_circular_motion_is_centripetal_and_turns_evenly(tmp_path):
    """ω about the vertical and ω² r towards the axis, in the body's axes; velocity along the circle."""
    speed, radius, rise = 50.0, 3.0, 20.0
    orbit = Orbit((0.2, 0.4, -0.1), radius, elevation=rise, azimuth=10, speed=speed, roll=5)
    rows, states, sensor = written(tmp_path, orbit, imu_rate=250.0)
    omega, arm = math.radians(speed), radius * math.cos(math.radians(rise))
    assert sensor["rate_hz"] == 250.0
    assert rows[:, 0].tolist() == [4_000_000 * k for k in range(101)]  # from the first picture to the last
    for stamp, *values in rows:
        t = stamp * 1e-9
        axes, angle = orbit.pose(t)[:3, :3], math.radians(10) + omega * t
        outward = np.array([math.sin(angle), 0, math.cos(angle)])
        assert np.abs(axes @ values[:3] - (0, omega, 0)).max() <= 1e-9
        assert np.abs(axes @ values[3:] - (-(omega**2) * arm * outward - DOWN)).max() <= 1e-7
    for row in states:
        angle = math.radians(10) + omega * row[0] * 1e-9
        expected = omega * arm * np.array([math.cos(angle), 0, -math.sin(angle)])
        assert np.abs(row[8:11] - expected).max() <= 1e-9


@pytest.mark.parametrize("name", ["shaken orbit", "smooth keyframes"])
def test_integrated_samples_lead_along_the_trajectory(tmp_path, name):
    """SciPy integrates dR/dt = R [ω]×, dv/dt = R f + g, dp/dt = v between the first picture and the last."""
    from scipy.integrate import solve_ivp
    from scipy.interpolate import CubicSpline

    ends = [sr.PerspectiveCamera(eye=e, target=(0, 0, 0)).world_from_camera() for e in ((0, 1, 4), (1, 1.5, 3))]
    paths = {
        "shaken orbit": Orbit((0, 0.4, 0), 3.0, speed=40).shaken(3, position=0.01, degrees=1.0),
        "smooth keyframes": Keyframes([-1, 2], ends),
    }
    path = paths[name]
    rows, states, _ = written(tmp_path, path, imu_rate=1000.0)
    felt = CubicSpline(rows[:, 0] * 1e-9, rows[:, 1:])

    def change(t, state):
        turn, now = state[6:].reshape(3, 3), felt(t)
        x, y, z = now[:3]
        spin = turn @ np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        return np.concatenate([state[3:6], turn @ now[3:] + DOWN, spin.ravel()])

    first, last = states[0], states[-1]
    start = np.concatenate([first[1:4], first[8:11], matrix(first[4:8]).ravel()])
    end = solve_ivp(change, (0.0, last[0] * 1e-9), start, rtol=1e-10, atol=1e-12, max_step=0.01).y[:, -1]
    assert np.linalg.norm(last[1:4] - first[1:4]) > 0.05
    assert np.abs(end[:3] - last[1:4]).max() <= 1e-6
    assert np.abs(end[3:6] - last[8:11]).max() <= 1e-6
    assert np.abs(end[6:].reshape(3, 3) - matrix(last[4:8])).max() <= 1e-6


def test_differences_are_those_of_the_trajectory_and_not_of_its_samples():
    spiral = Keyframes(np.arange(4.0), [np.eye(4), sr.Transform.translate(1, 0, 0), sr.Transform.translate(1, 2, 0),
                                        sr.Transform.translate(4, 2, 1)])  # fmt: skip
    now = rates(spiral, 1.5)
    np.testing.assert_allclose(now.velocity, spiral.velocity(1.5), atol=1e-7)
    assert np.abs(now.turning).max() <= 1e-12
    felt = sample(spiral, 1.5, np.zeros(3))
    np.testing.assert_allclose(felt[3:], now.acceleration, atol=1e-12)


@functools.cache
def long_run() -> tuple[np.ndarray, np.ndarray]:
    return Noise(0.01, 0.002, 0.1, 0.03).draw(200_000, 200.0, 5)


def test_noise_has_the_densities_that_are_stated():
    white, biases = long_run()
    expected = np.repeat([0.01, 0.1], 3) * math.sqrt(200)
    z = (white.std(axis=0) / expected - 1) * math.sqrt(2 * len(white))
    assert np.abs(z).max() < 4
    steps = np.diff(biases, axis=0)
    z = (steps.std(axis=0) / (np.repeat([0.002, 0.03], 3) / math.sqrt(200)) - 1) * math.sqrt(2 * len(steps))
    assert np.abs(z).max() < 4
    assert (biases[0] == 0).all()
    assert np.abs(np.corrcoef(np.concatenate([white[1:], steps], axis=1).T) - np.eye(12)).max() < 4 / math.sqrt(2e5)


def test_the_written_noise_is_that_of_the_seed_and_biases_are_told(tmp_path):
    orbit, noise = Orbit(speed=30), {"gyro_density": 0.01, "gyro_walk": 0.1, "accel_walk": 0.2, "accel_density": 0.1}
    exact, _, _ = written(tmp_path / "a", orbit)
    noisy, states, sensor = written(tmp_path / "b", orbit, seed=4, **noise)
    again, _, _ = written(tmp_path / "c", orbit, seed=4, **noise)
    other, _, _ = written(tmp_path / "d", orbit, seed=5, **noise)
    assert (noisy == again).all()
    assert (noisy[:, 1:] != other[:, 1:]).all()
    assert (sensor["gyroscope_noise_density"], sensor["accelerometer_random_walk"]) == (0.01, 0.2)
    white, biases = Noise(0.01, 0.1, 0.1, 0.2).draw(len(exact), 200.0, 4 << 32)
    np.testing.assert_allclose(noisy[:, 1:] - exact[:, 1:], white + biases, atol=1e-12)
    np.testing.assert_allclose(states[:, 11:], biases[::20], atol=1e-15)
    assert np.abs(states[1:, 11:]).min() > 0


def test_without_a_trajectory_or_a_rate_there_is_no_imu(tmp_path):
    labels = sr.label(example_scene(), "instance")
    for name, shot, options in (("a", Shot(labels), {}), ("b", shots(Orbit(), 1)[0], {"imu_rate": 0.0})):
        root = write_shots([shot], tmp_path / name, EurocWriter(**options))
        assert not (root / "euroc/sequence_0000/mav0/imu0").exists()
