"""Arrays as users give them, chunk by chunk as kernels read them; no array is ever copied as a whole."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from sightray._jit import enabled
from sightray.errors import SceneError
from sightray.mathlib.table import Table

_DIRECT = {np.dtype(np.float64): 0, np.dtype(np.float32): 1}  # what kernels read; the value is the form's lowest bit
_FAR = 1 << 30  # more numbers than this are not stepped over
_PYTHON = not enabled()  # kernels then read NumPy arrays, not addresses


def numbers(value: Any, width: int, verb: str, name: str) -> np.ndarray:
    """`value` as an array of numbers, (..., 3) if `width` is 3, or a `SceneError`."""
    try:
        array = np.asarray(value)
    except ValueError:
        array = np.asarray(None)
    if array.dtype.kind in "iuf" and (width == 1 or array.shape[-1:] == (width,)):
        return array
    wanted = f"an array of numbers of shape (..., {width})" if width > 1 else "a number, or an array of numbers"
    got = f"shape {array.shape} of {array.dtype}" if isinstance(value, np.ndarray) else _short(value)
    raise SceneError(f"{verb}: {name}: got {got}; allowed: {wanted}")


def common_shape(verb: str, **arrays: tuple[int, ...]) -> tuple[int, ...]:
    """The shape of a batch: all shapes broadcast against one another."""
    shapes = list(arrays.values())
    if all(shape == shapes[0] or shape == () for shape in shapes):
        return shapes[0] if shapes[0] else next((shape for shape in shapes if shape), ())
    try:
        return np.broadcast_shapes(*shapes)
    except ValueError:
        got = ", ".join(f"{name} {shape}" for name, shape in arrays.items())
        raise SceneError(f"{verb}: got shapes {got}; allowed: shapes that broadcast against one another") from None


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) < 80 else text[:77] + "..."


class Pointer:
    """A place in memory, for machine code; a hundredth of the time that a `Table` takes to make."""

    __slots__ = ("address",)

    def __init__(self, address: int):
        self.address = address


class Output:
    """An array that kernels fill or read chunk by chunk: row i is of ray i."""

    __slots__ = ("address", "array", "row_bytes")

    def __init__(self, array: np.ndarray, address: int = 0):
        self.array, self.address = array, address or array.ctypes.data
        self.row_bytes = array.strides[0]

    def chunk(self, first: int, last: int) -> Pointer | Table:
        """The rows `first` to ``last - 1``."""
        if _PYTHON:
            return Table(self.array[first:last])
        return Pointer(self.address + first * self.row_bytes)


class Column:
    """One input of a batch: `width` numbers for each ray.

    Kernels read it where it lies if it is single or double precision, and both rays and the numbers of a ray follow one
    another at constant steps: as rows of three, as three rows, with other columns between. All else is converted to
    double precision, chunk by chunk. Its `form` says how it lies: see `query_kernels`.
    """

    __slots__ = ("address", "array", "form", "shape", "size", "step", "width")

    def __init__(self, array: np.ndarray, shape: tuple[int, ...], width: int):
        self.width, self.shape = width, shape
        single, step, apart = _DIRECT.get(array.dtype, -1), -1, 1
        if array.size == width:  # one for all rays
            array, step = (array if single >= 0 and array.flags.c_contiguous else _doubles(array)), 0
            single = max(single, 0) if array.dtype == np.float32 else 0
        elif single >= 0 and array.flags.aligned and 0 < array.size == width * math.prod(shape):
            step, apart = _steps(array, width)
        self.array, self.step, self.size = array, step, array.itemsize
        self.form = apart << 32 | step << 1 | single if step >= 0 else 1 << 32 | width << 1
        self.address = array.ctypes.data if step >= 0 else 0

    def chunk(self, first: int, last: int) -> Pointer | Table:
        """The numbers of rays `first` to ``last - 1``, `last` > `first`."""
        if self.step >= 0 and not _PYTHON:
            return Pointer(self.address + first * self.step * self.size)
        width = self.width
        if self.step == 0:
            return Table(self.array.reshape(-1))
        full = np.broadcast_to(self.array, self.shape + ((width,) if width > 1 else ()))
        if self.step > 0:  # plain Python follows no pointers: the same steps in memory of its own
            apart = self.form >> 32
            places = np.arange(last - first)[:, None] * self.step + np.arange(width) * apart
            numbers = np.zeros(places.max() + 1, self.array.dtype)
            numbers[places] = full.reshape(-1, width)[first:last]
            return Table(numbers)
        if len(self.shape) == 1:
            return Table(np.array(full[first:last], np.float64, order="C"))
        return Table(np.array(full.flat[width * first : width * last], np.float64))


def _doubles(array: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(array, np.float64).reshape(array.shape)


def _steps(array: np.ndarray, width: int) -> tuple[int, int]:
    """Steps in numbers from ray to ray, and from one number of a ray to the next, if they are constant; or else -1 first."""
    size, rays = array.itemsize, array.ndim - (width > 1)
    apart = array.strides[-1] if width > 1 else size
    axes = [(n, stride) for n, stride in zip(array.shape[:rays], array.strides[:rays], strict=True) if n > 1]
    rows = all(a[1] == b[0] * b[1] for a, b in itertools.pairwise(axes))  # one axis is as good as these
    step = axes[-1][1]
    if rows and 0 < step < _FAR * size and 0 < apart < _FAR * size and step % size == 0 and apart % size == 0:
        return step // size, apart // size
    return -1, 1
