"""Fields: what the constructors of members take, how each value is checked, and where it stands in the member's row.

A class states its fields once::

    class Sphere(Shape):
        center: Point = vector("centre", default=(0, 0, 0), unit="m")
        radius: float = number("radius", default=1.0, above=0, unit="m")

and from that follow its constructor, `repr`, row layout, YAML keys and row in the docs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np

from sightray.errors import SceneError, unknown
from sightray.mathlib.table import Space, Table, link

REQUIRED: Any = object()  # the default of a field that must be given
Point = tuple[float, float, float]
Color = tuple[float, float, float]


class Packer(Protocol):
    """What packing needs of the scene compiler: memory, and the rows of other members."""

    space: Space

    def row_of(self, member: Any) -> Table: ...


class Field:
    """One named value of a member. Subclasses check it (`convert`) and lay it into a row (`pack`)."""

    words = 0  # eight-byte words in the row; 0 for values that kernels do not read

    def __init__(self, doc: str, default: Any = REQUIRED, unit: str = ""):
        self.doc, self.default, self.unit = doc, default, unit
        self.name = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def convert(self, value: Any) -> Any:
        """The value in canonical form, or a `SceneError` that says what is allowed."""
        return value

    def pack(self, row: Table, word: int, value: Any, packer: Packer) -> None:
        """Write the value into its words of a row."""

    def plain(self, value: Any) -> Any:
        """The value as numbers, strings and lists, for YAML."""
        return value

    def allowed(self) -> str:
        """What is allowed, in words."""
        return "any value"

    def wrong(self, value: Any) -> SceneError:
        shown = repr(value)
        shown = shown if len(shown) < 80 else shown[:77] + "..."
        return SceneError(f"got {shown}; allowed: {self.allowed()}")


class Number(Field):
    words = 1

    def __init__(self, doc: str, default: Any = REQUIRED, unit: str = "", *, above: float | None = None,
                 at_least: float | None = None, below: float | None = None, at_most: float | None = None,
                 optional: bool = False):  # fmt: skip
        super().__init__(doc, default, unit)
        self.bounds = ((above, ">"), (at_least, ">="), (below, "<"), (at_most, "<="))
        self.optional = optional

    def convert(self, value: Any) -> float | None:
        if value is None and self.optional:
            return None
        number = self._read(value)
        for bound, sign in self.bounds:
            if bound is not None and not _COMPARE[sign](number, bound):
                raise self.wrong(value)
        return number

    def _read(self, value: Any) -> float:
        if isinstance(value, bool | np.bool_ | str) or not _is_scalar(value) or not math.isfinite(value):
            raise self.wrong(value)
        return float(value)

    def pack(self, row: Table, word: int, value: Any, packer: Packer) -> None:
        row.view(np.float64)[word] = math.nan if value is None else value

    def allowed(self) -> str:
        limits = " and ".join(f"{sign} {bound:g}" for bound, sign in self.bounds if bound is not None)
        text = f"a finite number {limits}".rstrip() + (f" ({self.unit})" if self.unit else "")
        return text + (", or None" if self.optional else "")


class Integer(Number):
    def _read(self, value: Any) -> int:
        if isinstance(value, bool | np.bool_ | str) or not _is_scalar(value) or value != value or int(value) != value:
            raise self.wrong(value)
        return int(value)

    def convert(self, value: Any) -> Any:
        try:
            return super().convert(value)
        except OverflowError:
            raise self.wrong(value) from None

    def pack(self, row: Table, word: int, value: Any, packer: Packer) -> None:
        row.view(np.int64)[word] = value

    def allowed(self) -> str:
        return super().allowed().replace("a finite number", "a whole number")


class Flag(Field):
    words = 1

    def convert(self, value: Any) -> bool:
        if not isinstance(value, bool | np.bool_):
            raise self.wrong(value)
        return bool(value)

    def pack(self, row: Table, word: int, value: Any, packer: Packer) -> None:
        row.view(np.int64)[word] = value

    def allowed(self) -> str:
        return "true or false"


class Choice(Field):
    """One of a few names; kernels see its index."""

    words = 1

    def __init__(self, doc: str, options: Sequence[str], default: Any = REQUIRED):
        super().__init__(doc, default)
        self.options = tuple(options)

    def convert(self, value: Any) -> str:
        if value not in self.options:
            raise SceneError(unknown("choice", str(value), self.options))
        return str(value)

    def pack(self, row: Table, word: int, value: Any, packer: Packer) -> None:
        row.view(np.int64)[word] = self.options.index(value)

    def allowed(self) -> str:
        return ", ".join(self.options)


class Text(Field):
    def convert(self, value: Any) -> str:
        if not isinstance(value, str):
            raise self.wrong(value)
        return value

    def allowed(self) -> str:
        return "a string"


class Vector(Field):
    """Three finite numbers."""

    words = 4

    def __init__(self, doc: str, default: Any = REQUIRED, unit: str = "", *, nonzero: bool = False,
                 above: float | None = None):  # fmt: skip
        super().__init__(doc, default, unit)
        self.nonzero, self.above = nonzero, above

    def convert(self, value: Any) -> Point:
        numbers = _finite(value, (3,))
        if numbers is None or (self.nonzero and not numbers.any()):
            raise self.wrong(value)
        if self.above is not None and not (numbers > self.above).all():
            raise self.wrong(value)
        x, y, z = numbers.tolist()
        return x, y, z

    def pack(self, row: Table, word: int, value: Any, packer: Packer) -> None:
        row.view(np.float64)[word : word + 3] = value

    def plain(self, value: Any) -> Any:
        return list(value)

    def allowed(self) -> str:
        limit = f" > {self.above:g}" if self.above is not None else ""
        return f"three finite numbers{limit}" + (", not all zero" if self.nonzero else "") + (
            f" ({self.unit})" if self.unit else "")  # fmt: skip


class ColorField(Vector):
    """Linear Rec. 709: three numbers, or one for grey; at least 0 and at most `at_most`."""

    def __init__(self, doc: str, default: Any = REQUIRED, unit: str = "", *, at_most: float = math.inf):
        super().__init__(doc, default, unit)
        self.at_most = at_most

    def convert(self, value: Any) -> Color:
        grey = _is_scalar(value) and not isinstance(value, str | bool)
        numbers = _finite((value,) * 3 if grey else value, (3,))
        if numbers is None or (numbers < 0).any() or (numbers > self.at_most).any():
            raise self.wrong(value)
        r, g, b = numbers.tolist()
        return r, g, b

    def plain(self, value: Any) -> Any:
        return value[0] if value[0] == value[1] == value[2] else list(value)

    def allowed(self) -> str:
        top = f" and at most {self.at_most:g}" if math.isfinite(self.at_most) else ""
        return f"a linear colour: three finite numbers (or one for grey) of at least 0{top}"


class Array(Field):
    """A NumPy array with a fixed number of columns; kernels see a pointer to its first element."""

    words = 1

    def __init__(self, doc: str, dtype: Any, columns: int | None = None, default: Any = REQUIRED, unit: str = ""):
        super().__init__(doc, default, unit)
        self.dtype, self.columns = np.dtype(dtype), columns

    def convert(self, value: Any) -> np.ndarray | None:
        if value is None and self.default is None:
            return None
        try:
            raw = np.asarray(value)
            array = np.array(raw, dtype=self.dtype, order="C")
        except (TypeError, ValueError, OverflowError):
            raise self.wrong(value) from None
        if array.size == 0 and self.columns is not None:
            array = array.reshape(0, self.columns)
        shaped = array.ndim == (1 if self.columns is None else 2) and self.columns in (None, array.shape[-1])
        if (
            not shaped
            or raw.dtype.kind not in "iuf"
            or not np.isfinite(array).all()
            or ((array != raw).any() and (self.dtype.kind in "iu"))
        ):
            raise self.wrong(value)
        array.flags.writeable = False
        return array

    def pack(self, row: Table, word: int, value: Any, packer: Packer) -> None:
        link(row, word, None if value is None else packer.space.array(value))

    def plain(self, value: Any) -> Any:
        return None if value is None else value.tolist()

    def allowed(self) -> str:
        shape = "(n,)" if self.columns is None else f"(n, {self.columns})"
        kind = "whole numbers" if self.dtype.kind in "iu" else "finite numbers"
        return f"an array of {kind} of shape {shape}" + (f" ({self.unit})" if self.unit else "")


class Child(Field):
    """Another member; kernels see a pointer to its row."""

    words = 1

    def __init__(self, doc: str, family: str, default: Any = REQUIRED, *, optional: bool = False, packed: bool = True):
        super().__init__(doc, default)
        self.family, self.optional = family, optional
        if not packed:
            self.words = 0

    def convert(self, value: Any) -> Any:
        if value is None and self.optional:
            return None
        if getattr(type(value), "family", None) != self.family:
            raise self.wrong(value)
        return value

    def pack(self, row: Table, word: int, value: Any, packer: Packer) -> None:
        link(row, word, None if value is None else packer.row_of(value))

    def allowed(self) -> str:
        return f"one of the {self.family}" + (" or None" if self.optional else "")


class Other(Field):
    """A value with a check of its own, which kernels do not read directly."""

    def __init__(self, doc: str, check: Callable[[Any], Any], default: Any = REQUIRED, unit: str = "",
                 plain: Callable[[Any], Any] = lambda value: value):  # fmt: skip
        super().__init__(doc, default, unit)
        self.check, self._plain = check, plain

    def convert(self, value: Any) -> Any:
        return self.check(value)

    def plain(self, value: Any) -> Any:
        return self._plain(value)


class Derived(Field):
    """A value that kernels read and users do not give: computed from the other fields when the row is packed."""

    def __init__(self, doc: str, compute: Callable[[Any], Any], kind: type[Field]):
        super().__init__(doc)
        self.compute, self._kind = compute, kind
        self.words = kind.words

    def pack(self, row: Table, word: int, value: Any, packer: Packer) -> None:
        self._kind.pack(self, row, word, self.compute(value), packer)  # type: ignore[arg-type]


def derived_number(doc: str, compute: Callable[[Any], float]) -> Any:
    """A number that is computed from the other fields when the row is packed."""
    return Derived(doc, compute, Number)


def derived_integer(doc: str, compute: Callable[[Any], int]) -> Any:
    """A whole number that is computed from the other fields when the row is packed."""
    return Derived(doc, compute, Integer)


def derived_vector(doc: str, compute: Callable[[Any], Any]) -> Any:
    """Three numbers that are computed from the other fields when the row is packed."""
    return Derived(doc, compute, Vector)


def derived_array(doc: str, compute: Callable[[Any], np.ndarray | None]) -> Any:
    """An array that is computed from the other fields when the row is packed; kernels see a pointer."""
    return Derived(doc, compute, Array)


def derived_child(doc: str, compute: Callable[[Any], Any]) -> Any:
    """A member, or None, that is computed from the other fields when the row is packed."""
    return Derived(doc, compute, Child)


# The names that classes use: they return the field but are typed as the value, for constructors to read well.
def number(doc: str, default: Any = REQUIRED, **options: Any) -> Any:
    """A finite number, with optional bounds ``above at_least below at_most``."""
    return Number(doc, default, **options)


def integer(doc: str, default: Any = REQUIRED, **options: Any) -> Any:
    """A whole number, with optional bounds."""
    return Integer(doc, default, **options)


def flag(doc: str, default: Any = REQUIRED) -> Any:
    """True or false."""
    return Flag(doc, default)


def choice(doc: str, options: Sequence[str], default: Any = REQUIRED) -> Any:
    """One of a few names."""
    return Choice(doc, options, default)


def text(doc: str, default: Any = REQUIRED) -> Any:
    """A string."""
    return Text(doc, default)


def vector(doc: str, default: Any = REQUIRED, **options: Any) -> Any:
    """Three finite numbers."""
    return Vector(doc, default, **options)


def color(doc: str, default: Any = REQUIRED, **options: Any) -> Any:
    """A linear Rec. 709 colour: three numbers of at least 0, or one for grey."""
    return ColorField(doc, default, **options)


def array(doc: str, dtype: Any, columns: int | None = None, default: Any = REQUIRED, unit: str = "") -> Any:
    """A NumPy array of shape (n, columns), or (n,)."""
    return Array(doc, dtype, columns, default, unit)


def child(doc: str, family: str, default: Any = REQUIRED, *, optional: bool = False, packed: bool = True) -> Any:
    """A member of another family."""
    return Child(doc, family, default, optional=optional, packed=packed)


def other(doc: str, check: Callable[[Any], Any], default: Any = REQUIRED, **options: Any) -> Any:
    """A value with a check of its own."""
    return Other(doc, check, default, **options)


_COMPARE: dict[str, Callable[[float, float], bool]] = {
    ">": lambda a, b: a > b, ">=": lambda a, b: a >= b, "<": lambda a, b: a < b, "<=": lambda a, b: a <= b,
}  # fmt: skip


def _is_scalar(value: Any) -> bool:
    return isinstance(value, int | float | np.integer | np.floating) or (
        isinstance(value, np.ndarray) and value.ndim == 0 and value.dtype.kind in "iuf"
    )


def _finite(value: Any, shape: tuple[int, ...]) -> np.ndarray | None:
    """`value` as doubles if it is an array of finite numbers of that shape, else None."""
    try:
        raw = np.asarray(value)
    except ValueError:
        return None
    if raw.shape != shape or raw.dtype.kind not in "iuf" or not np.isfinite(raw).all():
        return None
    return raw.astype(np.float64)
