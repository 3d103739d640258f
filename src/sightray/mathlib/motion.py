"""Motion: where something is at every moment between keyframes, for Python and for kernels.

Each keyframe's matrix is taken apart into a translation, a rotation and a stretch, M = T R S, by its polar decomposition;
between keyframes translation and stretch change evenly, and the rotation turns evenly the shorter way round. Before the
first keyframe and after the last nothing moves.

References: K. Shoemake, T. Duff, "Matrix animation and polar decomposition", Graphics Interface 1992; K. Shoemake,
"Animating rotation with quaternion curves", SIGGRAPH 1985.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from sightray.errors import SceneError
from sightray.mathlib.table import aligned
from sightray.mathlib.transform import COLUMNS_WORDS, IDENTITY, Transform, as_transform

STEPS = 16  # parts of the time between two keyframes, for bounds
ALLOWED = "a list of keyframes [seconds, transform], their times ascending"

# Words of a keyframe; and of a placement: a matrix, then for each motion where its keyframes begin, how many there are,
# and the matrix after it.
TIME, ANGLE, TRANSLATION, ROTATION, STRETCH, KEY_WORDS = 0, 1, 4, 8, 12, 24
MOTIONS, FIRST, KEYS, COUNT, AFTER, MOTION_WORDS = 0, 4, 20, 21, 24, 20


class Motion:
    """Poses at ascending times, in seconds. Immutable.

    Attributes
    ----------
    times : (n,) float64, seconds
    poses : n of `Transform`
    """

    __slots__ = ("angles", "poses", "rotations", "stretches", "times", "translations")

    def __init__(self, keyframes: Any):
        times, poses = [], []
        for keyframe in _listed(keyframes):
            try:
                time, pose = keyframe
                times.append(float(time))
            except (TypeError, ValueError):
                raise SceneError(f"got {keyframe!r}; allowed: {ALLOWED}") from None
            poses.append(as_transform(pose))
        self.times, self.poses = np.array(times), tuple(poses)
        if not len(times) or not np.isfinite(self.times).all() or (np.diff(self.times) <= 0).any():
            raise SceneError(f"got the times {times}; allowed: {ALLOWED}")
        matrices = np.array([pose.matrix for pose in poses])
        self.translations = matrices[:, :3, 3]
        turns, self.stretches = _polar(matrices[:, :3, :3])
        self.rotations = _quaternions(turns)
        a, b = self.rotations[:-1], self.rotations[1:]
        # Half the angle between neighbours; this form is exact for small ones.
        self.angles = 2.0 * np.arctan2(np.linalg.norm(b - a, axis=1), np.linalg.norm(b + a, axis=1))

    def matrices(self, times: Any) -> np.ndarray:
        """The pose at some times, (...) float, seconds: (..., 4, 4) float64."""
        times = np.asarray(times, np.float64)
        found = np.broadcast_to(np.eye(4), (*times.shape, 4, 4)).copy()
        k = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, max(len(self.times) - 2, 0))
        k1 = np.minimum(k + 1, len(self.times) - 1)
        span = np.where(k1 > k, self.times[k1] - self.times[k], 1.0)
        f = np.clip((times - self.times[k]) / span, 0.0, 1.0)[..., np.newaxis]
        angle = (np.append(self.angles, 0.0)[k])[..., np.newaxis]
        small = angle < 1e-9
        a, b = np.sin((1 - f) * angle), np.sin(f * angle)
        a, b = np.where(small, 1 - f, a), np.where(small, f, b)
        q = a * self.rotations[k] + b * self.rotations[k1]
        f = f[..., np.newaxis]
        found[..., :3, :3] = _turns(q) @ ((1 - f) * self.stretches[k] + f * self.stretches[k1])
        found[..., :3, 3] = (1 - f[..., 0]) * self.translations[k] + f[..., 0] * self.translations[k1]
        return found

    def at(self, time: float) -> Transform:
        """The pose at a time, seconds."""
        return Transform(self.matrices(time))

    def bounds(self, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Box around all places of a box, whatever the time.

        Corners are followed at `STEPS` times between keyframes; in between, a path with second derivative of at most B
        leaves the straight line by at most B h²/8.
        """
        if not (np.isfinite(lower).all() and np.isfinite(upper).all()):
            return np.full(3, -np.inf), np.full(3, np.inf)
        corners = np.array(np.meshgrid(*zip(lower, upper, strict=True))).reshape(3, -1).T
        steps = np.arange(STEPS + 1) / STEPS
        times = (self.times[:-1, np.newaxis] + np.diff(self.times)[:, np.newaxis] * steps).ravel()
        m = self.matrices(np.concatenate([times, self.times]))
        places = corners @ np.swapaxes(m[:, :3, :3], 1, 2) + m[:, np.newaxis, :3, 3]
        size = np.linalg.norm(corners @ np.swapaxes(self.stretches, 1, 2), axis=2).max(axis=1)
        growth = np.linalg.norm(corners @ np.swapaxes(np.diff(self.stretches, axis=0), 1, 2), axis=2).max(axis=1)
        turn = 2.0 * self.angles
        bend = turn * turn * np.maximum(size[:-1], size[1:]) + 2.0 * turn * growth
        slack = bend.max(initial=0.0) / (8.0 * STEPS**2)
        return places.min(axis=(0, 1)) - slack, places.max(axis=(0, 1)) + slack

    def keys(self) -> np.ndarray:
        """The keyframes as kernels read them, (n, KEY_WORDS) float64."""
        keys = aligned((len(self.times), KEY_WORDS), np.float64)
        keys[:, TIME], keys[:-1, ANGLE] = self.times, self.angles
        keys[:, TRANSLATION : TRANSLATION + 3] = self.translations
        keys[:, ROTATION : ROTATION + 4] = self.rotations
        for column in range(3):
            at = STRETCH + 4 * column
            keys[:, at : at + 3] = self.stretches[:, :, column]
        return keys

    def __eq__(self, other: object) -> bool:
        same = isinstance(other, Motion) and np.array_equal(self.times, other.times)
        return same and self.poses == other.poses  # type: ignore[attr-defined]

    def __hash__(self) -> int:
        return hash((self.times.tobytes(), self.poses))

    def __repr__(self) -> str:
        return f"Motion({len(self.times)} keyframes from {self.times[0]:g} s to {self.times[-1]:g} s)"


