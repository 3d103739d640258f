"""Estimated error: of the picture, to know when it is good; of its pixels, to know where it is not."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sightray.engine.schedule import MOST, Uniform
from sightray.film.film import Film, averaged

DARK = 0.1  # share of the mean luminance below which an error counts as if the pixel were that bright
FIRST = 16  # samples of every pixel before an estimate is believed
GROWTH = 1.5  # of the number of all samples from one pass to the next, at most
LEAST = 0.1  # of the mean demand: what no pixel's demand is below, for what its few samples may have missed
WINDOW = 2  # pixels to each side over which variances are averaged


def relative_error(film: Film, error: np.ndarray | None = None) -> float:
    """Relative standard error of a picture: infinite while a pixel has fewer than two samples.

    `error` is what ``film.standard_error()`` gave, if that is at hand.

    The root of the mean over all pixels of ``s² / (l² + (0.1 m)²)``: s is the standard error of a pixel's luminance l,
    and m the mean luminance of the picture, which keeps black pixels from asking for exactness that nobody can see.
    """
    return float(np.sqrt(relative_square(film, film.standard_error() if error is None else error).mean()))


def relative_square(film: Film, error: np.ndarray) -> np.ndarray:
    """The square of each pixel's error over that of the luminance that it is compared with: (h, w) float64."""
    luminance = film.luminance()
    scale = luminance**2 + (DARK * luminance.mean()) ** 2
    return error**2 / np.maximum(scale, 1e-300)


class ErrorDriven(NamedTuple):
    """Samples go where the estimated error is.

    The picture's error is a sum of v / n over pixels, of relative variance v after n samples, and least for a given
    number of samples in all if n is proportional to the root of v (J. Neyman, J. Royal Statistical Society 97, 1934).
    Each pass moves the numbers towards that, until the error is `target` or the mean number of samples is `samples`.

    That a pixel's own samples decide how many it gets makes it err to one side: those that missed what is bright stop
    early (D. Kirk, J. Arvo, "Unbiased sampling techniques for image synthesis", SIGGRAPH 1991). To keep that below the
    noise, variances are averaged over 5 by 5 pixels, and no pixel's share is below a tenth of the mean.
    """

    samples: int = MOST
    target: float | None = None
    most: int = MOST

    def next(self, film: Film, reached: np.ndarray | None) -> np.ndarray | None:
        first = min(FIRST, self.samples)
        if reached is None or reached.min() < first:
            return Uniform(first, open_ended=True).next(film, reached)
        if first < 2:  # a single sample tells nothing of its error
            return None
        pixels = reached.size
        so_far = int(reached.sum(dtype=np.int64))
        wanted = min(GROWTH * so_far, float(self.samples) * pixels)
        demand = root_of_demand(film)
        if self.target is not None:
            wanted = min(wanted, max(so_far + pixels, (demand.mean() / self.target) ** 2 * pixels))
        after = np.minimum(allotted(demand, reached, wanted), self.most).astype(np.int32)
        return after if (after > reached).any() else None


def root_of_demand(film: Film) -> np.ndarray:
    """What the number of samples of each pixel should be proportional to: (height, width) float64."""
    demand = np.sqrt(averaged(relative_square(film, film.standard_error()) * np.maximum(film.counts(), 1), WINDOW))
    return np.maximum(demand, LEAST * demand.mean())


def allotted(demand: np.ndarray, reached: np.ndarray, wanted: float) -> np.ndarray:
    """Numbers proportional to `demand`, but not below `reached`, whose sum is about `wanted`: (height, width) float64."""
    low, high = 0.0, wanted / max(float(demand.sum()), 1e-300) * 2
    while np.maximum(reached, high * demand).sum() < wanted and high < 1e300:
        high *= 2
    for _ in range(30):
        middle = 0.5 * (low + high)
        if np.maximum(reached, middle * demand).sum() < wanted:
            low = middle
        else:
            high = middle
    return np.floor(np.maximum(reached, high * demand) + 0.5)
