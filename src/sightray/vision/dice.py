"""Random numbers by name: the same for the same seed, frame and place in a recipe, whatever else is drawn.

Each number is a hash (BLAKE2b) of those, so frames can be made in any order, by any number of workers, and a change of one
line of a recipe leaves all other draws alone. Nothing depends on the version of a library.
"""

from __future__ import annotations

import hashlib
import math
import statistics
from collections.abc import Sequence
from typing import Any

import numpy as np


class Dice:
    """Draws for one place of a recipe in one frame; `at` leads to those of other places."""

    def __init__(self, seed: int, frame: int, where: str = ""):
        self.seed, self.frame, self.where = seed, frame, where
        self.count = 0

    def at(self, where: Any) -> Dice:
        """The dice of a place below this one."""
        return Dice(self.seed, self.frame, f"{self.where}/{where}")

    def whole(self, bits: int = 63) -> int:
        """A whole number of at most 64 bits."""
        text = f"{self.seed} {self.frame} {self.where} {self.count}"
        self.count += 1
        return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=8).digest(), "little") >> (64 - bits)

    def unit(self) -> float:
        """A number in [0, 1)."""
        return self.whole(53) * 2.0**-53

    def between(self, low: float, high: float) -> float:
        """Evenly from low to high."""
        return low + (high - low) * self.unit()

    def integer(self, low: int, high: int) -> int:
        """Evenly one of low ... high."""
        return low + int(self.unit() * (high - low + 1))

    def normal(self) -> float:
        """Of mean 0 and standard deviation 1, by the inverse of the distribution."""
        return statistics.NormalDist().inv_cdf((self.whole(53) + 0.5) * 2.0**-53)

    def choice(self, weights: Sequence[float]) -> int:
        """An index, in proportion to weights."""
        ends = np.cumsum(weights)
        return int(np.searchsorted(ends, self.unit() * ends[-1], "right"))

    def turn(self) -> np.ndarray:
        """A quaternion, all rotations alike (K. Shoemake, "Uniform random rotations", Graphics Gems III, 1992)."""
        u, a, b = self.unit(), 2 * math.pi * self.unit(), 2 * math.pi * self.unit()
        r, s = math.sqrt(1 - u), math.sqrt(u)
        return np.array([r * math.sin(a), r * math.cos(a), s * math.sin(b), s * math.cos(b)])
