"""What can go wrong, as a tree::

    SightrayError
    ├── SceneError (ValueError)      an object or option has a value that makes no sense
    ├── FormatError (ValueError)     a file does not say what its format asks for
    └── UnsupportedError             the file or request is valid, but Sightray cannot do it

Every message says where, what was found, and what is allowed.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from pathlib import Path


class SightrayError(Exception):
    """Base of every error that Sightray raises on purpose; the command line exits with status 2."""


class SceneError(SightrayError, ValueError):
    """A value in a scene, or an option of a call, is not allowed."""


class UnsupportedError(SightrayError):
    """A valid request that this version cannot carry out."""


class FormatError(SightrayError, ValueError):
    """A file breaks the rules of its format.

    Parameters
    ----------
    message : what was found and what is allowed.
    path : the file.
    line : 1-based line number, where the format has lines.
    """

    def __init__(self, message: str, path: str | Path | None = None, line: int | None = None):
        self.path, self.line, self.reason = path, line, message
        where = ":".join(str(part) for part in (path, line) if part is not None)
        super().__init__(f"{where}: {message}" if where else message)


def did_you_mean(name: str, valid: Iterable[str]) -> str:
    """``"; did you mean 'albedo'?"`` for a near miss, else an empty string."""
    close = difflib.get_close_matches(name, list(valid), n=1, cutoff=0.6)
    return f"; did you mean '{close[0]}'?" if close else ""


def unknown(what: str, name: str, valid: Iterable[str]) -> str:
    """One sentence for an unknown name: what it is, the nearest valid one, and all of them."""
    names = sorted(valid)
    hint = did_you_mean(name, names) or "."
    return f"unknown {what} '{name}'{hint} Allowed: {', '.join(names)}"
