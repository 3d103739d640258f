"""Objects put on a level ground, none of which runs into another."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from sightray.mathlib.transform import Transform
from sightray.scene.instance import Instance
from sightray.vision.dice import Dice
from sightray.vision.overlap import Solid, overlap
from sightray.vision.resting import resting
from sightray.vision.rotations import matrix

TRIES = 100  # places that are tried for an object, until it is left out
TURNS = ("upright", "rest", "any", "none")


class Ground(NamedTuple):
    """Where objects are put: y = `height`, and x and z of their middles from `low` to `high`."""

    height: float = 0.0
    low: tuple[float, float] = (-1.0, -1.0)
    high: tuple[float, float] = (1.0, 1.0)


class Model:
    """A thing that is put down, once or several times: what it looks like, and what room it takes."""

    def __init__(self, thing: Any):
        self.thing, self.solid = thing, Solid(thing)
        self.longest = float((self.solid.upper - self.solid.lower).max())
        self.center = 0.5 * (self.solid.lower + self.solid.upper)
        self._scaled: dict[float, Any] = {}

    def scaled(self, factor: float) -> Any:
        """The thing enlarged; the same object each time, which shares what is known of it."""
        if factor == 1.0:
            return self.thing
        if factor not in self._scaled:
            self._scaled = {factor: Instance(of=self.thing, transform=Transform.scale(factor))}
        return self._scaled[factor]


class Placed(NamedTuple):
    """A model at its place: `world_from_model` is rigid but for the scale."""

    model: Model
    factor: float
    pose: np.ndarray  # (4, 4), of what was scaled

    @property
    def matrix(self) -> np.ndarray:
        """``world_from_model`` with the scale."""
        return self.pose @ np.diag([self.factor] * 3 + [1.0])


def place(model: Model, factor: float, turn: str, ground: Ground, others: list[Placed], dice: Dice) -> Placed | None:
    """A place on the ground where the model runs into none of the others; None if none is found in `TRIES`.

    Parameters
    ----------
    turn : "none", "upright" (turned about the vertical), "rest" (lying on a face of its convex hull, on which it does not
        tip over, turned about the vertical), or "any" (all rotations alike; it then stands on its lowest point).
    """
    for attempt in range(TRIES):
        own = dice.at(attempt)
        pose = np.eye(4)
        pose[:3, :3] = _attitude(model, turn, own)
        scale = np.diag([factor] * 3 + [1.0])
        middle = pose[:3, :3] @ (factor * model.center)
        pose[0, 3] = own.between(ground.low[0], ground.high[0]) - middle[0]
        pose[2, 3] = own.between(ground.low[1], ground.high[1]) - middle[2]
        pose[1, 3] = ground.height - model.solid.lowest(pose @ scale)
        found = Placed(model, factor, pose)
        if not any(overlap(model.solid, found.matrix, other.model.solid, other.matrix) for other in others):
            return found
    return None


def _attitude(model: Model, turn: str, dice: Dice) -> np.ndarray:
    about_y = Transform.rotate((0, 1, 0), 360 * dice.unit()).matrix[:3, :3]
    if turn == "none":
        return np.eye(3)
    if turn == "upright":
        return about_y
    start = matrix(dice.turn())
    return start if turn == "any" else about_y @ resting(model.solid.points, model.center, start)
