"""`F32x4` and `F32x8`: four or eight floats that one instruction handles together.

The tree of boxes and the packed triangles are searched in single precision, eight boxes or four triangles at a time.
This is a filter: whatever it lets through is decided in double precision. A comparison gives a `Mask4` or `Mask8`,
which `movemask` turns into an integer with one bit a lane. Primitives carry their width in the name.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from sightray._jit import primitive
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table


class Mask:
    """One truth value a lane."""

    __slots__ = ("bits",)

    def __init__(self, bits: np.ndarray):
        self.bits = bits

    def __and__(self, other: Any) -> Any:
        return type(self)(self.bits & other.bits)

    def __or__(self, other: Any) -> Any:
        return type(self)(self.bits | other.bits)


class Mask4(Mask):
    """Four truth values."""


class Mask8(Mask):
    """Eight truth values."""


class Lanes:
    """Floats with arithmetic and comparisons lane by lane; both sides have the same width."""

    __slots__ = ("values",)
    width: ClassVar[int]
    mask: ClassVar[type]

    def __init__(self, values: Any):
        self.values = np.asarray(values, np.float32)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.values.tolist()})"

    def __add__(self, other: Any) -> Any:
        return _quietly(np.add, self, other)

    def __sub__(self, other: Any) -> Any:
        return _quietly(np.subtract, self, other)

    def __mul__(self, other: Any) -> Any:
        return _quietly(np.multiply, self, other)

    def __lt__(self, other: Any) -> Any:
        return self.mask(self.values < other.values)

    def __le__(self, other: Any) -> Any:
        return self.mask(self.values <= other.values)

    def __gt__(self, other: Any) -> Any:
        return self.mask(self.values > other.values)

    def __ge__(self, other: Any) -> Any:
        return self.mask(self.values >= other.values)


class F32x4(Lanes):
    """Four floats."""

    width, mask = 4, Mask4


class F32x8(Lanes):
    """Eight floats."""

    width, mask = 8, Mask8


def _quietly(operation: Any, a: Any, b: Any) -> Any:
    with np.errstate(all="ignore"):
        return type(a)(operation(a.values, b.values))


def _select(choice: np.ndarray, a: Any, b: Any) -> Any:
    return type(a)(np.where(choice, a.values, b.values))


def _bits(mask: Mask) -> int:
    return sum(1 << lane for lane, bit in enumerate(mask.bits.tolist()) if bit)


@primitive
def splat4(value: f64) -> F32x4:
    """One number, rounded to float, in all four lanes."""
    return F32x4(np.full(4, value, np.float32))


@primitive
def splat8(value: f64) -> F32x8:
    """One number, rounded to float, in all eight lanes."""
    return F32x8(np.full(8, value, np.float32))


@primitive
def load4(table: Table, index: i64) -> F32x4:
    """Four floats from float number `index` of a table on."""
    return F32x4(table.view(np.float32)[index : index + 4].copy())


@primitive
def load8(table: Table, index: i64) -> F32x8:
    """Eight floats from float number `index` of a table on."""
    return F32x8(table.view(np.float32)[index : index + 8].copy())


@primitive
def store4(table: Table, index: i64, a: F32x4) -> None:
    """Write four floats from float number `index` of a table on."""
    table.view(np.float32)[index : index + 4] = a.values


@primitive
def store8(table: Table, index: i64, a: F32x8) -> None:
    """Write eight floats from float number `index` of a table on."""
    table.view(np.float32)[index : index + 8] = a.values


@primitive
def low4(a: F32x8) -> F32x4:
    """The first four lanes."""
    return F32x4(a.values[:4])


@primitive
def high4(a: F32x8) -> F32x4:
    """The last four lanes."""
    return F32x4(a.values[4:])


@primitive
def vmin4(a: F32x4, b: F32x4) -> F32x4:
    """Smaller lane of each pair; the second where they cannot be compared."""
    return _select(a.values < b.values, a, b)


@primitive
def vmin8(a: F32x8, b: F32x8) -> F32x8:
    """Smaller lane of each pair; the second where they cannot be compared."""
    return _select(a.values < b.values, a, b)


@primitive
def vmax4(a: F32x4, b: F32x4) -> F32x4:
    """Larger lane of each pair; the second where they cannot be compared."""
    return _select(a.values > b.values, a, b)


@primitive
def vmax8(a: F32x8, b: F32x8) -> F32x8:
    """Larger lane of each pair; the second where they cannot be compared."""
    return _select(a.values > b.values, a, b)


@primitive
def flip4(a: F32x4, sign: F32x4) -> F32x4:
    """`a`, negated in the lanes where the sign bit of `sign` is set: ``flip4(a, a)`` is the absolute value."""
    return F32x4(np.where(np.signbit(sign.values), -a.values, a.values))


@primitive
def extract4(a: F32x4, lane: i64) -> f64:
    """One lane as a number."""
    return float(a.values[lane])


@primitive
def movemask4(mask: Mask4) -> i64:
    """Bit i is set where lane i is true."""
    return _bits(mask)


@primitive
def movemask8(mask: Mask8) -> i64:
    """Bit i is set where lane i is true."""
    return _bits(mask)


@primitive
def lowest_bit(bits: i64) -> i64:
    """Number of the lowest bit that is set; `bits` is not zero."""
    return (bits & -bits).bit_length() - 1


@primitive
def sort_key(distance: f64) -> i64:
    """A key that sorts as `distance`, a number >= 0 that is rounded to float: its bits as the high half of 64."""
    return int(np.float32(distance).view(np.int32)) << 32
