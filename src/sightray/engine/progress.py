"""`Progress`: what a render tells while it runs."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from sightray.images import Image


class Progress(NamedTuple):
    """A moment of a render; passed to the `progress` callback from the thread that called `render`."""

    stage: str  # "compile" or "render"
    done: int  # kernels compiled, or pixel samples taken
    total: int  # of these; an estimate where time or an error is to end the render
    seconds: float  # since the stage began
    rays: int  # shot so far
    detail: str = ""  # name of the kernel that is being compiled
    picture: Callable[[], Image] | None = None  # behind `image`

    @property
    def fraction(self) -> float:
        """Share that is done, 0 to 1."""
        return self.done / self.total if self.total else 1.0

    @property
    def rays_per_second(self) -> float:
        """Rate so far."""
        return self.rays / self.seconds if self.seconds > 0 else 0.0

    @property
    def seconds_left(self) -> float:
        """Time left at the rate so far; infinite at the very start."""
        return self.seconds * (1 - self.fraction) / self.fraction if self.fraction > 0 else float("inf")

    def image(self) -> Image | None:
        """The picture as it is now, made when asked for; None while kernels are compiled.

        The first sample of every pixel is taken before the second of any; in large pictures that of every fourth pixel
        of every fourth row comes first, and its neighbours show its colour until they have one. Pixels that are worked
        on at this moment may be off by a part of their last sample.
        """
        return None if self.picture is None else self.picture()


Callback = Callable[[Progress], None]
