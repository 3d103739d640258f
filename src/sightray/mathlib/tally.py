"""`tally`: counts the steps of a traversal, in builds that are made to count.

``tally(NODES)`` in a kernel says that a node (or cell) was visited, ``tally(TESTS)`` that a primitive was asked. In a
normal build it is lowered to nothing and costs nothing. Within ``with counting():`` kernels are compiled another time,
under a key of their own, and increment the words of `COUNTS`; plain Python always counts. Counting is for one thread.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from sightray import _jit
from sightray._jit import primitive
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, aligned

NODES, TESTS = 0, 1  # nodes or cells visited; primitives asked
COUNTING, SYMBOL = "counting", "sightray_tally"
COUNTS = Table(aligned(8, np.int64))


@primitive
def tally(kind: i64) -> None:
    """Count one step of this kind."""
    COUNTS.view(np.int64)[kind] += 1


@contextmanager
def counting() -> Iterator[None]:
    """Within this, kernels are compiled, and scenes prepared, such that they count; `COUNTS` starts at zero."""
    COUNTS.view(np.int64)[:] = 0
    if _jit.enabled():
        import llvmlite.binding as llvm

        llvm.add_symbol(SYMBOL, COUNTS.address)  # where the linker finds the external variable of the lowering
    token = _jit.flavour.set(COUNTING)
    try:
        yield
    finally:
        _jit.flavour.reset(token)
