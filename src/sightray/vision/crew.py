"""Worker processes that make frames.

Each is a plain process that reads numbers of frames from its standard input and answers with a line for each; so it ends by
itself when the process that started it is gone, however that ended. Frames are given out one at a time.
"""

from __future__ import annotations

import contextlib
import json
import queue
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from sightray.errors import SceneError
from sightray.vision.recipe import Recipe
from sightray.vision.writers.base import Writer

PATIENCE = 5.0  # seconds that a worker has to end when it is told to
POLL = 0.2  # seconds between looks at the keyboard


class Crew:
    """Workers for one dataset."""

    def __init__(self, recipe: Recipe, root: Path, writers: list[Writer], samples: int, workers: int, threads: int):
        self.job = {
            "recipe": str(recipe.path.absolute()), "files": recipe.files, "root": str(root.absolute()),
            "seed": recipe.seed, "samples": samples, "threads": max(1, threads // workers),
            "writers": [[writer.label, _plain(writer)] for writer in writers],
        }  # fmt: skip
        self.workers = workers

    def make(self, frames: list[int]) -> Iterator[int]:
        """Make frames; for each, as it is done, how many bytes it has."""
        waiting: queue.SimpleQueue[int] = queue.SimpleQueue()
        for frame in frames:
            waiting.put(frame)
        answers: queue.SimpleQueue[Any] = queue.SimpleQueue()
        crew = [self._hire() for _ in range(self.workers)]
        for worker in crew:
            threading.Thread(target=_lead, args=(worker, waiting, answers), daemon=True).start()
        try:
            for _ in frames:
                yield _result(answers)
        finally:
            _dismiss(crew)

    def _hire(self) -> subprocess.Popen[str]:
        worker = subprocess.Popen(
            [sys.executable, "-m", "sightray.vision.worker"], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            text=True, encoding="utf-8",
        )  # fmt: skip
        assert worker.stdin is not None
        worker.stdin.write(json.dumps(self.job) + "\n")
        worker.stdin.flush()
        return worker


def _plain(writer: Writer) -> dict[str, Any]:
    return {name: field.plain(getattr(writer, name)) for name, field in writer.given.items()}


def _lead(worker: subprocess.Popen[str], waiting: queue.SimpleQueue[int], answers: queue.SimpleQueue[Any]) -> None:
    """Give a worker one frame after the other, until there is none."""
    assert worker.stdin is not None
    assert worker.stdout is not None
    frame = -1
    try:
        while True:
            frame = waiting.get_nowait()
            worker.stdin.write(f"{frame}\n")
            worker.stdin.flush()
            answers.put(json.loads(worker.stdout.readline()))
    except queue.Empty:
        pass
    except (OSError, ValueError):
        status = worker.wait()
        answers.put({"error": f"dataset: the worker that made frame {frame} ended (status {status}); was it killed, for "
                              "memory perhaps? Frames that are complete stay"})  # fmt: skip


def _result(answers: queue.SimpleQueue[Any]) -> int:
    while True:
        try:
            answer = answers.get(timeout=POLL)
        except queue.Empty:
            continue
        if "error" in answer:
            raise SceneError(answer["error"])
        return int(answer["bytes"])


def _dismiss(crew: list[subprocess.Popen[str]]) -> None:
    """End the workers, those at work too."""
    for worker in crew:
        if worker.poll() is None:
            worker.terminate()
    for worker in crew:
        try:
            worker.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            worker.kill()
            worker.wait()
        for stream in (worker.stdin, worker.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):  # what is left in a pipe to one that was killed
                    stream.close()
