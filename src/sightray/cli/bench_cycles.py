"""Cycles as a peer of ``sightray bench render``, in a process of its own, by whatever Python has Blender's ``bpy``."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import tempfile
import time
import weakref
from pathlib import Path
from typing import Any

import numpy as np

PYTHON = "SIGHTRAY_PEER_PYTHON"  # names a Python that has bpy, if this one has not
ROUNDS = 5  # of measuring what a picture takes beside its samples
FEW = 4  # samples of the first of two pictures; few, since slow scenes are measured so, too


class Cycles:
    """A process that renders one scene as often as it is asked; it ends when this object does.

    What a picture takes beside its samples, to hand the scene over and to write the file, is `fixed` seconds: what is
    left of n samples when half the time of 2n is taken from it, twice; the median of some rounds.

    Raises RuntimeError where ``bpy`` is not installed, or ends with an error.
    """

    def __init__(self, scene: Any, max_depth: int, threads: int, python: str | None = None):
        from sightray.cli.cycles_scene import write_cycles_scene

        self._folder = tempfile.TemporaryDirectory(prefix="sightray-cycles-")
        written, self._talk = Path(self._folder.name) / "scene.npz", Path(self._folder.name) / "talk.txt"
        write_cycles_scene(scene, max_depth, threads, written)
        program = python or os.environ.get(PYTHON) or sys.executable
        command = [program, str(Path(__file__).with_name("cycles_peer.py")), str(written)]
        with open(self._talk, "w") as talk:
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=talk, text=True
            )  # fmt: skip
        weakref.finalize(self, _end, self._process)
        self.name = f"Cycles {self._answer()['version'].split()[0]}"
        self.render(FEW, 0)
        self.fixed = max(0.0, float(np.median([self._beside_samples() for _ in range(ROUNDS)])))

    def render(self, samples: int, seed: int) -> np.ndarray:
        """A picture, (h, w, 3) float32, linear."""
        import sightray as sr

        path = Path(self._folder.name) / "picture.exr"
        assert self._process.stdin is not None
        print(json.dumps({"samples": samples, "seed": seed, "path": str(path)}), file=self._process.stdin, flush=True)
        self._answer()
        return sr.Image.load(path).pixels[..., :3]

    def _beside_samples(self) -> float:
        start = time.perf_counter()
        self.render(FEW, 0)
        middle = time.perf_counter()
        self.render(2 * FEW, 0)
        return 2 * (middle - start) - (time.perf_counter() - middle)

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            said = self._talk.read_text(errors="replace").strip().splitlines()
            raise RuntimeError(said[-1] if said else "it ended without a word")
        answer: dict[str, Any] = json.loads(line)
        if "absent" in answer:
            raise RuntimeError(f"{answer['absent']} in this Python; name one that has it by {PYTHON}")
        return answer


def _end(process: subprocess.Popen[str]) -> None:
    """Let the process come to its end: it stops when nobody asks any more."""
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with contextlib.suppress(OSError):
                pipe.close()
    process.wait()
