"""Write a file whole or not at all, and find out beforehand whether it can be written."""

from __future__ import annotations

import os
import secrets
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sightray.errors import SceneError
from sightray.images.base import StrPath, codec_for


def check_writable(path: StrPath) -> Path:
    """Find out, before an hour of rendering, whether a picture can be saved at `path`.

    An existing file is not opened, changed or emptied.

    Parameters
    ----------
    path : where the picture is to go; its suffix chooses the format.

    Returns
    -------
    The path, as a `pathlib.Path`.

    Raises
    ------
    SceneError
        Unknown suffix (the nearest known one is offered), missing folder, a folder or device in the file's place, a
        write-protected file, or a folder in which no file can be made.
    """
    path = Path(path)
    codec_for(path)
    _check_place(path)
    folder = path.parent
    if not folder.is_dir():
        problem = "is not a folder" if folder.exists() else "does not exist"
        raise SceneError(f"{path}: the folder '{folder}' {problem}; create it first or choose another")

    # Make a file rather than read permission bits: those say nothing on read-only, network and Windows file systems.
    try:
        handle, probe = tempfile.mkstemp(prefix=".sightray-", dir=folder)
        os.close(handle)
        os.unlink(probe)
    except OSError as error:
        raise SceneError(f"{path}: the folder '{folder}' is not writable: {error.strerror}") from error
    return path


@contextmanager
def writing(path: StrPath) -> Iterator[Path]:
    """Yield a temporary path beside `path`; move it there when the block succeeds, remove it when it fails.

    A reader, or a crash, sees either the old file or the complete new one. The temporary file has the suffix of `path`
    and lies in the same folder, because only within one file system is the move atomic. A symbolic link is followed,
    and the permissions of a replaced file are kept.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with writing(f"{folder}/notes.txt") as aside:
    ...         _ = aside.write_text("complete")
    ...     print((Path(folder) / "notes.txt").read_text())
    complete

    Raises
    ------
    SceneError
        A folder or a device is in the file's place, or the file is write-protected.
    """
    _check_place(Path(path))
    target = Path(os.path.realpath(path))
    aside = target.with_name(f".sightray-{secrets.token_hex(6)}{target.suffix}")
    try:
        yield aside
        if target.exists():
            shutil.copymode(target, aside)
        os.replace(aside, target)
    except BaseException:  # Ctrl-C too must leave nothing behind
        aside.unlink(missing_ok=True)
        raise


def _check_place(path: Path) -> None:
    """Refuse what `os.replace` would fail on, or would destroy though it is no plain file (``/dev/null``)."""
    try:
        mode = os.stat(path).st_mode
    except (FileNotFoundError, NotADirectoryError):
        return  # nothing there yet
    except (OSError, ValueError) as error:  # too long a name, a NUL in it, a loop of links
        raise SceneError(f"{str(path)!r}: not a usable file name: {error}") from error
    if stat.S_ISDIR(mode):
        raise SceneError(f"{path}: is a folder; give the name of a file in it")
    if not stat.S_ISREG(mode):
        raise SceneError(f"{path}: is not a regular file")
    if not os.access(path, os.W_OK):
        raise SceneError(f"{path}: is write-protected; change its permissions or choose another name")
