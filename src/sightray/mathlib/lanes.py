"""`F32x4`, `F32x8`, `F32x16`, `F64x16`: numbers that one instruction handles together.

The tree of boxes and the packed triangles are searched in single precision: eight boxes or four triangles for one ray, or
sixteen rays for one box or triangle. This is a filter: whatever it lets through is decided in double precision, for
sixteen rays in `F64x16`. A comparison gives a `Mask4`, `Mask8` or `Mask16`, which `movemask` turns into an integer with
one bit a lane. Primitives carry their width in the name, those of doubles a `d`. Where the processor has no registers so
wide, the compiler takes several.
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


class Mask16(Mask):
    """Sixteen truth values."""


class Lanes:
    """Numbers with arithmetic and comparisons lane by lane; both sides have the same width."""

    __slots__ = ("values",)
    width: ClassVar[int]
    mask: ClassVar[type]
    dtype: ClassVar[type] = np.float32

    def __init__(self, values: Any):
        self.values: np.ndarray = np.asarray(values, self.dtype)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.values.tolist()})"

    def __add__(self, other: Any) -> Any:
        return _quietly(np.add, self, other)

    def __sub__(self, other: Any) -> Any:
        return _quietly(np.subtract, self, other)

    def __mul__(self, other: Any) -> Any:
        return _quietly(np.multiply, self, other)

    def __truediv__(self, other: Any) -> Any:
        return _quietly(np.divide, self, other)

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


class F32x16(Lanes):
    """Sixteen floats."""

    width, mask = 16, Mask16


class F64x16(Lanes):
    """Sixteen doubles."""

    width, mask, dtype = 16, Mask16, np.float64


class I64x8(Lanes):
    """Eight integers, as keys to sort by."""

    width, dtype = 8, np.int64


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
def splat16(value: f64) -> F32x16:
    """One number, rounded to float, in all sixteen lanes."""
    return F32x16(np.full(16, value, np.float32))


@primitive
def load4(table: Table, index: i64) -> F32x4:
    """Four floats from float number `index` of a table on."""
    return F32x4(table.view(np.float32)[index : index + 4].copy())


@primitive
def load8(table: Table, index: i64) -> F32x8:
    """Eight floats from float number `index` of a table on."""
    return F32x8(table.view(np.float32)[index : index + 8].copy())


@primitive
def load16(table: Table, index: i64) -> F32x16:
    """Sixteen floats from float number `index` of a table on."""
    return F32x16(table.view(np.float32)[index : index + 16].copy())


@primitive
def store4(table: Table, index: i64, a: F32x4) -> None:
    """Write four floats from float number `index` of a table on."""
    table.view(np.float32)[index : index + 4] = a.values


@primitive
def store8(table: Table, index: i64, a: F32x8) -> None:
    """Write eight floats from float number `index` of a table on."""
    table.view(np.float32)[index : index + 8] = a.values


@primitive
def store16(table: Table, index: i64, a: F32x16) -> None:
    """Write sixteen floats from float number `index` of a table on."""
    table.view(np.float32)[index : index + 16] = a.values


@primitive
def low4(a: F32x8) -> F32x4:
    """The first four lanes."""
    return F32x4(a.values[:4])


@primitive
def high4(a: F32x8) -> F32x4:
    """The last four lanes."""
    return F32x4(a.values[4:])


@primitive
def repeat4(a: F32x4) -> F32x16:
    """Four lanes, four times."""
    return F32x16(np.tile(a.values, 4))


@primitive
def vmin4(a: F32x4, b: F32x4) -> F32x4:
    """Smaller lane of each pair; the second where they cannot be compared."""
    return _select(a.values < b.values, a, b)


@primitive
def vmin8(a: F32x8, b: F32x8) -> F32x8:
    """Smaller lane of each pair; the second where they cannot be compared."""
    return _select(a.values < b.values, a, b)


@primitive
def vmin16(a: F32x16, b: F32x16) -> F32x16:
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
def vmax16(a: F32x16, b: F32x16) -> F32x16:
    """Larger lane of each pair; the second where they cannot be compared."""
    return _select(a.values > b.values, a, b)


@primitive
def flip4(a: F32x4, sign: F32x4) -> F32x4:
    """`a`, negated in the lanes where the sign bit of `sign` is set: ``flip4(a, a)`` is the absolute value."""
    return F32x4(np.where(np.signbit(sign.values), -a.values, a.values))


@primitive
def flip16(a: F32x16, sign: F32x16) -> F32x16:
    """`a`, negated in the lanes where the sign bit of `sign` is set: ``flip16(a, a)`` is the absolute value."""
    return F32x16(np.where(np.signbit(sign.values), -a.values, a.values))


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
def movemask16(mask: Mask16) -> i64:
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


@primitive
def count_bits(bits: i64) -> i64:
    """How many bits are set."""
    return bits.bit_count()


@primitive
def highest_bit(bits: i64) -> i64:
    """Number of the highest bit that is set; `bits` is not zero."""
    return bits.bit_length() - 1


@primitive
def push8(stack: Table, top: i64, codes: F32x8, bits: i64) -> None:
    """Write the bits of lanes as integers, one a word from word `top` on: the lanes whose bits are set. Uses eight words."""
    picked = codes.values.view(np.uint32)[Mask8((bits >> np.arange(8)) & 1 != 0).bits]
    stack.view(np.int64)[top : top + len(picked)] = picked


@primitive
def sort8(lengths: F32x8, codes: F32x8, chosen: Mask8) -> I64x8:
    """The `sort_key` of each lane's length, with its code as low half; descending, and last those that are not chosen.

    Of each length the three lowest bits are cleared, so that it takes only 32 bits to sort.
    """
    bits = np.where(chosen.bits, lengths.values.view(np.int32) & ~7 | np.arange(8), -8 | np.arange(8))
    order = np.argsort(-bits.astype(np.int64))
    return I64x8((bits[order].astype(np.int64) & ~7) << 32 | codes.values.view(np.uint32)[order])


@primitive
def push_all8(stack: Table, top: i64, keys: I64x8) -> None:
    """Write eight integers from word `top` on."""
    stack.view(np.int64)[top : top + 8] = keys.values


@primitive
def select8(choice: Mask8, a: F32x8, b: F32x8) -> F32x8:
    """`a` where `choice` is true, else `b`."""
    return _select(choice.bits, a, b)


@primitive
def sqrt8(a: F32x8) -> F32x8:
    """Square roots; NaN of what is negative."""
    with np.errstate(invalid="ignore"):
        return F32x8(np.sqrt(a.values))


@primitive
def select16(choice: Mask16, a: F32x16, b: F32x16) -> F32x16:
    """`a` where `choice` is true, else `b`."""
    return _select(choice.bits, a, b)


@primitive
def least16(a: F32x16) -> f64:
    """The smallest of sixteen floats, none of them NaN."""
    return float(a.values.min())


@primitive
def mask16(bits: i64) -> Mask16:
    """The lanes whose bits are set."""
    return Mask16((bits >> np.arange(16)) & 1 != 0)


@primitive
def round16(a: F64x16) -> F32x16:
    """Sixteen doubles rounded to floats."""
    with np.errstate(all="ignore"):
        return F32x16(a.values.astype(np.float32))


@primitive
def widen16(a: F32x16) -> F64x16:
    """Sixteen floats as doubles."""
    return F64x16(a.values)


@primitive
def splat16d(value: f64) -> F64x16:
    """One number in all sixteen lanes."""
    return F64x16(np.full(16, value))


@primitive
def load16d(table: Table, index: i64) -> F64x16:
    """Sixteen doubles from word `index` of a table on."""
    return F64x16(table.view(np.float64)[index : index + 16].copy())


@primitive
def store16d(table: Table, index: i64, a: F64x16) -> None:
    """Write sixteen doubles from word `index` of a table on."""
    table.view(np.float64)[index : index + 16] = a.values


@primitive
def select16d(choice: Mask16, a: F64x16, b: F64x16) -> F64x16:
    """`a` where `choice` is true, else `b`."""
    return _select(choice.bits, a, b)


@primitive
def vmin16d(a: F64x16, b: F64x16) -> F64x16:
    """Smaller lane of each pair; the second where they cannot be compared."""
    return _select(a.values < b.values, a, b)


@primitive
def vmax16d(a: F64x16, b: F64x16) -> F64x16:
    """Larger lane of each pair; the second where they cannot be compared."""
    return _select(a.values > b.values, a, b)


@primitive
def abs16d(a: F64x16) -> F64x16:
    """Absolute value of each lane."""
    return F64x16(np.abs(a.values))


@primitive
def sqrt16d(a: F64x16) -> F64x16:
    """Square roots; NaN of what is negative."""
    with np.errstate(invalid="ignore"):
        return F64x16(np.sqrt(a.values))


@primitive
def product16d(a: F64x16, b: F64x16) -> F64x16:
    """a * b, rounded: never fused with a sum, so that ``product(a, b) - product(c, d)`` is antisymmetric."""
    return _quietly(np.multiply, a, b)


@primitive
def transpose16(rows: Table, index: i64, target: Table, word: i64) -> None:
    """Read sixteen rows of three floats from float number `index` on; write sixteen doubles x, y, z from `word` on."""
    target.view(np.float64)[word : word + 48] = rows.view(np.float32)[index : index + 48].reshape(16, 3).T.reshape(-1)


@primitive
def transpose16d(rows: Table, index: i64, target: Table, word: i64) -> None:
    """Read sixteen rows of three doubles from word `index` on; write sixteen x, y, z from `word` on."""
    target.view(np.float64)[word : word + 48] = rows.view(np.float64)[index : index + 48].reshape(16, 3).T.reshape(-1)


@primitive
def prefetch(table: Table, index: i64) -> None:
    """Ask for the cache line of float number `index` of a table, which is soon to be read."""


@primitive
def put_ints16(table: Table, index: i64, a: F64x16) -> None:
    """Write sixteen doubles as 32-bit integers from number `index` on; they are whole."""
    table.view(np.int32)[index : index + 16] = a.values.astype(np.int32)


@primitive
def put_bytes16(table: Table, word: i64, mask: Mask16) -> None:
    """Write one byte a lane, 0 or 1, from 64-bit word `word` on."""
    table.view(np.uint8)[8 * word : 8 * word + 16] = mask.bits
