"""Memory for pictures, used again when nobody looks at them any more.

The system hands out memory page by page, and clears each one when it is first touched: for the arrays of a few layers that
takes as long as half of what is computed. What was allocated last is kept here, up to `KEPT` bytes, and lent again when
no array refers to it; what an array of the caller's refers to is left alone.
"""

from __future__ import annotations

import math
import os
import sys
import threading
from typing import Any

import numpy as np

KEPT = 1 << 26  # bytes
SMALL = 1 << 17  # bytes below which the system is as fast

_shelf: list[np.ndarray] = []
_lock = threading.Lock()


def _renew_lock() -> None:
    global _lock
    _lock = threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_renew_lock)  # another thread may have held it


def _holders(shelf: list[np.ndarray], index: int) -> int:
    """How many refer to an entry, the shelf among them."""
    return sys.getrefcount(shelf[index])


_NOBODY_ELSE = _holders([np.empty(0)], 0)


def empty(shape: tuple[int, ...], dtype: Any) -> np.ndarray:
    """An array whose values are not set, as `numpy.empty` makes it."""
    size = math.prod(shape) * np.dtype(dtype).itemsize
    if size < SMALL:
        return np.empty(shape, dtype)
    with _lock:
        idle = (k for k in range(len(_shelf)) if _shelf[k].nbytes == size and _holders(_shelf, k) == _NOBODY_ELSE)
        found = next(idle, None)
        _shelf.append(np.empty(size, np.uint8) if found is None else _shelf.pop(found))
        while sum(raw.nbytes for raw in _shelf) > max(KEPT, size):
            del _shelf[0]
        return _shelf[-1].view(dtype).reshape(shape)
