"""What is done of a dataset: a mark for each frame, written when all of its files are there.

A frame without a mark does not exist, so a kill at any moment loses the frames that were being made and nothing else. A
mark holds the notes of the writers, and length and hash of each file; the files about the whole dataset are made from
marks alone.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from itertools import groupby
from pathlib import Path
from typing import Any

from sightray.images.atomic import writing
from sightray.vision.shot import Shot
from sightray.vision.writers.base import Note, Output, Writer, as_writer

FOLDER = "frames"  # of the marks
Mark = dict[str, Any]


def mark_path(root: Path, frame: int) -> Path:
    """Where the mark of a frame is."""
    return root / FOLDER / f"{frame:06}.json"


def read_mark(root: Path, frame: int) -> Mark | None:
    """The mark of a frame; None if it is not done: no mark, or a file that is not there in its length."""
    try:
        mark: Mark = json.loads(mark_path(root, frame).read_text(encoding="utf-8"))
        whole = all((root / name).stat().st_size == about["bytes"] for name, about in mark["files"].items())
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return mark if whole else None


def write_frame(root: Path, shots: list[Shot], writers: Iterable[Writer], extra: Mark | None = None) -> Mark:
    """Write all pictures of one frame in all formats, then its mark."""
    frame = shots[0].frame
    files: dict[str, Any] = {}
    notes: dict[str, list[Note]] = {}
    for writer in writers:
        out = Output(root / writer.label)
        for shot in shots:
            writer.accept(shot)
        notes[writer.label] = [writer.write(out, shot) for shot in shots]
        files |= {f"{writer.label}/{name}": about for name, about in out.files.items()}
    mark = {"frame": frame, **(extra or {}), "files": files, "notes": notes}
    path = mark_path(root, frame)
    path.parent.mkdir(parents=True, exist_ok=True)
    with writing(path) as aside:
        aside.write_text(json.dumps(mark), encoding="utf-8")
    return mark


class Notes:
    """The notes of one writer, in order, read from the marks each time that they are gone through."""

    def __init__(self, root: Path, frames: Iterable[int], label: str):
        self.root, self.frames, self.label = root, list(frames), label

    def __iter__(self) -> Iterator[Note]:
        for frame in self.frames:
            yield from json.loads(mark_path(self.root, frame).read_text(encoding="utf-8"))["notes"][self.label]


def finish(root: Path, frames: Iterable[int], writers: Iterable[Writer]) -> dict[str, Any]:
    """Write the files about the whole dataset; length and hash of each."""
    frames = list(frames)
    files: dict[str, Any] = {}
    for writer in writers:
        out = Output(root / writer.label)
        writer.finish(out, Notes(root, frames, writer.label))
        files |= {f"{writer.label}/{name}": about for name, about in out.files.items()}
    return files


def write_shots(shots: Iterable[Shot], folder: str | Path, *formats: str | Writer) -> Path:
    """Write pictures and labels that were made elsewhere as a dataset: a folder in `folder` for each format.

    Parameters
    ----------
    shots : in order of frame; those of one frame one after the other.
    folder : made if it is not there.
    *formats : names such as "coco", or writers such as ``BopWriter(depth_scale=1)``.

    Raises
    ------
    SceneError
        If a format cannot state a picture; the message says why.
    """
    root, writers, frames = Path(folder), [as_writer(one) for one in formats], []
    for frame, group in groupby(shots, lambda shot: shot.frame):
        write_frame(root, list(group), writers)
        frames.append(frame)
    finish(root, frames, writers)
    return root
