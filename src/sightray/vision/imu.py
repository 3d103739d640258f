"""An inertial measurement unit: what gyroscopes and accelerometers measure that are fixed to a moving body.

With R(t) the axes and p(t) the origin of the body in the world, and g the acceleration of a falling stone, a gyroscope
measures the angular velocity ω of the body in its own axes, ``dR/dt = R [ω]×``, and an accelerometer the *specific force*
``Rᵀ (d²p/dt² - g)``: of a body at rest that is 9.8 m/s² upwards, of a falling one nothing.

Derivatives are central differences of fourth order of the trajectory's own poses, right to about 1e-8 where it is smooth.
Where a trajectory bends all at once, as linear `Keyframes` do, its acceleration is not finite, and samples do not show it.

References: B. Fornberg, "Generation of finite difference formulas on arbitrarily spaced grids", 1988; N. El-Sheimy, H. Hou,
X. Niu, "Analysis and modeling of inertial sensors using Allan variance", 2008.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sightray.vision.rotations import between, quaternion
from sightray.vision.trajectory import Trajectory

STEP = 2e-3  # seconds, of differences
OFFSETS = np.arange(-2, 3)
FIRST = np.array([1, -8, 0, 8, -1]) / 12  # weights of derivatives
SECOND = np.array([-1, 16, -30, 16, -1]) / 12


class Rates(NamedTuple):
    """How a body moves at a time."""

    turning: np.ndarray  # (3,) angular velocity, rad/s, in the body's axes
    velocity: np.ndarray  # (3,) m/s, world
    acceleration: np.ndarray  # (3,) m/s², world


def rates(trajectory: Trajectory, t: float) -> Rates:
    """How a trajectory moves at time t, seconds."""
    poses = [trajectory.pose(t + k * STEP) for k in OFFSETS]
    places = np.array([pose[:3, 3] for pose in poses])
    turns = [quaternion(pose[:3, :3]) for pose in poses]
    ways = np.array([between(turns[2], turn) for turn in turns])  # in the axes at time t
    return Rates(FIRST @ ways / STEP, FIRST @ (places - places[2]) / STEP, SECOND @ (places - places[2]) / STEP**2)


def sample(trajectory: Trajectory, t: float, gravity: np.ndarray) -> np.ndarray:
    """What an exact unit measures at time t: angular velocity and specific force in the body's axes, (6,)."""
    now = rates(trajectory, t)
    force = trajectory.pose(t)[:3, :3].T @ (now.acceleration - gravity)
    return np.concatenate([now.turning, force])


class Noise(NamedTuple):
    """How a unit errs: white noise, and biases that walk at random from 0.

    Densities, as data sheets and Kalibr state them: of samples `rate` times a second, white noise has a standard deviation
    of density √rate, and a bias changes from one to the next by walk / √rate.
    """

    gyro_density: float = 0.0  # rad/s/√Hz
    gyro_walk: float = 0.0  # rad/s²/√Hz
    accel_density: float = 0.0  # m/s²/√Hz
    accel_walk: float = 0.0  # m/s³/√Hz

    def draw(self, count: int, rate: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
        """White noise and biases of samples, (count, 6) each; the same for the same seed."""
        white, walk = np.random.Generator(np.random.Philox(key=seed)).normal(size=(2, count, 6))
        white *= np.repeat([self.gyro_density, self.accel_density], 3) * np.sqrt(rate)
        walk *= np.repeat([self.gyro_walk, self.accel_walk], 3) / np.sqrt(rate)
        return white, np.cumsum(walk, axis=0) - walk[:1]  # it begins at 0
