"""Members and families: what `Sphere`, `Glass`, `PointLight` and all their kin have in common.

A *family* is a folder (``shapes``, ``materials`` ...); a *member* is one class in one file of it, or in the user's own
code: a class becomes known by being defined. Everything that lists members (the YAML reader, the docs, the family
tests) asks this registry.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, ClassVar

import sightray.fields as _fields
from sightray._jit import METHOD_SLOTS
from sightray.errors import SceneError, unknown
from sightray.fields import REQUIRED, Derived, Field

if TYPE_CHECKING:
    from typing_extensions import Self, dataclass_transform
else:

    def dataclass_transform(**_: Any) -> Callable:
        return lambda cls: cls


FAMILIES = (
    "shapes",
    "materials",
    "textures",
    "lights",
    "cameras",
    "integrators",
    "filters",
    "samplers",
    "media",
    "scene",
    "accelerators",
    "vision.layers",
    "vision.writers",
    "vision.depth_sensors",
)
_members: dict[str, dict[str, type[Member]]] = {name: {} for name in FAMILIES}


@dataclass_transform(kw_only_default=True, field_specifiers=(
    _fields.number, _fields.integer, _fields.flag, _fields.choice, _fields.text, _fields.vector, _fields.color,
    _fields.array, _fields.child, _fields.other))  # fmt: skip
class Member:
    """Base of every family's base class: fields from the class body, checked on construction, then immutable."""

    family: ClassVar[str] = ""
    fields: ClassVar[dict[str, Field]] = {}
    given: ClassVar[dict[str, Field]] = {}  # without the derived ones
    kernels: ClassVar[dict[Callable, Callable]] = {}

    def __init_subclass__(cls, family: str | None = None, **options: Any) -> None:
        super().__init_subclass__(**options)
        own = {name: value for name, value in vars(cls).items() if isinstance(value, Field)}
        cls.fields = {**cls.fields, **own}
        cls.given = {name: field for name, field in cls.fields.items() if not isinstance(field, Derived)}
        cls.__signature__ = _signature(cls.given)  # type: ignore[attr-defined]
        if family is not None:
            cls.family = family
        elif not cls.__name__.startswith("_"):
            _members[cls.family][cls.__name__] = cls

    def __init__(self, **values: Any) -> None:
        kind = type(self).__name__
        given = self.given
        for name in values:
            if name not in given:
                raise SceneError(f"{kind}: {unknown('field', name, given)}")
        for name, field in given.items():
            value = values.get(name, field.default)
            if value is REQUIRED:
                raise SceneError(f"{kind}.{name}: missing; it needs {field.allowed()}: {field.doc}")
            try:
                object.__setattr__(self, name, field.convert(value))
            except SceneError as error:
                raise SceneError(f"{kind}.{name}: {error}") from None
        self.check()

    def check(self) -> None:
        """Raise a `SceneError` if fields contradict one another."""

    def replace(self, **changes: Any) -> Self:
        """The same member with some fields changed."""
        return type(self)(**{**self.values(), **changes})

    def values(self) -> dict[str, Any]:
        """Field values by name, without derived ones."""
        return {name: getattr(self, name) for name in self.given}

    @classmethod
    def offsets(cls) -> tuple[int, ...]:
        """First word of each field that stands in the row, in the order in which the class states them."""
        return tuple(word for _, word in cls._layout())

    @classmethod
    def _layout(cls) -> Iterator[tuple[str, int]]:
        word = METHOD_SLOTS
        for name, field in cls.fields.items():
            if field.words:
                yield name, word
                word += field.words

    @classmethod
    def row_words(cls) -> int:
        """Length of the row in eight-byte words."""
        return METHOD_SLOTS + sum(field.words for field in cls.fields.values())

    def pack(self, row: Any, packer: Any) -> None:
        """Write all fields into a row."""
        for name, word in self._layout():
            field = self.fields[name]
            field.pack(row, word, self if isinstance(field, Derived) else getattr(self, name), packer)

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"{type(self).__name__} is immutable; use .replace({name}=...)")

    def __repr__(self) -> str:
        shown = [f"{name}={_short(value)}" for name, value in self.values().items() if not _default(self, name)]
        return f"{type(self).__name__}({', '.join(shown)})"


def _default(member: Member, name: str) -> bool:
    field = member.fields[name]
    if field.default is REQUIRED:
        return False
    try:
        return bool(field.convert(field.default) == getattr(member, name))
    except (SceneError, ValueError):
        return False


def _short(value: Any) -> str:
    shape = getattr(value, "shape", None)
    return f"<array {shape} {value.dtype}>" if shape else repr(value)


def _signature(fields: dict[str, Field]) -> inspect.Signature:
    keyword = inspect.Parameter.KEYWORD_ONLY
    return inspect.Signature([
        inspect.Parameter(name, keyword, default=inspect.Parameter.empty if f.default is REQUIRED else f.default)
        for name, f in fields.items()
    ])  # fmt: skip


def members(family: str) -> dict[str, type[Member]]:
    """All members of a family by class name: those in its folder, and those that users defined."""
    _discover(family)
    return dict(_members[family])


def find(family: str, name: str) -> type[Member]:
    """The member of that name, or a `SceneError` that offers the nearest one."""
    known = members(family)
    if name not in known:
        raise SceneError(unknown(family.removesuffix("s"), name, known))
    return known[name]


_discovered: set[str] = set()


def _discover(family: str) -> None:
    if family in _discovered:
        return
    _discovered.add(family)
    package = importlib.import_module(f"sightray.{family}")
    for module in pkgutil.iter_modules(package.__path__):
        if not module.name.endswith("_llvm"):
            importlib.import_module(f"sightray.{family}.{module.name}")
