"""`Table`: the memory that kernels read, one pointer wide.

A scene, as kernels see it, is rows of eight-byte words that point at one another. A row starts with the function
pointers of its member's methods (see `sightray._jit`), then come its fields. Word `i` of a table is read by the
accessor of its type; accessors of narrower types count in elements of their own size.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from sightray._jit import METHOD_SLOTS, primitive
from sightray.mathlib.scalars import f32, f64, i32, i64
from sightray.mathlib.vec import Vec3

_KNOWN: dict[int, Any] = {}  # address -> Table, so that plain Python can follow pointers


class Table:
    """A pointer into NumPy memory, with typed views for Python and an address for machine code."""

    __slots__ = ("__weakref__", "address", "bytes", "functions")

    def __init__(self, array: np.ndarray):
        if not array.flags.c_contiguous:
            raise ValueError("a table needs contiguous memory")
        self.bytes = array.reshape(-1).view(np.uint8)
        self.address = array.ctypes.data
        self.functions: dict[int, Callable] = {}

    def view(self, dtype: Any) -> np.ndarray:
        """The memory from here on as an array of `dtype`."""
        size = np.dtype(dtype).itemsize
        return self.bytes[: len(self.bytes) // size * size].view(dtype)

    def method(self, slot: int) -> Callable:
        """The Python function that stands in a method slot of this row."""
        return self.functions[slot]


class Space:
    """All tables of one compiled scene: allocates rows, links them, and keeps their memory alive."""

    CHUNK = 1 << 15  # words

    def __init__(self) -> None:
        self.tables: dict[int, Table] = {}
        self._chunk = np.zeros(0)
        self._used = 0

    def row(self, words: int) -> Table:
        """A zeroed row of at least `words` eight-byte words that starts a cache line."""
        words = -(-words // 8) * 8
        if self._used + words > len(self._chunk):
            self._chunk, self._used = aligned(max(self.CHUNK, words), np.float64), 0
        table = Table(self._chunk[self._used : self._used + words])
        self._used += words
        return self._keep(table)

    def array(self, values: np.ndarray) -> Table:
        """A table over an existing array, which is not copied."""
        return self._keep(Table(values))

    def _keep(self, table: Table) -> Table:
        self.tables[table.address] = table
        _KNOWN[table.address] = table
        return table

    def __del__(self) -> None:
        for address, table in self.tables.items():
            if _KNOWN.get(address) is table:
                del _KNOWN[address]


def aligned(shape: int | tuple[int, ...], dtype: Any, boundary: int = 64) -> np.ndarray:
    """Zeros that start on a cache line, so that vector loads never straddle two."""
    dtype = np.dtype(dtype)
    count = math.prod(shape) if isinstance(shape, tuple) else int(shape)
    raw = np.zeros(count * dtype.itemsize + boundary, np.uint8)
    start = -raw.ctypes.data % boundary
    return raw[start : start + count * dtype.itemsize].view(dtype).reshape(shape)


def link(table: Table, word: int, target: Table | None) -> None:
    """Store a pointer to `target` (or null) in a word."""
    table.view(np.int64)[word] = 0 if target is None else target.address


def set_methods(row: Table, functions: Iterable[tuple[int, Callable, int]]) -> None:
    """Fill method slots of a row: (slot, Python function, address of its machine code or 0)."""
    words = row.view(np.int64)
    for slot, function, address in functions:
        assert slot < METHOD_SLOTS
        row.functions[slot] = function
        if address:  # plain Python has none, and must not take away what machine code uses
            words[slot] = address


@primitive
def f64_at(table: Table, index: i64) -> f64:
    """Double number `index` of a table."""
    return float(table.view(np.float64)[index])


@primitive
def i64_at(table: Table, index: i64) -> i64:
    """64-bit integer number `index` of a table."""
    return int(table.view(np.int64)[index])


@primitive
def f32_at(table: Table, index: i64) -> f32:
    """Float number `index` of a table."""
    return table.view(np.float32)[index]


@primitive
def i32_at(table: Table, index: i64) -> i32:
    """32-bit integer number `index` of a table."""
    return table.view(np.int32)[index]


@primitive
def vec3_at(table: Table, index: i64) -> Vec3:
    """The four doubles from word `index` on, as one vector."""
    return Vec3(*table.view(np.float64)[index : index + 4].tolist())


@primitive
def table_at(table: Table, index: i64) -> Table:
    """The table that the pointer in word `index` points to; only its null test is allowed if it is null."""
    target = i64_at(table, index)
    return _KNOWN[target] if target else NULL


@primitive
def advance(table: Table, words: i64) -> Table:
    """The table that starts `words` eight-byte words further on."""
    target = table.address + 8 * words
    if target in _KNOWN:
        return _KNOWN[target]
    return Table(table.bytes[8 * words :])


@primitive
def words_to(table: Table, address: i64) -> i64:
    """How many words it is from a table to an address."""
    return (address - table.address) >> 3


@primitive
def no_table() -> Table:
    """The table that is none; only its null test is allowed."""
    return NULL


@primitive
def is_null(table: Table) -> bool:
    """Whether this is no table at all."""
    return table.address == 0


@primitive
def f64_put(table: Table, index: i64, value: f64) -> None:
    """Write double number `index`."""
    table.view(np.float64)[index] = value


@primitive
def i64_put(table: Table, index: i64, value: i64) -> None:
    """Write 64-bit integer number `index`."""
    table.view(np.int64)[index] = value


@primitive
def f32_put(table: Table, index: i64, value: f64) -> None:
    """Write float number `index`, rounded from a double."""
    table.view(np.float32)[index] = value


@primitive
def i32_put(table: Table, index: i64, value: i64) -> None:
    """Write 32-bit integer number `index`."""
    table.view(np.int32)[index] = value


@primitive
def vec3_put(table: Table, index: i64, value: Vec3) -> None:
    """Write a vector into the four words from `index` on."""
    table.view(np.float64)[index : index + 4] = (value.x, value.y, value.z, value.w)


@primitive
def table_put(table: Table, index: i64, target: Table) -> None:
    """Write a pointer to another table, one that a compiled scene holds, into word `index`."""
    table.view(np.int64)[index] = target.address


@primitive
def scratch(words: i64) -> Table:
    """A table of `words` eight-byte words on the stack of the calling kernel; `words` is a constant."""
    return Table(np.zeros(words))


NULL = Table(np.zeros(0))
NULL.address = 0
