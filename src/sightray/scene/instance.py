"""`Group` and `Instance`: objects put together, and put somewhere else without being copied."""

from __future__ import annotations

from typing import Any

from sightray.errors import SceneError
from sightray.fields import child, other, text
from sightray.lights.base import Light
from sightray.mathlib.transform import Transform, as_transform
from sightray.registry import Member
from sightray.shapes.base import Shape

MAX_NESTING = 64


class _Placed(Member, family="scene"):
    """What groups and instances share."""

    transform: Transform = other(
        "object to world", as_transform, default=None, plain=lambda t: None if t.is_identity else t.matrix.tolist()
    )
    name: str = text("label for people and datasets", default="")


def _objects(values: Any) -> tuple[Any, ...]:
    """Check the parts of a group."""
    try:
        parts = tuple(values)
    except TypeError:
        raise SceneError(f"got {values!r}; allowed: a list of shapes, instances and groups") from None
    for part in parts:
        if not isinstance(part, Shape | _Placed):
            kind = "a light" if isinstance(part, Light) else repr(part)
            raise SceneError(f"got {kind}; allowed: shapes, instances and groups")
        if depth(part) >= MAX_NESTING:
            raise SceneError(f"nested deeper than {MAX_NESTING} levels; allowed: at most {MAX_NESTING}")
    return parts


def _remember_depth(part: Any, inner: tuple[Any, ...]) -> None:
    """Keep the depth with the part: asking all the way down takes exponential time where parts are shared."""
    object.__setattr__(part, "levels", 1 + max((depth(p) for p in inner), default=0))


class Group(_Placed):
    """Several objects that move as one and count as one instance in labels."""

    objects: tuple[Any, ...] = other("the parts: shapes, instances, groups", _objects, plain=list)

    def check(self) -> None:
        _remember_depth(self, self.objects)


def _placeable(value: Any) -> Any:
    if not isinstance(value, Shape | _Placed):
        raise SceneError(f"got {value!r}; allowed: a shape, a group or an instance")
    if depth(value) >= MAX_NESTING:
        raise SceneError(f"nested deeper than {MAX_NESTING} levels; allowed: at most {MAX_NESTING}")
    return value


class Instance(_Placed):
    """An object once more, elsewhere: triangles and their tree are shared, not copied."""

    of: Any = other("the shape, group or instance that is shown again", _placeable)
    material: Any = child("replaces the material of what is shown; None keeps it", "materials", default=None,
                          optional=True, packed=False)  # fmt: skip

    def check(self) -> None:
        _remember_depth(self, (self.of,))


def depth(part: Any) -> int:
    """Levels of nesting below and including `part`; 0 for a plain shape. Known from when the part was made."""
    return getattr(part, "levels", 0)
