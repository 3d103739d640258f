"""Flow of what is seen by mirrors and through glass: the pixel of another picture whose path ends at the same point.

Where a path ends at the point X, which moves to X', the other picture shows it at the pixel x' whose path, by the same
surfaces as they are there, passes through X'. With o and d the last ray of that path, two numbers have to vanish: the
parts of (X' - o) / |X' - o| - d across the ray. Newton's method solves for x'; the derivatives are central
differences, whose error only costs steps, not digits. What escapes is at infinity, and keeps its direction. Where things
move while rows are exposed one after the other, X' and the surfaces are those of the time of the row of x'.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from sightray.vision.paths import PathEnds, path_ends
from sightray.vision.rolling import row_times

STEP = 1e-5  # pixels, of differences
STEPS = 40  # of Newton's method
ROUNDS = 24  # in which pixels that found nothing begin again where their neighbours found it
LONGEST = 32.0  # pixels that one of them may go
DONE = 1e-10  # pixels; the last step of a solution is shorter
EXACT = 1e-9  # radians by which a solution's last ray may miss the point


Target = Callable[[np.ndarray, np.ndarray], np.ndarray]  # numbers of paths, pixels (n, 2): where their ends are then


def path_flow(frame: Any, how: int) -> np.ndarray:
    """Flow to the picture `next` of what is seen by mirrors or through glass, (h, w, 2); NaN where there is none."""
    from sightray.vision.layers.flow import pixel_centres

    other = frame.beside("next")
    pixels = pixel_centres(frame.width, frame.height).reshape(-1, 2)
    names = np.append(frame.partner_items("next"), -1)
    ends = path_ends(frame, pixels, how, names)
    some = np.flatnonzero((ends.way != 0) & ((ends.item < 0) | (names[ends.item] >= 0)))
    flow = np.full(pixels.shape, np.nan)
    target = targets(frame, ends, pixels, some)
    start, todo = pixels, some
    for _ in range(ROUNDS):
        if not len(todo):
            break
        flow[todo] = solve(other, how, start, todo, target, ends) - pixels[todo]
        lost = some[np.isnan(flow[some, 0])]
        guess = neighbours_flow(flow.reshape(frame.height, frame.width, 2), ends.way.reshape(frame.height, frame.width))
        start = pixels + guess.reshape(-1, 2)
        todo = lost[np.isfinite(start[lost, 0])]
    return flow.reshape(frame.height, frame.width, 2)


def neighbours_flow(flow: np.ndarray, way: np.ndarray) -> np.ndarray:
    """For each pixel the mean flow of those around it whose path goes the same way; NaN where none is known."""
    height, width = way.shape
    padded = np.pad(flow, ((1, 1), (1, 1), (0, 0)), constant_values=np.nan)
    ways = np.pad(way, 1)
    total, count = np.zeros(flow.shape), np.zeros(way.shape)
    for dy in range(3):
        for dx in range(3):
            near = padded[dy : dy + height, dx : dx + width]
            usable = np.isfinite(near[..., 0]) & (ways[dy : dy + height, dx : dx + width] == way)
            total[usable] += near[usable]
            count += usable
    return np.where(count[..., None] > 0, total / np.maximum(count, 1)[..., None], np.nan)


def targets(frame: Any, ends: PathEnds, pixels: np.ndarray, some: np.ndarray) -> Target:
    """Where the ends of some paths are in the other scene, at the time at which it exposes a pixel; of what escapes the
    direction."""
    moved = ends.direction.copy()
    items = [(index, some[ends.item[some] == index]) for index in np.unique(ends.item[some]) if index >= 0]
    if not frame.rolls("next"):
        for index, these in items:
            moved[these] = moved_ends(frame.motion("next"), index, PathEnds(*(part[these] for part in ends)))
        return lambda paths, _: moved[paths]

    rolling, after, times = frame.rolling("next"), frame.other("next"), row_times(frame.view, pixels[:, 1])
    for index, these in items:
        moved[these] = rolling.inside(index, ends.position[these], ends.primitive[these], times[these])

    def at(paths: np.ndarray, there: np.ndarray) -> np.ndarray:
        found, own, then = moved[paths], ends.item[paths], row_times(after, there[:, 1])
        for index in np.unique(own[own >= 0]):
            found[own == index] = rolling.outside(index, found[own == index], then[own == index])
        return found

    return at


def moved_ends(motion: Any, index: int, ends: PathEnds) -> np.ndarray:
    """Where ends on an item are in the other scene, (n, 3), if nothing moves while rows are exposed."""
    points, vertices = ends.position, motion.vertices[index]
    if vertices is not None:
        corners = vertices[motion.before.compiled.items[index].shape.faces[ends.primitive]]
        u, v = ends.weights[:, :1], ends.weights[:, 1:]
        points = corners[:, 0] + (corners[:, 1] - corners[:, 0]) * u + (corners[:, 2] - corners[:, 0]) * v
    return points @ motion.moves[index, :3, :3].T + motion.moves[index, :3, 3]


def solve(frame: Any, how: int, start: np.ndarray, paths: np.ndarray, target: Target, wanted: PathEnds) -> np.ndarray:
    """The pixels whose paths, by the ways of those wanted, lead to the targets of some `paths`; NaN where there is none.

    `start` and `wanted` are for all paths; the answer, (n, 2), is for those numbered.
    """
    x, active, solved = start[paths], np.arange(len(paths)), np.full((len(paths), 2), np.nan)
    escaped, way = wanted.item[paths] < 0, wanted.way[paths]
    names = np.arange(len(frame.compiled.items) + 1)
    for _ in range(STEPS):
        offsets = np.array([[0, 0], [STEP, 0], [-STEP, 0], [0, STEP], [0, -STEP]])
        probes = (x[active, None] + offsets).reshape(-1, 2)
        ends = path_ends(frame, probes, how, names)
        goal = target(np.repeat(paths[active], 5), probes)
        error = misses(ends, goal, np.repeat(escaped[active], 5)).reshape(-1, 5, 3)
        ways = ends.way.reshape(-1, 5)
        error = across(error, ends.direction.reshape(-1, 5, 3)[:, 0])
        slope = np.stack([error[:, 1] - error[:, 2], error[:, 3] - error[:, 4]], axis=-1) / (2 * STEP)
        with np.errstate(all="ignore"):
            determinant = slope[:, 0, 0] * slope[:, 1, 1] - slope[:, 0, 1] * slope[:, 1, 0]
            move = np.stack([slope[:, 0, 1] * error[:, 0, 1] - slope[:, 1, 1] * error[:, 0, 0],
                             slope[:, 1, 0] * error[:, 0, 0] - slope[:, 0, 0] * error[:, 0, 1]], axis=-1)  # fmt: skip
            move /= determinant[:, None]
            size = np.linalg.norm(move, axis=-1)
            move *= np.minimum(1.0, LONGEST / size)[:, None]
        found = (size < DONE) & (np.linalg.norm(error[:, 0], axis=-1) < EXACT) & (ways[:, 0] == way[active])
        solved[active[found]] = x[active[found]] + move[found]
        alive = np.isfinite(size) & ~found & (ways[:, 0] == way[active])
        x[active] += np.where(np.isfinite(move), move, 0.0)
        active = active[alive]
        if not len(active):
            break
    return solved


def misses(ends: PathEnds, target: np.ndarray, escaped: np.ndarray) -> np.ndarray:
    """Unit direction from the last ray's start to the target, less that of the ray, (n, 3)."""
    to = np.where(escaped[:, None], target, target - ends.origin)
    with np.errstate(all="ignore"):
        return to / np.linalg.norm(to, axis=-1, keepdims=True) - ends.direction


def across(vectors: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """The two parts of vectors, (n, k, 3), across a direction, (n, 3): (n, k, 2)."""
    helper = np.eye(3)[np.argmin(np.abs(direction), axis=-1)]
    first = np.cross(direction, helper)
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    frame = np.stack([first, np.cross(direction, first)], axis=1)
    return np.einsum("nkc,npc->nkp", vectors, frame)
