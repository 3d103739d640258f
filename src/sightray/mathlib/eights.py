"""`F64x8`, `I64x8`, `Vec3x8`: eight paths side by side, in double precision.

The counterparts of ``f64``, ``i64`` and `Vec3` for kernels that follow eight paths at once. Arithmetic is lane by lane,
and a plain number counts in all lanes. Comparisons give a `Mask8`: as some lanes may say yes and others no, there are no
branches but `select8d` and its kin, which take both results and choose. `eightfold` makes the eightfold form of a kernel
that has no branches anyway.
"""

from __future__ import annotations

import ctypes
import operator
import types
from collections.abc import Callable
from typing import Any

import numpy as np

from sightray._jit import primitive
from sightray.mathlib import rng
from sightray.mathlib.digits import reverse_bits, scramble_reversed, sobol_y
from sightray.mathlib.lanes import F32x8, Lanes, Mask8
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table
from sightray.mathlib.vec import Vec3
from sightray.mathlib.warp import cosine_of_octant, sine_of_octant


def _plain(value: Any) -> Any:
    return value.values if isinstance(value, Lanes) else value


def _operator(operation: Callable[[Any, Any], Any], swapped: bool = False) -> Any:
    def apply(self: Any, other: Any) -> Any:
        a, b = self.values, _plain(other)
        with np.errstate(all="ignore"):
            found = operation(b, a) if swapped else operation(a, b)
        return Mask8(found) if found.dtype == bool else type(self)(found)

    return apply


class _Eight(Lanes):
    """What eight doubles and eight integers have in common."""

    width, mask = 8, Mask8
    __add__, __radd__ = _operator(operator.add), _operator(operator.add)
    __sub__, __rsub__ = _operator(operator.sub), _operator(operator.sub, swapped=True)
    __mul__, __rmul__ = _operator(operator.mul), _operator(operator.mul)
    __lt__, __le__ = _operator(operator.lt), _operator(operator.le)
    __gt__, __ge__ = _operator(operator.gt), _operator(operator.ge)


class F64x8(_Eight):
    """Eight doubles."""

    dtype = np.float64
    __truediv__, __rtruediv__ = _operator(operator.truediv), _operator(operator.truediv, swapped=True)

    def __neg__(self) -> F64x8:
        return F64x8(-self.values)


class I64x8(_Eight):
    """Eight integers; overflow wraps, shifts to the right keep the sign."""

    dtype = np.int64
    __xor__, __and__, __or__ = _operator(operator.xor), _operator(operator.and_), _operator(operator.or_)
    __rshift__, __lshift__ = _operator(operator.rshift), _operator(operator.lshift)
    __eq__, __ne__ = _operator(operator.eq), _operator(operator.ne)  # type: ignore[assignment]
    __hash__ = None  # type: ignore[assignment]


class Vec3x8:
    """Eight points, directions or colours."""

    __slots__ = ("x", "y", "z")

    def __init__(self, x: F64x8, y: F64x8, z: F64x8):
        self.x, self.y, self.z = x, y, z

    def __add__(self, other: Vec3x8) -> Vec3x8:
        return Vec3x8(self.x + other.x, self.y + other.y, self.z + other.z)

    def __sub__(self, other: Vec3x8) -> Vec3x8:
        return Vec3x8(self.x - other.x, self.y - other.y, self.z - other.z)

    def __mul__(self, other: Vec3x8 | F64x8 | float) -> Vec3x8:
        x, y, z = (other.x, other.y, other.z) if isinstance(other, Vec3x8) else (other, other, other)
        return Vec3x8(self.x * x, self.y * y, self.z * z)

    def __neg__(self) -> Vec3x8:
        return Vec3x8(-self.x, -self.y, -self.z)


@primitive
def splat8d(value: f64) -> F64x8:
    """One number in all eight lanes."""
    return F64x8(np.full(8, value))


@primitive
def splat8i(value: i64) -> I64x8:
    """One integer in all eight lanes."""
    return I64x8(np.full(8, value, np.int64))


@primitive
def splat8v(value: Vec3) -> Vec3x8:
    """One vector in all eight lanes."""
    return Vec3x8(splat8d(value.x), splat8d(value.y), splat8d(value.z))


@primitive
def load8d(table: Table, index: i64) -> F64x8:
    """Eight doubles from word `index` of a table on."""
    return F64x8(table.view(np.float64)[index : index + 8].copy())


@primitive
def load8i(table: Table, index: i64) -> I64x8:
    """Eight integers from word `index` of a table on."""
    return I64x8(table.view(np.int64)[index : index + 8].copy())


@primitive
def store8d(table: Table, index: i64, a: F64x8) -> None:
    """Write eight doubles from word `index` of a table on."""
    table.view(np.float64)[index : index + 8] = a.values


@primitive
def store8i(table: Table, index: i64, a: I64x8) -> None:
    """Write eight integers from word `index` of a table on."""
    table.view(np.int64)[index : index + 8] = a.values


@primitive
def gather8d(table: Table, index: I64x8) -> F64x8:
    """The doubles in eight words, counted from a table; they may be those of others."""
    return F64x8([ctypes.c_double.from_address(table.address + 8 * int(k)).value for k in index.values])


@primitive
def gather8i(table: Table, index: I64x8) -> I64x8:
    """The integers in eight words, counted from a table; they may be those of others."""
    return I64x8([ctypes.c_int64.from_address(table.address + 8 * int(k)).value for k in index.values])


@primitive
def gather8f(table: Table, index: I64x8) -> F64x8:
    """The floats at eight places, counted in floats from a table."""
    return F64x8([ctypes.c_float.from_address(table.address + 4 * int(k)).value for k in index.values])


