"""Schedules: how many samples each pixel is to have after the next pass.

A render is a row of passes. After each, its schedule is asked for the next target, given the film and the target that
was just reached: nothing else is remembered, so that a render can go on from a checkpoint.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from sightray.film.film import Film

MOST = 1 << 20  # samples of a pixel
COARSE, LARGE = 4, 1 << 18  # pictures of so many pixels begin with every fourth pixel of every fourth row


class Schedule(Protocol):
    """What decides where samples are taken."""

    @property
    def samples(self) -> int:
        """How many there will be in each pixel on average, about; `MOST` where that is not known."""

    def next(self, film: Film, reached: np.ndarray | None) -> np.ndarray | None:
        """Samples that each pixel is to have in all, (height, width) int32, or None at the end."""


class Uniform(NamedTuple):
    """As many samples everywhere.

    The first pass takes one, so that there soon is a picture; before that, large pictures get a coarse one. Then
    numbers grow by four, which costs little waiting for the last tile; or by less where a limit other than `samples`
    may end the render at any moment, lest some pixels have many more samples than others.
    """

    samples: int = MOST
    open_ended: bool = False

    def next(self, film: Film, reached: np.ndarray | None) -> np.ndarray | None:
        if reached is None and film.width * film.height >= LARGE:
            coarse = np.zeros((film.height, film.width), np.int32)
            coarse[::COARSE, ::COARSE] = 1
            return coarse
        now = 0 if reached is None else int(reached.min())
        if now >= self.samples:
            return None
        more = min(now, max(8, min(now // 2, 32))) if self.open_ended else 3 * now
        return np.full((film.height, film.width), min(now + max(1, more), self.samples), np.int32)


class Contrast(NamedTuple):
    """More samples where neighbours differ (T. Whitted, CACM 1980; D. Mitchell, SIGGRAPH 1987).

    After `samples` everywhere, pixels take `most` if the contrast with a neighbour is above `threshold`: the contrast
    of two pixels is ``|a - b| / (a + b)`` of their brightest-differing channel (Mitchell's measure), with colours
    clipped to the visible range, so that differences between whites beyond white do not count.
    """

    samples: int
    most: int
    threshold: float

    def next(self, film: Film, reached: np.ndarray | None) -> np.ndarray | None:
        if reached is None or reached.min() < self.samples:
            return Uniform(self.samples).next(film, reached)
        if reached.max() > self.samples or self.most == self.samples:
            return None
        differs = neighbours_differ(film.image(), self.threshold)
        return np.where(differs, self.most, self.samples).astype(np.int32) if differs.any() else None


def filled(image: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """An image (h, w, 3) in which pixels without samples show what the coarse picture has in their place."""
    if counts.all():
        return image
    height, width = counts.shape
    rows, columns = np.arange(height) // COARSE * COARSE, np.arange(width) // COARSE * COARSE
    return np.where((counts > 0)[..., None], image, image[rows[:, None], columns])


def neighbours_differ(image: np.ndarray, threshold: float) -> np.ndarray:
    """Pixels of an image (h, w, 3) whose contrast with one of their four neighbours is above a threshold: (h, w) bool."""
    image = np.clip(image.astype(np.float64), 0.0, 1.0)
    differs = np.zeros(image.shape[:2], bool)
    for a, b in ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[1:, :], np.s_[:-1, :])):
        p, q = image[a], image[b]
        over = (np.abs(p - q) / (p + q + 1e-3) > threshold).any(axis=-1)
        differs[a] |= over
        differs[b] |= over
    return differs
