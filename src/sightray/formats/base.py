"""What every file format of this folder promises, and how formats are found.

A format's module defines ``FORMATS``, a tuple of `Format`. The contract:

``load(path, limits) -> Scene``
    The scene, with the camera, the lights and the integrator that the file states or its format implies.
``objects(path, limits) -> list of shapes``
    For formats that hold geometry only; `load` frames it by `frame_mesh`, scene files may refer to it.
``save(scene, path)``
    For formats that can state any scene.

A file is not trusted. Whatever it holds, a reader returns a scene or raises `FormatError`, `SceneError` or
`UnsupportedError`: `reading` sees to that. No memory is taken on a count's word before the file's length agreed with
it. A file may name others, by relative path only (`asset`).
"""

from __future__ import annotations

import functools
import importlib
import os
import pkgutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from sightray.errors import FormatError, SceneError, SightrayError, UnsupportedError, did_you_mean, unknown
from sightray.scene.scene import Scene

StrPath = str | Path
TEXTURES = (".png", ".jpg", ".jpeg", ".bmp", ".gif", ".tga", ".tif", ".tiff", ".webp", ".hdr", ".exr", ".pfm", ".npy",
            ".ppm", ".pgm", ".pnm")  # fmt: skip


@dataclass(frozen=True)
class Limits:
    """How large a file may be. Each is a keyword option of `load_scene`, to be raised for files that are trusted.

    Parameters
    ----------
    max_bytes : length of a file, and of each file that it names.
    max_triangles : triangles of one file.
    max_nesting : levels of groups, transforms, lists and nodes.
    max_nodes : values and members in a YAML file, where aliases and names count as all that they repeat; nodes in a
        glTF scene.
    """

    max_bytes: int = 1 << 30
    max_triangles: int = 20_000_000
    max_nesting: int = 64
    max_nodes: int = 2_000_000

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if isinstance(value, bool) or not isinstance(value, int) or value < 1:
                raise SceneError(f"load: {name}: got {value!r}; allowed: a whole number of at least 1")

    def check_triangles(self, count: int, path: StrPath, line: int | None = None) -> None:
        """Refuse more than `max_triangles`."""
        if count > self.max_triangles:
            raise FormatError(
                f"{count} triangles; allowed: {self.max_triangles}. Raise max_triangles if the file is to be trusted",
                path, line,
            )  # fmt: skip


@dataclass(frozen=True)
class Format:
    """One file format: its suffixes (lower case, with the dot) and its functions."""

    name: str
    suffixes: tuple[str, ...]
    load: Callable[[Path, Limits], Scene]
    objects: Callable[[Path, Limits], list[Any]] | None = None
    save: Callable[[Scene, Path], None] | None = None


@functools.cache
def formats() -> dict[str, Format]:
    """Format of each suffix, gathered from the modules of this folder."""
    package = importlib.import_module(__package__)
    modules = (importlib.import_module(f"{__package__}.{m.name}") for m in pkgutil.iter_modules(package.__path__))
    found = (one for module in modules for one in getattr(module, "FORMATS", ()))
    return {suffix: one for one in found for suffix in one.suffixes}


def suffixes() -> tuple[str, ...]:
    """Every file suffix that scenes can be read from, sorted."""
    return tuple(sorted(formats()))


def load_scene(path: StrPath, **limits: Any) -> Scene:
    """Read a scene, in the format that the suffix names.

    Parameters
    ----------
    path : the file; a bare mesh gets a camera that frames it, and lights.
    **limits : fields of `Limits`, to be raised for large files that are trusted.

    Raises
    ------
    FormatError
        The file is missing, its suffix unknown (the nearest known one is offered), or its content breaks the format.
    SceneError, UnsupportedError
        The file states an impossible scene, or one that Sightray cannot do.
    """
    path = Path(path)
    names = [field.name for field in fields(Limits)]
    for name in limits:
        if name not in names:
            raise SceneError(f"load: {unknown('option', name, names)}")
    one, allowed = _format_of(path, formats()), Limits(**limits)
    with reading(path), np.errstate(all="ignore"):
        return one.load(path, allowed)


