"""The contract of dataset writers, and how their files are made.

A writer is asked for by its `label`. Of every picture, a `Shot`, it writes the files that belong to that alone, and
returns a *note*: all that the files about the whole dataset need to know of the picture, ready for JSON. When all
pictures are done, `finish` makes those files from the notes, which come in order of frame and camera whatever the
order in which pictures were made. So a dataset can be made by several workers, and resumed after a kill.

Files are written aside and renamed: each is whole or not there. Each writer's docstring states its axes, its units, and
where the centre of the top-left pixel is: at (0.5, 0.5) in Sightray.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar

from sightray.errors import SceneError, unknown
from sightray.images.atomic import writing
from sightray.registry import Member, members
from sightray.vision.shot import Shot

Note = dict[str, Any]


class Output:
    """A folder to write in; it knows the files that were written, with their SHA-256 and length in bytes."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.files: dict[str, dict[str, Any]] = {}

    @contextmanager
    def path(self, name: str) -> Iterator[Path]:
        """For libraries that want a path: write there, and it becomes `name` when the block succeeds."""
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        with writing(path) as aside:
            yield aside
            digest = hashlib.sha256()
            with open(aside, "rb") as file:
                while part := file.read(1 << 20):
                    digest.update(part)
            self.files[name] = {"sha256": digest.hexdigest(), "bytes": aside.stat().st_size}

    def binary(self, name: str, data: bytes) -> None:
        """Write a file."""
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        with writing(path) as aside:
            aside.write_bytes(data)
        self._know(name, data)

    def text(self, name: str, text: str) -> None:
        """Write a file of text; lines end with a line feed on every system."""
        self.binary(name, text.encode("utf-8"))

    def json(self, name: str, value: Any) -> None:
        """Write a file of JSON."""
        self.text(name, json.dumps(value, indent=1) + "\n")

    def json_parts(self, name: str, lists: dict[str, Iterable[Any]]) -> None:
        """Write a JSON file of lists that are made as they are written, an entry to a line: none is in memory whole."""
        with self.path(name) as aside, open(aside, "w", encoding="utf-8", newline="\n") as file:
            for k, (key, entries) in enumerate(lists.items()):
                file.write(f"{',' if k else '{'}\n{json.dumps(key)}: [")
                for number, entry in enumerate(entries):
                    file.write(f"{',' if number else ''}\n{json.dumps(entry)}")
                file.write("\n]")
            file.write("\n}\n")

    def _know(self, name: str, data: bytes) -> None:
        self.files[name] = {"sha256": hashlib.sha256(data).hexdigest(), "bytes": len(data)}


class Writer(Member, family="vision.writers"):
    """Base of all dataset writers."""

    label: ClassVar[str] = ""
    layers: ClassVar[tuple[str, ...]] = ()  # label layers that it reads
    next_layers: ClassVar[tuple[str, ...]] = ()  # those that it reads, too, where there is a next picture
    stereo_layers: ClassVar[tuple[str, ...]] = ()  # ... where there is the other camera of a rectified pair
    bytes_per_pixel: ClassVar[float] = 3.0  # about, for an estimate of the room that is needed

    def accept(self, shot: Shot) -> None:
        """Raise a `SceneError` if the format cannot state this picture; asked before any is made, and for each."""

    def write(self, out: Output, shot: Shot) -> Note:
        """Write the files of one picture; its note."""
        raise NotImplementedError(f"{type(self).__name__} does not say how it writes")

    def finish(self, out: Output, notes: Iterable[Note]) -> None:
        """Write the files about all pictures. `notes` can be gone through more than once."""

    def wanted(self, following: bool, stereo: bool) -> tuple[str, ...]:
        """The layers that it reads of a picture with a next one, or with a partner in stereo."""
        return self.layers + (self.next_layers if following else ()) + (self.stereo_layers if stereo else ())

    @classmethod
    def summary(cls) -> str:
        """The first sentence about the format."""
        return " ".join((cls.__doc__ or "").split("\n\n")[0].split())


def known_writers() -> dict[str, type[Writer]]:
    """All writers by label."""
    found: dict[str, Any] = {cls.label: cls for cls in members("vision.writers").values()}  # type: ignore[attr-defined]
    return found


def as_writer(value: Any) -> Writer:
    """A writer from its label, or as it is."""
    if isinstance(value, Writer):
        return value
    known = known_writers()
    if not isinstance(value, str) or value not in known:
        if isinstance(value, str):
            raise SceneError(f"dataset: {unknown('format', value, known)}")
        raise SceneError(f"dataset: format: got {value!r}; allowed: names of formats, or writers such as BopWriter()")
    return known[value]()


def sequences(notes: Iterable[Note]) -> Iterator[tuple[int, list[Note]]]:
    """The notes of each sequence."""
    found: dict[int, list[Note]] = {}
    for note in notes:
        found.setdefault(note["sequence"], []).append(note)
    yield from sorted(found.items())
