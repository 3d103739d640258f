"""Datasets from recipes: frames by several workers, whole or not at all, to be gone on with after a kill."""

from __future__ import annotations

import hashlib
import json
import shutil
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sightray.engine.run import thread_count
from sightray.errors import SceneError
from sightray.images.atomic import writing
from sightray.vision.marks import FOLDER, Mark, finish, mark_path, read_mark, write_frame
from sightray.vision.photograph import photograph
from sightray.vision.recipe import Recipe, load_recipe
from sightray.vision.save import check_folder
from sightray.vision.writers.base import Writer, as_writer

MANIFEST = "manifest.json"
SPARE = 1.05  # by which the room must exceed what was measured
ASIDE = ".sightray-*"  # names of files that are being written
SENSORS = "sensors"  # the format of what sensors deliver, which recipes with sensors always have
VERSION = 1  # of the marks and the manifest


class Making(NamedTuple):
    """A moment of the making of a dataset."""

    done: int  # frames that are complete, those of earlier runs among them
    total: int
    fresh: int  # frames that this run made
    seconds: float  # since it began
    bytes: int  # that this run wrote

    @property
    def per_minute(self) -> float:
        """Frames made in a minute."""
        return 60 * self.fresh / self.seconds if self.seconds > 0 else 0.0

    @property
    def seconds_left(self) -> float:
        """At the rate so far; infinite before the first frame is done."""
        return self.seconds * (self.total - self.done) / self.fresh if self.fresh else float("inf")


def make_dataset(
    recipe: str | Path | Recipe, folder: str | Path, *, frames: int | None = None,
    formats: Sequence[str | Writer] | None = None, workers: int = 1, samples: int | None = None,
    seed: int | None = None, threads: int | None = None, progress: Callable[[Making], None] | None = None,
) -> Path:  # fmt: skip
    """Make a dataset, or go on with one: only frames that are not there are made.

    Each frame depends on the recipe, the seed and its number alone, so the files are the same, bit for bit, for any
    number of workers and threads, and after any interruption. A folder takes frames of one recipe, seed, number of
    samples and list of formats only.

    Parameters
    ----------
    recipe : path of a YAML file (see docs/datasets.md), or a `Recipe`.
    folder : made if it is not there. A folder in it for each format; ``frames/``, what is done; ``manifest.json``,
        what it was made from, with the SHA-256 of everything.
    frames : how many; by default as the recipe says.
    formats : names such as "coco", or writers such as ``BopWriter(depth_scale=1)``; by default as the recipe says.
    workers : processes; 1 for this one alone. Writers and members that a program defines itself need 1.
    samples : of each pixel; 0 for labels without pictures. By default as the recipe says, or 64.
    seed : by default as the recipe says, or 0.
    threads : of all workers together; by default one for every core.
    progress : called at the start and after each frame.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    SceneError, FormatError
        A wrong recipe or option; a folder that cannot be written, is too small, or holds another dataset. All of that
        is found out before pictures are made, or after the first one.
    """
    if not isinstance(recipe, Recipe):
        recipe = load_recipe(recipe, seed=seed)
    samples = recipe.samples if samples is None else _whole("samples", samples, 0, 1 << 20)
    total = recipe.frames if frames is None else _whole("frames", frames, 1, 10**9)
    workers = _whole("workers", workers, 1, 1024)
    writers = [as_writer(one) for one in (recipe.formats if formats is None else formats)]
    if recipe.sensed and not any(writer.label == SENSORS for writer in writers):
        writers.append(as_writer(SENSORS))
    root = check_folder(Path(folder))
    _check_recipe(recipe, writers)
    strange = [type(writer).__name__ for writer in writers if not type(writer).__module__.startswith("sightray.")]
    if workers > 1 and strange:
        raise SceneError(
            f"dataset: workers: got {workers} with {strange[0]}, which other processes do not know; allowed: 1"
        )
    with _locked(root):
        _remove_strays(root)
        identity = _identity(recipe, writers, samples)
        _check_same(root, identity)
        pending = [k for k in range(total) if read_mark(root, k) is None]
        if pending:
            size = _rehearse(recipe, writers, pending[0], samples)
            check_room(root, len(pending) * size, "about")
            _write_manifest(root, {**identity, "complete": False})
        _make(recipe, root, writers, samples, pending, total, workers, thread_count(threads), progress)
        if not pending and _is_complete(root, identity, total):
            return root
        _complete(root, identity, total, writers)
    return root


