"""Run an integrator over a picture: passes of tiles on all cores, until a limit is reached or somebody interrupts."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import Any, NamedTuple

import numpy as np

from sightray import _jit
from sightray.engine.adaptive import relative_error
from sightray.engine.batches import render_tile_in_batches
from sightray.engine.checkpoint import Checkpoint, State
from sightray.engine.pixels import render_tile, render_tile_in_groups
from sightray.engine.progress import Callback, Progress
from sightray.engine.schedule import MOST, Schedule, Uniform, filled
from sightray.film.film import Film
from sightray.filters.table import filter_table
from sightray.images import Image
from sightray.integrators.base import radiance_of_batch
from sightray.mathlib.cores import core_count
from sightray.mathlib.table import Space, Table, aligned
from sightray.scene.compile import Compiled, require_camera

TILE = 32  # pixels; a tile of a simple scene takes a few milliseconds
# Where integrators want pixels together, edges of tiles cut them apart. So tiles are wide, and lie elsewhere in each pass
# and every time that all pixels have taken so many samples: no edge stays where it could be seen.
WIDE_TILE, AT_ONCE = 48, 8
LONG = 8  # samples of a pixel, from which on it is worth while to cut the last tiles
POLL = 0.1  # seconds between progress reports and looks at the keyboard


Tile = tuple[int, int, int, int]  # left, top, right and bottom


class Limits(NamedTuple):
    """What ends a render beside its schedule."""

    time: float | None = None  # seconds of rendering
    error: float | None = None  # relative standard error, see `engine.adaptive.relative_error`


class Outcome(NamedTuple):
    """What a run leaves behind."""

    film: Film
    rays: int
    seconds: float
    stopped: str  # why: "samples", "time", "target_error" or "interrupted"

    @property
    def complete(self) -> bool:
        """Whether nobody interrupted."""
        return self.stopped != "interrupted"

    def facts(self) -> dict[str, Any]:
        """What there is to say of it, as in `Image.info`."""
        counts, error = self.film.counts(), self.film.standard_error()
        return {
            "samples": float(counts.mean()), "rays": self.rays, "seconds": self.seconds, "stopped": self.stopped,
            "complete": self.complete, "sample_count": counts, "standard_error": error,
            "error": relative_error(self.film, error), "invalid_samples": self.film.invalid(),
        }  # fmt: skip


def run(
    compiled: Compiled, integrator: Any, sampler: Any, filter: Any, *, samples: int = 0, seed: int = 0,
    schedule: Schedule | None = None, limits: Limits | None = None, threads: int | None = None,
    progress: Callback | None = None, checkpoint: Checkpoint | None = None,
) -> Outcome:  # fmt: skip
    """Render a compiled scene.

    `schedule` decides where samples are taken, by default `samples` in each pixel; `samples` is what samplers are told
    to expect, or 0 where that is not known. The first sweep over the picture is always finished, whatever the limits.
    A `KeyboardInterrupt` ends the run within a sample; the outcome then holds what there is.
    """
    camera = require_camera(compiled.scene)
    integrator = integrator.for_batches(compiled) or integrator
    compiled.tables.row_of(integrator)
    compiled.tables.row_of(sampler)
    began = time.perf_counter()

    def compiling(done: int, total: int, name: str) -> None:
        if progress is not None:
            progress(Progress("compile", done, total, time.perf_counter() - began, 0, name))

    compiled.tables.prepare(_root(integrator), compiling)
    film = Film(camera.width, camera.height)
    job = _Job(
        compiled, integrator, sampler, filter, film, samples, seed, limits or Limits(), threads, progress, checkpoint
    )
    try:
        stopped = job.passes(schedule or Uniform(samples))
        job.report(at_the_end=True)
    except KeyboardInterrupt:
        stopped = "interrupted"
    finally:
        job.keep()
        job.pool.shutdown()
    return Outcome(film, job.rays, job.seconds(), stopped)


def _root(integrator: Any) -> Any:
    """The kernel that takes samples as an integrator wants them."""
    if radiance_of_batch in type(integrator).kernels:
        return render_tile_in_batches
    return render_tile if integrator.together == 1 else render_tile_in_groups


def quarters(tile: Tile) -> list[Tile]:
    """A tile cut in four, or less if it is that small."""
    x0, y0, x1, y1 = tile
    x, y = (x0 + x1) // 2, (y0 + y1) // 2
    parts = [(x0, y0, x, y), (x, y0, x1, y), (x0, y, x, y1), (x, y, x1, y1)]
    return [part for part in parts if part[0] < part[2] and part[1] < part[3]]


def thread_count(threads: int | None) -> int:
    """Threads to use: those asked for, or one for every core that this process may run on."""
    return core_count() if threads is None else threads


class _Job:
    """State of a run that its threads share."""

    def __init__(self, compiled: Compiled, integrator: Any, sampler: Any, filter: Any, film: Film, expected: int,
                 seed: int, limits: Limits, threads: int | None, progress: Callback | None,
                 checkpoint: Checkpoint | None):  # fmt: skip
        self.film, self.limits, self.progress, self.checkpoint = film, limits, progress, checkpoint
        self.transfer = compiled.scene.transfer
        self.space = Space()
        self.stop = self.space.array(aligned(8, np.int64))
        rows = compiled.world, compiled.tables.row_of(integrator), compiled.tables.row_of(sampler)
        self.rows = (*rows, film.table, filter_table(filter, self.space))
        self.together = integrator.together > 1
        self.options = (expected, int(expected == 1), seed, *((integrator.together,) if self.together else ()))
        self.threads = thread_count(threads)
        self.pool = ThreadPoolExecutor(self.threads)
        self.kernel = _jit.native(_root(integrator))
        self.target: np.ndarray | None = None
        self.rays = self.done = self.total = 0
        self.earlier = 0.0  # seconds that went into the checkpoint
        if checkpoint is not None and (state := checkpoint.load()) is not None:
            film.pixels[...], film.marked[...], self.target, self.rays, self.earlier = state
            self.done = int(film.taken().sum())
        self.began = time.perf_counter()
        self.saved = self.began

    def seconds(self) -> float:
        """Seconds of rendering, those before a checkpoint included."""
        return self.earlier + time.perf_counter() - self.began

    def passes(self, schedule: Schedule) -> str:
        """Sweep over the picture until something says stop: what."""
        target = schedule.next(self.film, None) if self.target is None else self.target
        error = math.inf
        while target is not None:
            self.target = target
            self.total = self._expect(schedule, target, error)
            until = math.inf if self.limits.time is None or target.max() <= 1 else self.limits.time
            if not self.sweep(target, until):
                return "time"
            if self.limits.error is not None:
                error = relative_error(self.film)
                if error <= self.limits.error:
                    return "target_error"
            if self.limits.time is not None and self.seconds() >= self.limits.time and target.min() > 0:
                return "time"
            target = schedule.next(self.film, target)
            if target is not None:
                self.film.mark()
        return "samples"

    def _expect(self, schedule: Schedule, target: np.ndarray, error: float) -> int:
        """How many pixel samples there will be, as far as the schedule and the error so far tell."""
        total = int(target.sum(dtype=np.int64))
        if schedule.samples < MOST:
            total = max(total, schedule.samples * target.size)
        if self.limits.error is not None and math.isfinite(error):
            needed = int(self.done * (error / self.limits.error) ** 2)
            total = needed if schedule.samples == MOST else min(total, needed)
        return total

    def sweep(self, target: np.ndarray, until: float) -> bool:
        """Take samples until all pixels have as many as `target` says; False if the time `until` came first."""
        if not self.together:
            return self._cover(target, until, (0, 0))
        left, even = 1, target.min() == target.max()
        while left > 0:
            # What is next follows from what there is, so that a render can be taken up anywhere.
            most = int((target - self.film.taken()).max(initial=0))
            left = max(0, most - 1) // AT_ONCE * AT_ONCE if even else 0
            offset = np.random.default_rng((int(target.sum(dtype=np.int64)), left)).integers(0, WIDE_TILE, 2)
            if not self._cover(target - left, until, (int(offset[0]), int(offset[1]))):
                return False
        return True

    def _cover(self, target: np.ndarray, until: float, offset: tuple[int, int]) -> bool:
        """`sweep` with tiles that lie by `offset` pixels to the upper left."""
        table = Table(np.ascontiguousarray(target, np.int32))
        while True:
            self.stop.view(np.int64)[0] = 0
            queue = iter(self._shortest_last(list(self._tiles(*offset)), target))
            running: set[Future] = set()
            try:
                due = self._run(queue, running, table, until)
            finally:
                self._drain(running)
            if not due:
                return True
            if self.seconds() >= until:
                return False
            self.keep()

    def _run(self, queue: Iterator, running: set[Future], table: Table, until: float) -> bool:
        """Keep all threads at work on tiles; True if there is something else to do before the last is finished."""
        for tile in queue:
            running.add(self.pool.submit(self._tile, table, tile))
            while len(running) >= 2 * self.threads:
                self._wait(running, until)
                if self._is_due(until):
                    return True
        while running:
            self._wait(running, until)
            if running and self._is_due(until):
                return True
        return False

    def _is_due(self, until: float) -> bool:
        """Whether time is up, or a checkpoint is to be written."""
        if self.seconds() >= until:
            return True
        return self.checkpoint is not None and time.perf_counter() - self.saved >= self.checkpoint.every

    def _wait(self, running: set[Future], until: float) -> None:
        """Wait for a tile, but not for long; tell how far things are."""
        finished, _ = wait(running, max(0.0, min(POLL, until - self.seconds())), FIRST_COMPLETED)
        self._account(finished, running)
        self.report()

    def report(self, at_the_end: bool = False) -> None:
        """Tell how far things are."""
        if self.progress is None:
            return
        seconds, total = self.seconds(), max(self.done, self.total)
        if self.limits.time is not None:  # which comes first?
            by_then = int(self.done * max(1.0, self.limits.time / max(seconds, 1e-9)))
            total = by_then if self.total == 0 else min(total, by_then)
        self.progress(Progress("render", self.done, self.done if at_the_end else total, seconds, self.rays,
                               picture=self._picture))  # fmt: skip

    def _drain(self, running: set[Future]) -> None:
        """End all tiles that run, each after its present sample, so that the film is at rest."""
        if running:
            self.stop.view(np.int64)[0] = 1
            self._account(wait(running).done, running)

    def _account(self, finished: set[Future], running: set[Future]) -> None:
        for future in finished:
            running.discard(future)
            taken, rays = future.result()
            self.done += taken
            self.rays += rays

    def _shortest_last(self, tiles: list[Tile], target: np.ndarray) -> list[Tile]:
        """Tiles in an order in which no thread has to wait long for another at the end.

        Where samples are uneven, those with most to do come first. The last ones are cut in four, unless pixels are to stay
        together.
        """
        missing = target - self.film.taken()
        if missing.min() != missing.max():
            work = [missing[y0:y1, x0:x1].sum() for x0, y0, x1, y1 in tiles]
            tiles = [tiles[k] for k in np.argsort(work, kind="stable")[::-1]]
        if self.together or self.threads == 1 or missing.max() < LONG:
            return tiles
        last = 2 * self.threads
        return tiles[:-last] + [part for tile in tiles[-last:] for part in quarters(tile)]

    def _tiles(self, left: int, up: int) -> Iterator[Tile]:
        side = WIDE_TILE if self.together else TILE
        for y in range(-up, self.film.height, side):
            for x in range(-left, self.film.width, side):
                yield max(x, 0), max(y, 0), min(x + side, self.film.width), min(y + side, self.film.height)

    def _tile(self, table: Table, tile: Tile) -> tuple[int, int]:
        before = self.film.taken_in(*tile)
        rays = self.kernel(*self.rows, table, self.stop, *tile, self.film.width, *self.options)
        return self.film.taken_in(*tile) - before, rays

    def _picture(self) -> Image:
        seen = self.film.taken()  # before the image: what comes in between counts as not there yet
        return Image(filled(self.film.image(), seen), transfer=self.transfer)

    def keep(self) -> None:
        """Write the checkpoint, if one is wanted."""
        if self.checkpoint is not None and self.target is not None:
            self.checkpoint.save(State(self.film.pixels, self.film.marked, self.target, self.rays, self.seconds()))
            self.saved = time.perf_counter()
