"""Tables that take a while to compute, kept in memory and in the folder where machine code is kept."""

from __future__ import annotations

import contextlib
import hashlib
import os
import secrets
from collections.abc import Callable
from functools import cache, wraps
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from sightray._jit import cache_folder

Compute = TypeVar("Compute", bound=Callable[..., Any])
SOURCES = ("energy.py", "microfacet.py")  # what the tables are a function of, beside their arguments


def stored(compute: Compute) -> Compute:
    """Remember an array by the function's name, its arguments and the sources that made it.

    A file that cannot be read is computed anew, and where nothing can be written nothing is.
    """

    @wraps(compute)
    def known(*arguments: Any) -> Any:
        folder = cache_folder()
        if folder is None:
            return compute(*arguments)
        name = hashlib.sha256(_sources() + repr((compute.__name__, arguments)).encode()).hexdigest()[:24]
        path = folder / f"{compute.__name__}-{name}.npy"
        with contextlib.suppress(OSError, ValueError, EOFError):
            return np.load(path, allow_pickle=False)
        found = compute(*arguments)
        beside = folder / f".{secrets.token_hex(8)}.npy"
        with contextlib.suppress(OSError):
            np.save(beside, found)
            os.replace(beside, path)
        return found

    return cache(known)  # type: ignore[return-value]


@cache
def _sources() -> bytes:
    return b"".join(Path(__file__).with_name(name).read_bytes() for name in SOURCES)