def _whole(name: str, value: Any, low: int, high: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not low <= value <= high:
        raise SceneError(f"dataset: {name}: got {value!r}; allowed: a whole number from {low} to {high}")
    return int(value)


# ------------------------------------------------------------------------------------------------------ before it begins


def _check_recipe(recipe: Recipe, writers: list[Writer]) -> None:
    if not writers:
        raise SceneError("dataset: formats: none; allowed: at least one")
    if len({writer.label for writer in writers}) < len(writers):
        raise SceneError("dataset: formats: one is there twice; allowed: each once")
    sizes = recipe.random_sizes()
    if sizes and any(writer.label == "bop" for writer in writers):
        raise SceneError(
            f"dataset: bop needs bodies that are the same in all pictures; place: '{sizes[0]}' has a random size or shape. "
            "Give it one size, or leave out bop"
        )


def _identity(recipe: Recipe, writers: list[Writer], samples: int) -> dict[str, Any]:
    """What all frames of a folder share."""
    return {
        "dataset": VERSION, "sightray": metadata.version("sightray"), "numpy": np.__version__, "recipe": recipe.files,
        "seed": recipe.seed, "samples": samples, "formats": {writer.label: repr(writer) for writer in writers},
    }  # fmt: skip


def _check_same(root: Path, identity: dict[str, Any]) -> None:
    """Refuse a folder with frames of something else."""
    try:
        found = json.loads((root / MANIFEST).read_text(encoding="utf-8"))
    except FileNotFoundError:
        if (root / FOLDER).exists() and any((root / FOLDER).iterdir()):
            raise SceneError(f"{root}: has frames but no {MANIFEST}; choose another folder") from None
        return
    except (OSError, ValueError) as error:
        raise SceneError(f"{root / MANIFEST}: not readable: {error}; choose another folder") from None
    for key, value in identity.items():
        if found.get(key) != value:
            raise SceneError(
                f"{root}: holds a dataset of another {key} ({_short(found.get(key))}, now {_short(value)}); choose another "
                "folder"
            )


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) < 120 else text[:117] + "..."


def _rehearse(recipe: Recipe, writers: list[Writer], frame: int, samples: int) -> float:
    """Label one frame without its picture, and ask all writers; about how many bytes a frame will take."""
    size = 0.0
    for shot in photograph(recipe.take(frame), writers, 0):
        for writer in writers:
            writer.accept(shot)
            size += writer.bytes_per_pixel * shot.labels.width * shot.labels.height
    return size


def check_room(root: Path, needed: float, how: str) -> None:
    """Refuse what the disk has no room for."""
    free = shutil.disk_usage(root).free
    if needed > free:
        raise SceneError(f"{root}: the frames need {how} {needed / 1e9:.2f} GB more, but {free / 1e9:.2f} GB are free")


@contextmanager
def _locked(root: Path) -> Iterator[None]:
    """Keep a second run off the folder, where the system can; a lock ends with its process, however that ends."""
    try:
        import fcntl
    except ImportError:  # not on Windows
        yield
        return
    with open(root / ".lock", "w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise SceneError(f"{root}: another run is making this dataset; wait for it, or end it") from None
        yield


def _remove_strays(root: Path) -> None:
    """Remove what a killed run was writing."""
    for path in root.rglob(ASIDE):
        path.unlink(missing_ok=True)


# ---------------------------------------------------------------------------------------------------------------- making


def make_frame(
    recipe: Recipe, root: Path, writers: list[Writer], samples: int, threads: int | None, frame: int
) -> Mark:
    """Make and write one frame."""
    take = recipe.take(frame)
    shots = photograph(take, writers, samples, threads)
    try:
        return write_frame(root, shots, writers, {"seeds": list(take.seeds), **take.note})
    except OSError as error:
        raise SceneError(f"{root}: frame {frame} cannot be written: {error.strerror or error}") from error


def _make(recipe: Recipe, root: Path, writers: list[Writer], samples: int, pending: list[int], total: int, workers: int,
          threads: int, progress: Callable[[Making], None] | None) -> None:  # fmt: skip
    began, size = time.perf_counter(), 0
    done = total - len(pending)

    def report(fresh: int) -> None:
        if progress is not None:
            progress(Making(done + fresh, total, fresh, time.perf_counter() - began, size))

    report(0)
    if workers == 1 or len(pending) < 2:
        made: Iterator[int] = (_bytes(make_frame(recipe, root, writers, samples, threads, k)) for k in pending)
    else:
        from sightray.vision.crew import Crew

        made = Crew(recipe, root, writers, samples, min(workers, len(pending)), threads).make(pending)
    for fresh, written in enumerate(made, 1):
        size += written
        if fresh == 1:
            check_room(root, SPARE * written * (len(pending) - 1), "about")
        report(fresh)


def _bytes(mark: Mark) -> int:
    return sum(about["bytes"] for about in mark["files"].values())


# ------------------------------------------------------------------------------------------------------------ when it ends


def _complete(root: Path, identity: dict[str, Any], total: int, writers: list[Writer]) -> None:
    """Write the files about all frames, and the manifest."""
    try:
        files = finish(root, range(total), writers)
    except OSError as error:
        raise SceneError(f"{root}: cannot be written: {error.strerror or error}") from error
    marks = {f"{k:06}": _digest(mark_path(root, k)) for k in range(total)}
    left_out = sum((read_mark(root, k) or {}).get("left_out", 0) for k in range(total))
    facts = {"complete": True, "frames": total, "left_out": left_out, "files": files, "marks": marks}
    _write_manifest(root, {**identity, **facts})


def _is_complete(root: Path, identity: dict[str, Any], total: int) -> bool:
    """Whether the manifest says that this very dataset is done."""
    found = json.loads((root / MANIFEST).read_text(encoding="utf-8"))
    wanted = {**identity, "complete": True, "frames": total}
    return all(found.get(key) == value for key, value in wanted.items())


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _write_manifest(root: Path, manifest: dict[str, Any]) -> None:
    with writing(root / MANIFEST) as aside:
        aside.write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")