@primitive
def store_chosen8d(table: Table, index: i64, a: F64x8, chosen: Mask8) -> None:
    """Write the chosen of eight doubles side by side from word `index` on; up to eight words are overwritten."""
    kept = a.values[chosen.bits]
    table.view(np.float64)[index : index + len(kept)] = kept


@primitive
def store_chosen8i(table: Table, index: i64, a: I64x8, chosen: Mask8) -> None:
    """Write the chosen of eight integers side by side from word `index` on; up to eight words are overwritten."""
    kept = a.values[chosen.bits]
    table.view(np.int64)[index : index + len(kept)] = kept


@primitive
def select8d(choice: Mask8, a: F64x8, b: F64x8) -> F64x8:
    """`a` where `choice` is true, else `b`."""
    return F64x8(np.where(choice.bits, a.values, b.values))


@primitive
def select8i(choice: Mask8, a: I64x8, b: I64x8) -> I64x8:
    """`a` where `choice` is true, else `b`."""
    return I64x8(np.where(choice.bits, a.values, b.values))


@primitive
def select8v(choice: Mask8, a: Vec3x8, b: Vec3x8) -> Vec3x8:
    """`a` where `choice` is true, else `b`."""
    return Vec3x8(select8d(choice, a.x, b.x), select8d(choice, a.y, b.y), select8d(choice, a.z, b.z))


@primitive
def not8(choice: Mask8) -> Mask8:
    """The lanes that are not chosen."""
    return Mask8(~choice.bits)


@primitive
def mask8(bits: i64) -> Mask8:
    """The lanes whose bits are set."""
    return Mask8((bits >> np.arange(8)) & 1 != 0)


@primitive
def vmin8d(a: F64x8, b: F64x8) -> F64x8:
    """Smaller lane of each pair; the second where they cannot be compared."""
    return select8d(a < b, a, b)


@primitive
def vmax8d(a: F64x8, b: F64x8) -> F64x8:
    """Larger lane of each pair; the second where they cannot be compared."""
    return select8d(a > b, a, b)


@primitive
def abs8d(a: F64x8) -> F64x8:
    """Absolute value of each lane."""
    return F64x8(np.abs(a.values))


@primitive
def sqrt8d(a: F64x8) -> F64x8:
    """Square roots; NaN of what is negative."""
    with np.errstate(invalid="ignore"):
        return F64x8(np.sqrt(a.values))


@primitive
def bits8d(a: F64x8) -> I64x8:
    """The 64 bits of each double."""
    return I64x8(a.values.view(np.int64))


@primitive
def of_bits8d(a: I64x8) -> F64x8:
    """The doubles that these bits are."""
    return F64x8(a.values.view(np.float64))


@primitive
def sign8d(a: F64x8) -> F64x8:
    """1 with the sign of each lane, that of zero included."""
    return F64x8(np.copysign(1.0, a.values))


@primitive
def whole8d(a: I64x8) -> F64x8:
    """Integers as doubles."""
    return F64x8(a.values.astype(np.float64))


@primitive
def whole8i(a: F32x8) -> I64x8:
    """Floats that are whole numbers as integers."""
    return I64x8(a.values.astype(np.int64))


@primitive
def floor8i(a: F64x8) -> I64x8:
    """Doubles that are not negative as integers, rounded down."""
    return I64x8(a.values.astype(np.int64))


@primitive
def floor8d(a: F64x8) -> F64x8:
    """The largest whole numbers that are not above each lane."""
    return F64x8(np.floor(a.values))


@primitive
def round8d(a: F64x8) -> F32x8:
    """Eight doubles rounded to floats."""
    with np.errstate(all="ignore"):
        return F32x8(a.values.astype(np.float32))


@primitive
def dot8(a: Vec3x8, b: Vec3x8) -> F64x8:
    """Scalar products."""
    return a.x * b.x + a.y * b.y + a.z * b.z


@primitive
def cross8(a: Vec3x8, b: Vec3x8) -> Vec3x8:
    """Vector products."""
    return Vec3x8(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)


@primitive
def reverse8(x: I64x8) -> I64x8:
    """All 64 bits of each lane in reverse order."""
    return I64x8([reverse_bits(int(value)) for value in x.values])


@primitive
def stream8(key: I64x8, index: I64x8) -> I64x8:
    """The keys of sub-streams, see `rng.stream`."""
    return I64x8([rng.stream(int(k), int(n)) for k, n in zip(key.values, index.values, strict=True)])


@primitive
def word8(key: I64x8, dimension: I64x8) -> I64x8:
    """The 64 random bits of one dimension of each key, see `rng.word`."""
    return I64x8([rng.word(int(k), int(n)) for k, n in zip(key.values, dimension.values, strict=True)])


def eightfold(function: Callable) -> Any:
    """The kernel `function`, which has no branches and calls no other, for eight lanes of each number."""
    lanes = {"f64": F64x8, "i64": I64x8}
    name = f"{function.__name__}8"
    found = types.FunctionType(function.__code__, function.__globals__, name)  # type: ignore[attr-defined]
    found.__module__, found.__qualname__, found.__doc__ = __name__, name, function.__doc__
    found.__annotations__ = {key: lanes[hint] for key, hint in function.__annotations__.items()}
    found.__kernel__ = function.__kernel__  # type: ignore[attr-defined]
    return found


scramble_reversed8 = eightfold(scramble_reversed)
sobol_y8 = eightfold(sobol_y)
sine_of_octant8 = eightfold(sine_of_octant)
cosine_of_octant8 = eightfold(cosine_of_octant)
