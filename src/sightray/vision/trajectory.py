"""Trajectories: poses over time, for cameras and objects."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from sightray.cameras.base import look_at
from sightray.errors import SceneError
from sightray.mathlib.transform import Transform
from sightray.vision.rotations import between, exp, matrix, quaternion, slerp, times

INTERPOLATIONS = ("linear", "cubic")
RIGID = 1e-6


class Trajectory:
    """A pose for every time: subclasses state `pose`."""

    def pose(self, t: float) -> np.ndarray:
        """``world_from_body`` at time t, seconds: (4, 4) float64, rigid."""
        raise NotImplementedError

    def velocity(self, t: float, h: float = 1e-4) -> np.ndarray:
        """Velocity of the body's origin, (3,) m/s in the world: the difference of positions h before and after."""
        return (self.pose(t + h)[:3, 3] - self.pose(t - h)[:3, 3]) / (2 * h)

    def shaken(self, seed: int, *, position: float = 0.003, degrees: float = 0.2, low: float = 0.3,
               high: float = 6.0) -> Trajectory:  # fmt: skip
        """The same trajectory from a hand that is not quite still: see `Shaken`."""
        return Shaken(self, seed, position=position, degrees=degrees, low=low, high=high)


class Still(Trajectory):
    """One pose for ever."""

    def __init__(self, world_from_body: Any):
        self._pose = rigid(world_from_body, "Still")

    def pose(self, t: float) -> np.ndarray:
        return self._pose.copy()


class Keyframes(Trajectory):
    """Through given poses at given times; before the first and after the last it rests.

    Parameters
    ----------
    times : (n,) increasing, seconds.
    poses : n matrices or `Transform`, ``world_from_body``, rigid.
    interpolation : "linear" goes straight and turns evenly (slerp); "cubic" goes through the poses without a jerk: positions
        by cubic Hermite splines, rotations by cubic Bézier curves of quaternions, both with the velocity at a keyframe
        that a parabola through it and its neighbours has (for even times: Catmull-Rom). Velocities are continuous.

    References
    ----------
    E. Catmull, R. Rom, "A class of local interpolating splines", 1974; K. Shoemake, "Animating rotation with quaternion
    curves", SIGGRAPH 1985.
    """

    def __init__(self, times: Sequence[float], poses: Sequence[Any], interpolation: str = "cubic"):
        self.times = np.asarray(times, np.float64)
        if self.times.ndim != 1 or len(self.times) != len(poses) or not len(poses):
            raise SceneError(f"Keyframes: {len(poses)} poses for {self.times.size} times; allowed: one for each")
        if not np.isfinite(self.times).all() or (np.diff(self.times) <= 0).any():
            raise SceneError(f"Keyframes: times {self.times.tolist()}; allowed: finite and increasing")
        if interpolation not in INTERPOLATIONS:
            raise SceneError(f"Keyframes: interpolation '{interpolation}'; allowed: {', '.join(INTERPOLATIONS)}")
        matrices = np.array([rigid(pose, f"Keyframes: pose {k}") for k, pose in enumerate(poses)])
        self.positions = matrices[:, :3, 3]
        self.turns = np.array([quaternion(m[:3, :3]) for m in matrices])
        self.interpolation = interpolation
        steps = np.diff(self.times)
        self.velocities = _tangents(np.diff(self.positions, axis=0), steps)
        ways = [between(a, b) for a, b in zip(self.turns[:-1], self.turns[1:], strict=True)]
        self.spins = _tangents(np.array(ways).reshape(-1, 3), steps)

    @classmethod
    def looking(cls, times: Sequence[float], eyes: Any, targets: Any, up: Any = (0.0, 1.0, 0.0),
                interpolation: str = "cubic") -> Keyframes:  # fmt: skip
        """Of a camera that stands at `eyes` and looks at `targets`, (n, 3) or (3,) each."""
        eyes = np.asarray(eyes, np.float64)
        targets = np.broadcast_to(np.asarray(targets, np.float64), eyes.shape)
        poses = [look_at(eye, target, up, "Keyframes") for eye, target in zip(eyes, targets, strict=True)]
        return cls(times, poses, interpolation)

    def pose(self, t: float) -> np.ndarray:
        last = len(self.times) - 1
        t = float(np.clip(t, self.times[0], self.times[-1]))
        k = int(np.clip(np.searchsorted(self.times, t, "right") - 1, 0, max(last - 1, 0)))
        if last == 0:
            return _pose(self.positions[0], self.turns[0])
        h = float(self.times[k + 1] - self.times[k])
        s = (t - float(self.times[k])) / h
        p, q = self.positions[k], self.turns[k]
        if self.interpolation == "linear":
            return _pose((1 - s) * p + s * self.positions[k + 1], slerp(q, self.turns[k + 1], s))
        return _pose(self._cubic_position(k, s, h), self._cubic_turn(k, s, h))

    def _cubic_position(self, k: int, s: float, h: float) -> np.ndarray:
        """Hermite's four polynomials."""
        a, b = self.positions[k], self.positions[k + 1]
        u, v = h * self.velocities[k], h * self.velocities[k + 1]
        return (1 + 2 * s) * (1 - s) ** 2 * a + s * (1 - s) ** 2 * u + s * s * (3 - 2 * s) * b - s * s * (1 - s) * v

    def _cubic_turn(self, k: int, s: float, h: float) -> np.ndarray:
        """De Casteljau's construction with slerp for straight lines."""
        a, d = self.turns[k], self.turns[k + 1]
        b = times(a, exp(self.spins[k] * h / 3))
        c = times(d, exp(-self.spins[k + 1] * h / 3))
        ab, bc, cd = slerp(a, b, s), slerp(b, c, s), slerp(c, d, s)
        return slerp(slerp(ab, bc, s), slerp(bc, cd, s), s)


