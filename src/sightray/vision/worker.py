"""A process that makes frames of a dataset for another one: see `vision.crew`."""

from __future__ import annotations

import json
import os
import signal
import sys
from pathlib import Path
from typing import Any


def main() -> None:
    """Read a job and numbers of frames from standard input; answer each with a line of JSON."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the one who started us
    signal.signal(signal.SIGTERM, _leave)
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # whatever is printed must not stand between answers
    worker: Any = None
    job = json.loads(sys.stdin.readline())
    for line in sys.stdin:
        try:
            worker = worker or _prepare(job)
            answer: dict[str, Any] = {"bytes": worker(int(line))}
        except Exception as error:  # whatever it is, it is told there
            from sightray.errors import SightrayError

            told = str(error) if isinstance(error, SightrayError) else f"{type(error).__name__}: {error}"
            answer = {"error": f"frame {int(line)}: {told}"}
        print(json.dumps(answer), file=answers, flush=True)


def _prepare(job: dict[str, Any]) -> Any:
    """A function that makes a frame, and tells how many bytes it has."""
    from sightray.errors import SceneError
    from sightray.vision.dataset import make_frame
    from sightray.vision.recipe import load_recipe
    from sightray.vision.writers.base import known_writers

    recipe = load_recipe(job["recipe"], seed=job["seed"])
    if recipe.files != job["files"]:
        raise SceneError(f"{job['recipe']}: it, or a file that it names, has changed since the start")
    writers = [known_writers()[label](**values) for label, values in job["writers"]]

    def make(frame: int) -> int:
        mark = make_frame(recipe, Path(job["root"]), writers, job["samples"], job["threads"], frame)
        return sum(about["bytes"] for about in mark["files"].values())

    return make


def _leave(*_: Any) -> None:
    """End at once, but remove what is being written."""
    raise SystemExit(143)


if __name__ == "__main__":
    main()
