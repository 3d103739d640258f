"""Run an integrator over a picture: tiles on all cores, progress, interruption, adaptive passes."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from itertools import islice
from typing import Any, NamedTuple

import numpy as np

from sightray import _jit
from sightray.engine.pixels import render_tile
from sightray.engine.progress import Callback, Progress
from sightray.film.film import Film
from sightray.filters.table import filter_table
from sightray.mathlib.table import NULL, Space, Table, aligned
from sightray.scene.compile import Compiled, require_camera

TILE = 32  # pixels; a tile of a simple scene takes a few milliseconds
POLL = 0.1  # seconds between progress reports and looks at the keyboard


class Pass(NamedTuple):
    """One sweep over the picture: samples first ... first + samples, or as many as `plan` says for each pixel."""

    first: int
    samples: int
    plan: np.ndarray | None  # (height, width) int32

    def total(self, pixels: int) -> int:
        return self.samples * pixels if self.plan is None else int(self.plan.sum())


class Outcome(NamedTuple):
    """What a run leaves behind."""

    film: Film
    rays: int
    seconds: float
    complete: bool


def run(
    compiled: Compiled, integrator: Any, sampler: Any, filter: Any, *, samples: int, seed: int,
    threads: int | None = None, progress: Callback | None = None,
    refine: Callable[[Film], np.ndarray | None] | None = None,
) -> Outcome:  # fmt: skip
    """Render a compiled scene.

    `refine` is asked after the first pass for the number of additional samples of each pixel, (height, width) int32.
    A `KeyboardInterrupt` ends the run within a tile's pixel; the outcome then holds what there is.
    """
    camera = require_camera(compiled.scene)
    compiled.tables.row_of(integrator)
    compiled.tables.row_of(sampler)
    began = time.perf_counter()

    def compiling(done: int, total: int, name: str) -> None:
        if progress is not None:
            progress(Progress("compile", done, total, time.perf_counter() - began, 0, name))

    compiled.tables.prepare(render_tile, compiling)
    job = _Job(compiled, integrator, sampler, Film(camera.width, camera.height), filter, seed, threads, progress)
    try:
        job.sweep(Pass(0, samples, None))
        plan = None if refine is None else refine(job.film)
        if plan is not None and plan.any():
            job.sweep(Pass(samples, 0, plan))
        complete = True
    except KeyboardInterrupt:
        complete = False
    return Outcome(job.film, job.rays, time.perf_counter() - job.began, complete)


def thread_count(threads: int | None) -> int:
    """Threads to use: those asked for, or one for every core that this process may run on."""
    if threads is not None:
        return threads
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class _Job:
    """State of a run that its threads share."""

    def __init__(self, compiled: Compiled, integrator: Any, sampler: Any, film: Film, filter: Any,
                 seed: int, threads: int | None, progress: Callback | None):  # fmt: skip
        self.film, self.seed, self.progress = film, seed, progress
        self.world, self.integrator = compiled.world, compiled.tables.row_of(integrator)
        self.sampler = compiled.tables.row_of(sampler)
        self.space = Space()
        self.filter, self.stop = filter_table(filter, self.space), self.space.array(aligned(8, np.int64))
        self.threads = thread_count(threads)
        self.kernel = _jit.native(render_tile)
        self.rays = self.done = self.total = 0
        self.began = time.perf_counter()

    def sweep(self, this: Pass) -> None:
        """Take the samples of one pass."""
        self.total += this.total(self.film.width * self.film.height)
        plan = NULL if this.plan is None else Table(np.ascontiguousarray(this.plan, np.int32))
        queue = self._tiles()
        with ThreadPoolExecutor(self.threads) as pool:
            try:
                running = {pool.submit(self._tile, this, plan, tile) for tile in islice(queue, 2 * self.threads)}
                while running:
                    finished, running = wait(running, POLL, FIRST_COMPLETED)
                    for future in finished:
                        self._account(future)
                        running |= {pool.submit(self._tile, this, plan, tile) for tile in [next(queue, None)] if tile}
                    self._report()
            except BaseException:
                self.stop.view(np.int64)[0] = 1
                raise

    def _tiles(self) -> Iterator[tuple[int, int, int, int]]:
        for y in range(0, self.film.height, TILE):
            for x in range(0, self.film.width, TILE):
                yield x, y, min(x + TILE, self.film.width), min(y + TILE, self.film.height)

    def _tile(self, this: Pass, plan: Table, tile: tuple[int, int, int, int]) -> tuple[int, int]:
        x0, y0, x1, y1 = tile
        taken = (x1 - x0) * (y1 - y0) * this.samples if this.plan is None else int(this.plan[y0:y1, x0:x1].sum())
        rays = self.kernel(
            self.world, self.integrator, self.sampler, self.film.table, self.filter, plan, self.stop,
            x0, y0, x1, y1, self.film.width, this.first, this.samples, self.seed,
        )  # fmt: skip
        return taken, rays

    def _account(self, future: Future) -> None:
        taken, rays = future.result()
        self.done += taken
        self.rays += rays

    def _report(self) -> None:
        if self.progress is not None:
            self.progress(Progress("render", self.done, self.total, time.perf_counter() - self.began, self.rays))
