"""`Progress`: what a render tells while it runs."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple


class Progress(NamedTuple):
    """A moment of a render; passed to the `progress` callback from the thread that called `render`."""

    stage: str  # "compile" or "render"
    done: int  # kernels compiled, or pixel samples taken
    total: int
    seconds: float  # since the stage began
    rays: int  # shot so far
    detail: str = ""  # name of the kernel that is being compiled

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


Callback = Callable[[Progress], None]