def save_scene(scene: Scene, path: StrPath) -> None:
    """Write a scene, whole or not at all, in the format that the suffix names.

    Raises
    ------
    FormatError
        The suffix names no format that can state any scene.
    SceneError
        The file cannot be written, or the scene holds something that has no name in files, such as a Python function.
    """
    if not isinstance(scene, Scene):
        raise SceneError(f"save: got {scene!r}; allowed: a Scene")
    one = _format_of(Path(path), {suffix: f for suffix, f in formats().items() if f.save is not None})
    assert one.save is not None
    one.save(scene, Path(path))


def _format_of(path: Path, known: dict[str, Format]) -> Format:
    suffix = path.suffix.lower()
    if suffix not in known:
        what = unknown("scene suffix", suffix, known) if suffix else f"no suffix. Allowed: {', '.join(sorted(known))}"
        raise FormatError(what, path)
    return known[suffix]


@contextmanager
def reading(path: StrPath, line: int | None = None) -> Iterator[None]:
    """Say where, whatever goes wrong: any other exception becomes a `FormatError` of the file.

    Decoders raise what their corrupt input leads them to, so no shorter list than ``Exception`` is complete.
    """
    try:
        yield
    except SceneError as error:
        raise FormatError(str(error), path, line) from error
    except UnsupportedError as error:
        where = str(path) if line is None else f"{path}:{line}"
        raise (error if str(path) in str(error) else UnsupportedError(f"{where}: {error}")) from None
    except SightrayError:
        raise
    except MemoryError as error:
        raise FormatError("needs more memory than there is", path, line) from error
    except Exception as error:
        raise FormatError(f"not readable: {type(error).__name__}: {error}", path, line) from error


def read_bytes(path: Path, limits: Limits) -> bytes:
    """The whole file, or one clear message: missing, a folder, not readable, too large."""
    try:
        if not path.exists():
            siblings = [p.name for p in path.parent.iterdir()] if path.parent.is_dir() else []
            raise FormatError(f"no such file{did_you_mean(path.name, siblings)}".removesuffix("?"), path)
        if not path.is_file():
            raise FormatError("is not a file", path)
        size = path.stat().st_size
        if size > limits.max_bytes:
            raise FormatError(
                f"{size} bytes; allowed: {limits.max_bytes}. Raise max_bytes if the file is to be trusted", path
            )
        return path.read_bytes()
    except (OSError, ValueError) as error:
        if isinstance(error, FormatError):
            raise
        raise FormatError(f"cannot be read: {error}", path) from error


def read_text(path: Path, limits: Limits) -> str:
    """The whole file as text: UTF-8, else Latin-1, which old exporters wrote."""
    data = read_bytes(path, limits)
    if b"\0" in data:
        raise FormatError("binary data; expected text", path)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def asset(owner: Path, reference: str, allowed: Sequence[str], line: int | None = None) -> Path:
    """Path of a file that another one names: relative to it, and of an expected kind, or a `FormatError`.

    Absolute paths and addresses are refused: a scene from elsewhere must not choose which of this machine's files are
    read.
    """
    plain = reference.replace("\\", "/").strip()
    if not plain or "\0" in plain or plain.startswith("/") or ":" in plain:
        raise FormatError(f"file name {reference!r}; allowed: a path relative to this file", owner, line)
    path = Path(os.path.normpath(owner.parent / plain))
    if path.suffix.lower() not in allowed:
        raise FormatError(f"file name {reference!r}: {unknown('suffix', path.suffix, allowed)}", owner, line)
    return path


def number(token: str, what: str, path: Path, line: int) -> float:
    """A finite number, or a `FormatError` that says where."""
    try:
        value = float(token)
        if np.isfinite(value) and "_" not in token:  # Python reads 1_000, no scene format does
            return value
    except ValueError:
        pass
    raise FormatError(f"{what}: got {token[:40]!r}; expected a finite number", path, line)


def whole(token: str, what: str, path: Path, line: int) -> int:
    """A whole number, or a `FormatError` that says where."""
    value = number(token, what, path, line)
    if value != int(value) or abs(value) > 2**53:
        raise FormatError(f"{what}: got {token[:40]!r}; expected a whole number", path, line)
    return int(value)
