"""What every codec of this folder promises, and how they are found.

A codec file defines ``CODECS``, a tuple of `Codec`. The contract:

``read(path, max_pixels) -> (h, w, c) array``
    Row 0 on top. A *bitmap* codec gives the stored integers (uint8 or uint16) and knows nothing of transfer curves;
    every other codec gives linear float32. Whatever is wrong with the file is a `FormatError`, and no array is made
    before `check_size` and a look at the file's own length agreed that it can be filled.
``write(path, pixels, *, option=...)``
    `pixels` is (h, w, c) with c in ``channels``: uint8 for a bitmap codec, else float32. The file is `path` itself;
    the caller makes it atomic. The keyword-only parameters are the options that ``Image.save`` accepts.
"""

from __future__ import annotations

import functools
import importlib
import inspect
import os
import pkgutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sightray.errors import FormatError, SceneError, SightrayError, unknown

StrPath = str | os.PathLike[str]

MAX_PIXELS = 256 * 1024 * 1024
"""Largest picture that is read unless the caller raises the limit (268 million pixels, 3 GiB as float RGB)."""


@dataclass(frozen=True)
class Codec:
    """One file format: its suffixes (lower case, with the dot), its two functions, and what it can hold."""

    name: str
    suffixes: tuple[str, ...]
    read: Callable[[Path, int], NDArray[Any]]
    write: Callable[..., None]
    channels: tuple[int, ...]  # what `write` accepts
    bitmap: bool = False  # stores integers behind a transfer curve, not linear floats

    @property
    def options(self) -> tuple[str, ...]:
        """Names of the keyword-only options of ``write``."""
        parameters = inspect.signature(self.write).parameters.values()
        return tuple(p.name for p in parameters if p.kind is p.KEYWORD_ONLY)


@functools.cache
def codecs() -> dict[str, Codec]:
    """Codec of each suffix, gathered from the modules of this folder."""
    package = importlib.import_module(__package__)
    modules = (importlib.import_module(f"{__package__}.{m.name}") for m in pkgutil.iter_modules(package.__path__))
    found = (codec for module in modules for codec in getattr(module, "CODECS", ()))
    return {suffix: codec for codec in found for suffix in codec.suffixes}


def suffixes() -> tuple[str, ...]:
    """Every file suffix that pictures can be read from and written to, sorted."""
    return tuple(sorted(codecs()))


def codec_for(path: StrPath) -> Codec:
    """Codec of a path by its suffix, in any case; an unknown suffix is a `SceneError` that names the nearest one."""
    suffix = Path(path).suffix.lower()
    if not suffix:
        raise SceneError(f"{path}: an image path needs a suffix. Allowed: {', '.join(suffixes())}")
    if suffix not in codecs():
        raise SceneError(f"{path}: {unknown('image suffix', suffix, suffixes())}")
    return codecs()[suffix]


def check_size(path: Path, width: int, height: int, max_pixels: int) -> None:
    """Refuse an empty picture, or one of more than `max_pixels` pixels."""
    if width < 1 or height < 1:
        raise FormatError(f"size {width} x {height} (width x height); both must be at least 1", path)
    if width * height > max_pixels:
        raise FormatError(
            f"size {width} x {height} (width x height) is {width * height} pixels; allowed: {max_pixels}. "
            "Raise max_pixels if the file is to be trusted",
            path,
        )


def check_holds(path: Path, needed: int, found: int) -> None:
    """Refuse a file whose header promises more bytes than there are."""
    if found < needed:
        raise FormatError(f"truncated: the header asks for at least {needed} bytes of pixels, found {found}", path)


@contextmanager
def decoding(path: Path, what: str) -> Iterator[None]:
    """Turn any complaint of a third-party decoder into a `FormatError`.

    The decoders raise whatever their corrupt input leads them to (SyntaxError, struct.error, UnicodeDecodeError, ...),
    so no shorter list than ``Exception`` is complete. Running out of memory says nothing about the file and passes.
    """
    try:
        yield
    except (SightrayError, MemoryError):
        raise
    except Exception as error:
        raise FormatError(f"not a readable {what} file: {error}", path) from error


def as_float32(values: NDArray[Any]) -> NDArray[np.float32]:
    """Contiguous float32 in the machine's byte order; what is too large becomes infinite without a warning."""
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(values, dtype=np.float32)