class Placement(NamedTuple):
    """``world_from_object`` over time: the product of ``before @ motion`` for each motion, and of `last`."""

    moves: tuple[tuple[Transform, Motion], ...] = ()
    last: Transform = IDENTITY

    def within(self, transform: Transform, motion: Motion | None) -> Placement:
        """What is placed by `transform`, and moved before that, inside of what stands here."""
        last = transform if self.last is IDENTITY else self.last if transform.is_identity else self.last @ transform
        if motion is None:
            return Placement(self.moves, last)
        return Placement((*self.moves, (last, motion)), IDENTITY)

    def at(self, time: float) -> Transform:
        """``world_from_object`` at a time, seconds."""
        if not self.moves:
            return self.last
        place = IDENTITY
        for before, motion in self.moves:
            place = place @ before @ motion.at(time)
        return place @ self.last

    def bounds(self, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Box around all places of a box, whatever the time."""
        lower, upper = self.last.box(lower, upper)
        for before, motion in reversed(self.moves):
            lower, upper = before.box(*motion.bounds(lower, upper))
        return lower, upper

    def table(self) -> np.ndarray:
        """The placement as `mathlib.moving` reads it, (n,) float64: matrices, then the keyframes of all motions."""
        keys = [motion.keys().ravel() for _, motion in self.moves]
        size = FIRST + MOTION_WORDS * (len(keys) + 1)
        table = aligned(size + sum(map(len, keys)), np.float64)
        whole = table.view(np.int64)
        whole[MOTIONS] = len(keys)
        for k, matrix in enumerate([*(before for before, _ in self.moves), self.last]):
            at = FIRST + MOTION_WORDS * k
            table[at : at + COLUMNS_WORDS] = matrix.matrix.T.ravel()
        for k, numbers in enumerate(keys):
            at = MOTION_WORDS * k
            whole[KEYS + at], whole[COUNT + at] = size, len(numbers) // KEY_WORDS
            table[size : size + len(numbers)] = numbers
            size += len(numbers)
        return table


def as_motion(value: Any) -> Motion | None:
    """A motion as it is, None as none, anything else as keyframes."""
    return value if value is None or isinstance(value, Motion) else Motion(value)


def plain_motion(motion: Motion | None) -> Any:
    """A motion as lists of numbers."""
    if motion is None:
        return None
    return [[time, pose.matrix.tolist()] for time, pose in zip(motion.times.tolist(), motion.poses, strict=True)]


def _listed(keyframes: Any) -> list[Any]:
    try:
        return list(keyframes)
    except TypeError:
        raise SceneError(f"got {keyframes!r}; allowed: {ALLOWED}") from None


def _polar(matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotations and symmetric stretches whose products the matrices are, (n, 3, 3) each; mirrors stretch by -1."""
    u, s, vt = np.linalg.svd(matrices)
    turns = u @ vt
    stretches = np.swapaxes(vt, 1, 2) @ (s[:, :, np.newaxis] * vt)
    sign = np.sign(np.linalg.det(turns))
    if len(np.unique(sign)) > 1:
        raise SceneError("one keyframe is the mirror image of another; allowed: motions without a point of no volume")
    return turns * sign[:, None, None], stretches * sign[:, None, None]


def _quaternions(turns: np.ndarray) -> np.ndarray:
    """Unit quaternions x, y, z, w of rotations, (n, 4); neighbours lie on the same side."""
    found = np.empty((len(turns), 4))
    for k, r in enumerate(turns):
        # The largest of the four comes from the diagonal, the others from it, so nothing small is divided by.
        diagonal = np.array([r[0, 0], r[1, 1], r[2, 2], np.trace(r)])
        i = int(np.argmax(diagonal))
        if i == 3:
            q = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], 1 + diagonal[3]])
        else:
            j, m = (i + 1) % 3, (i + 2) % 3
            q = np.empty(4)
            q[i], q[j], q[m] = 1 + 2 * r[i, i] - diagonal[3], r[i, j] + r[j, i], r[i, m] + r[m, i]
            q[3] = r[m, j] - r[j, m]
        found[k] = q / np.linalg.norm(q)
        if k and found[k] @ found[k - 1] < 0:
            found[k] = -found[k]
    return found


def _turns(q: np.ndarray) -> np.ndarray:
    """Rotations of quaternions of any length, (..., 3, 3)."""
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    x, y, z, w = np.moveaxis(q, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))
