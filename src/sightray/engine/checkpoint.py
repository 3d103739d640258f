"""Checkpoints: a render that was killed goes on where it was, and ends with the same picture."""

from __future__ import annotations

import json
import os
import warnings
import zipfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sightray.errors import FormatError, SceneError
from sightray.film.film import PIXEL_WORDS
from sightray.images.atomic import writing

KIND = "sightray checkpoint 1"
DIGEST = "digest "  # how values begin that say nothing to people


class State(NamedTuple):
    """All that a render needs to go on."""

    pixels: np.ndarray  # of the film, (height, width, PIXEL_WORDS) float64
    marked: np.ndarray  # of the film, (height, width, 2) float64
    target: np.ndarray  # (height, width) int32: samples that each pixel is to have after the present pass
    rays: int
    seconds: float


class Checkpoint:
    """A file with the state of a render.

    Parameters
    ----------
    path : the file. It is written aside and renamed, so that there is always a whole one.
    identity : what the picture depends on, by name, such as ``{"seed": "0"}``; only its like goes on from the file.
    every : seconds of rendering between two states.
    resume : go on from the file if there is one; otherwise an existing file is an error, lest it be lost.

    A state is taken while no sample is, and pixels take their samples in the same order whatever happens between: so
    the resumed picture equals the uninterrupted one to the bit, unless time was what ended it.
    """

    def __init__(self, path: str | os.PathLike, identity: dict[str, str], every: float = 60.0, resume: bool = False):
        self.path, self.identity, self.every, self.resume = Path(path), identity, every, resume
        self._check_place()

    def load(self) -> State | None:
        """The state in the file, or None where there is none to go on from.

        Raises
        ------
        FormatError
            The file is no checkpoint, or damaged.
        SceneError
            It belongs to another render; the message says what is different.
        """
        if not self.resume or not self.path.exists():
            return None
        try:
            with np.load(self.path, allow_pickle=False) as stored:
                kind, identity = str(stored["kind"]), json.loads(str(stored["identity"]))
                arrays = stored["pixels"], stored["marked"], stored["target"]
                state = State(*arrays, int(stored["rays"]), float(stored["seconds"]))
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
            raise FormatError(f"{self.path}: not a checkpoint, or a damaged one: {error}") from None
        if kind != KIND:
            raise FormatError(f"{self.path}: got a file of kind '{kind}'; allowed: '{KIND}'")
        self._compare(identity)
        shape = state.target.shape
        if state.pixels.shape != (*shape, PIXEL_WORDS) or state.marked.shape != (*shape, 2):
            raise FormatError(f"{self.path}: a damaged checkpoint: its arrays do not fit together")
        return state

    def save(self, state: State) -> None:
        """Put a state in the file's place; a disk that is full is a warning, and the render goes on."""
        try:
            with writing(self.path) as aside, open(aside, "wb") as file:
                np.savez(
                    file, kind=np.array(KIND), identity=np.array(json.dumps(self.identity)), pixels=state.pixels,
                    marked=state.marked, target=state.target, rays=np.array(state.rays), seconds=np.array(state.seconds),
                )  # fmt: skip
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            warnings.warn(f"{self.path}: checkpoint not written: {error.strerror or error}", stacklevel=2)

    def _compare(self, found: dict[str, str]) -> None:
        for name, value in self.identity.items():
            if found.get(name) != value:
                was, now = found.get(name), value
                told = "" if was is None or now.startswith(DIGEST) else f": it has {was}, this has {now}"
                raise SceneError(
                    f"{self.path}: checkpoint of another render, with a different {name}{told}; "
                    "render without `resume` into another file, or restore what was changed"
                )

    def _check_place(self) -> None:
        if not self.path.parent.is_dir():
            raise SceneError(f"{self.path}: checkpoint: the folder '{self.path.parent}' does not exist")
        if self.path.exists() and not self.resume:
            raise SceneError(f"{self.path}: checkpoint: the file exists; resume from it, or remove it first")