class Orbit(Trajectory):
    """Of a camera that circles around `center`, at which it looks.

    Parameters
    ----------
    center : (3,) metres.
    radius : distance from it, metres.
    elevation : degrees above the horizon.
    azimuth : degrees at time 0; 0 is towards +z, 90 towards +x.
    speed : degrees per second, counter-clockwise as seen from above.
    roll : clockwise turn about the line of sight, degrees.
    """

    def __init__(self, center: Any = (0, 0, 0), radius: float = 5.0, *, elevation: float = 20.0, azimuth: float = 0.0,
                 speed: float = 36.0, roll: float = 0.0):  # fmt: skip
        if not radius > 0 or not -90 < elevation < 90:
            raise SceneError(f"Orbit: radius {radius:g}, elevation {elevation:g}; allowed: > 0, and between -90 and 90")
        self.center, self.radius = np.asarray(center, np.float64), radius
        self.elevation, self.azimuth, self.speed, self.roll = elevation, azimuth, speed, roll

    def pose(self, t: float) -> np.ndarray:
        a, e = math.radians(self.azimuth + self.speed * t), math.radians(self.elevation)
        away = np.array([math.sin(a) * math.cos(e), math.sin(e), math.cos(a) * math.cos(e)])
        pose = look_at(self.center + self.radius * away, self.center, (0, 1, 0), "Orbit")
        return pose @ Transform.rotate((0, 0, 1), self.roll).matrix


class Shaken(Trajectory):
    """A trajectory with the tremor of a hand: noise between two frequencies, in place and in direction.

    Each of the six coordinates is a sum of sines of random phase and of frequencies that are random, evenly in the
    logarithm, between `low` and `high`, with amplitudes falling as 1/frequency. It is known at every time, and the same
    for the same seed.

    Parameters
    ----------
    seed : names the noise.
    position, degrees : root mean square of each coordinate, metres and degrees, in the body's own frame.
    low, high : band, hertz.
    """

    WAVES = 24

    def __init__(self, of: Trajectory, seed: int, *, position: float = 0.003, degrees: float = 0.2, low: float = 0.3,
                 high: float = 6.0):  # fmt: skip
        if not 0 < low < high:
            raise SceneError(f"Shaken: band {low:g} to {high:g} Hz; allowed: 0 < low < high")
        self.of = of
        random = np.random.Generator(np.random.Philox(key=seed)).random((2, 6, self.WAVES))
        share = (np.arange(self.WAVES) + random[0]) / self.WAVES
        self.rates = 2 * math.pi * low * (high / low) ** share
        self.phases = 2 * math.pi * random[1]
        weights = 1 / self.rates
        weights *= math.sqrt(2) / np.linalg.norm(weights, axis=1, keepdims=True)
        self.weights = weights * np.array([position] * 3 + [math.radians(degrees)] * 3)[:, None]

    def pose(self, t: float) -> np.ndarray:
        offset = (self.weights * np.sin(self.rates * t + self.phases)).sum(axis=1)
        return self.of.pose(t) @ _pose(offset[:3], exp(offset[3:]))


class Around(Trajectory):
    """A trajectory that is stated about another point than the world's origin.

    Parameters
    ----------
    of : the movement, with `point` as its origin.
    point : (3,) metres, world.
    """

    def __init__(self, of: Trajectory, point: Any):
        self.of, self.there = of, Transform.translate(*np.asarray(point, np.float64).tolist())

    def pose(self, t: float) -> np.ndarray:
        return self.there.matrix @ self.of.pose(t) @ self.there.inverse


def rigid(value: Any, who: str) -> np.ndarray:
    """A rigid pose as a (4, 4) array, or a `SceneError`."""
    pose = value.matrix if isinstance(value, Transform) else Transform(value).matrix
    axes = pose[:3, :3]
    if np.abs(axes.T @ axes - np.eye(3)).max() > RIGID or np.linalg.det(axes) < 0:
        raise SceneError(f"{who}: not rigid; allowed: a rotation and a translation")
    return pose


def _tangents(steps: np.ndarray, spans: np.ndarray) -> np.ndarray:
    """Velocities, (n, 3), at n keyframes from the ways between them: of the parabola through three neighbours."""
    n = len(spans) + 1
    if n == 1:
        return np.zeros((1, 3))
    slopes = steps / spans[:, None]
    found = np.empty((n, 3))
    found[0], found[-1] = slopes[0], slopes[-1]
    share = (spans[1:] / (spans[:-1] + spans[1:]))[:, None]
    found[1:-1] = share * slopes[:-1] + (1 - share) * slopes[1:]
    if n > 2:
        found[0], found[-1] = 2 * slopes[0] - found[1], 2 * slopes[-1] - found[-2]
    return found


def _pose(position: np.ndarray, turn: np.ndarray) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = matrix(turn), position
    return pose
