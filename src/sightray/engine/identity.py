"""Names for values: two scenes have the same digest if, and as good as only if, they hold the same numbers."""

from __future__ import annotations

import hashlib
import marshal
import types
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from sightray.errors import UnsupportedError
from sightray.registry import Member


def digest_of(value: Any) -> str:
    """A digest, 32 hexadecimal digits, of a scene or any member with all that hangs from it.

    It is the same in every process: it depends on numbers, texts and the names of classes, on the bytes of files that
    a path names and on the code of functions, never on where something lies in memory.

    Raises
    ------
    UnsupportedError
        For objects that hold their state where it cannot be read.
    """
    return _digest(value, {}).hex()


def _digest(value: Any, known: dict[int, tuple[Any, bytes]]) -> bytes:
    """The digest of a value; shared parts are looked at once (`known`: by id, and kept alive for it)."""
    if id(value) in known:
        return known[id(value)][1]
    total = hashlib.blake2b(type(value).__qualname__.encode() + b"\0", digest_size=16)
    for part in _parts(value):
        total.update(part if isinstance(part, bytes) else _digest(part, known))
    found = total.digest()
    if not isinstance(value, str | int | float):
        known[id(value)] = (value, found)
    return found


def _parts(value: Any) -> Iterable[Any]:
    """What a value consists of: bytes, or further values."""
    if value is None or isinstance(value, str | int | float | complex | np.generic):
        return [repr(value).encode()]
    if isinstance(value, bytes):
        return [value]
    if isinstance(value, np.ndarray):
        return [repr((value.dtype.str, value.shape)).encode(), np.ascontiguousarray(value).tobytes()]
    if isinstance(value, tuple | list):
        return [repr(len(value)).encode(), *value]
    if isinstance(value, dict):
        return [part for item in value.items() for part in item]
    if isinstance(value, Member):
        return [type(value).__module__.encode(), *_parts(value.values())]
    if isinstance(value, Path):
        return [str(value).encode(), value.read_bytes() if value.is_file() else b""]
    if isinstance(value, types.FunctionType):
        return [value.__qualname__.encode(), marshal.dumps(value.__code__)]
    return _parts(_state(value))


def _state(value: Any) -> dict[str, Any]:
    """Attributes of an object by name, without those that it keeps for itself."""
    slots = [name for kind in type(value).__mro__ for name in getattr(kind, "__slots__", ())]
    names = [name for name in (*slots, *getattr(value, "__dict__", ())) if not name.startswith("_")]
    if not names:
        raise UnsupportedError(f"checkpoint: cannot tell {type(value).__name__} objects apart; got {value!r}")
    return {name: getattr(value, name) for name in sorted(names)}
