"""Progress on a terminal as a bar, elsewhere as plain lines."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Iterator
from typing import Any

from sightray.engine.progress import Callback, Progress

PLAIN_EVERY = 5.0  # seconds between lines where there is no terminal


@contextlib.contextmanager
def showing_progress(quiet: bool = False) -> Iterator[Callback | None]:
    """A callback for `render` that shows on stderr how far it is."""
    if quiet:
        yield None
    elif sys.stderr.isatty():
        with _bar() as callback:
            yield callback
    else:
        yield _Lines()


def describe(progress: Progress) -> str:
    """One moment in words: percentage, rate, time left."""
    if progress.stage == "compile":
        return f"compiling kernels (first time only): {progress.done}/{progress.total} {progress.detail}".rstrip()
    left = f", {_duration(progress.seconds_left)} left" if progress.done < progress.total else ""
    return f"{100 * progress.fraction:.0f} %, {progress.rays_per_second / 1e6:.1f} Mrays/s{left}"


def told(info: dict[str, Any]) -> str:
    """How a render went: time, rate, and if it was not the number of samples that ended it, what there was then."""
    rate = info["rays"] / max(info["seconds"], 1e-9) / 1e6
    words = f"{info['seconds']:.2f} s, {rate:.1f} Mrays/s"
    if info["stopped"] != "samples":
        words += f", {info['samples']:.1f} samples per pixel, relative error {info['error']:.3g}"
    return words


def _duration(seconds: float) -> str:
    if seconds == float("inf"):
        return "?"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{rest:02}" if minutes >= 60 else f"{minutes}:{rest:02}"


class _Lines:
    """Plain lines, at the start, every few seconds, and at the end."""

    def __init__(self) -> None:
        self.last = -1e9
        self.stage = ""

    def __call__(self, progress: Progress) -> None:
        now = time.monotonic()
        ended = progress.done == progress.total
        if progress.stage != self.stage or ended or now - self.last >= PLAIN_EVERY:
            self.last, self.stage = now, progress.stage
            print(describe(progress), file=sys.stderr, flush=True)


@contextlib.contextmanager
def _bar() -> Iterator[Callback]:
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn
    from rich.progress import Progress as RichProgress

    with RichProgress(
        BarColumn(), TextColumn("{task.description}"), console=Console(stderr=True), transient=True
    ) as bars:
        task: Any = bars.add_task("starting", total=None)

        def show(progress: Progress) -> None:
            bars.update(task, total=progress.total, completed=progress.done, description=describe(progress))

        yield show
