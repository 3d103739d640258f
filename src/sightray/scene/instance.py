"""`Group` and `Instance`: objects put together, and put somewhere else without being copied."""

from __future__ import annotations

from typing import Any

from sightray.errors import SceneError
from sightray.fields import child, other, text
from sightray.lights.base import Light
from sightray.mathlib.motion import Motion, as_motion, plain_motion
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
    motion: Motion | None = other("keyframes [seconds, transform], before `transform` is applied", as_motion,
                                  default=None, plain=plain_motion)  # fmt: skip

    def frozen(self, time: float) -> Any:
        """The same as it is at a time, seconds: no part of it moves."""
        if not moves(self):
            return self
        here = self.transform if self.motion is None else self.transform @ self.motion.at(time)
        return self.replace(transform=here, motion=None, **self._parts_at(time))

    def _parts_at(self, time: float) -> dict[str, Any]:
        raise NotImplementedError


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


def moves(thing: Any) -> bool:
    """Whether an object or any part of it moves."""
    if isinstance(thing, Group):
        return thing.motion is not None or any(moves(part) for part in thing.objects)
    return isinstance(thing, Instance) and (thing.motion is not None or moves(thing.of))


def frozen(thing: Any, time: float) -> Any:
    """One of a scene's objects as it is at a time, seconds."""
    return thing.frozen(time) if isinstance(thing, _Placed) else thing


class Group(_Placed):
    """Several objects that move as one and count as one instance in labels.

    `transform` places the group, and `motion` moves it before that, in its own space: where its parts are at a time is
    ``transform @ motion(time)``. A wheel that turns about its own axis is placed by `transform` and turned by `motion`.
    Between keyframes a motion goes on evenly (see `mathlib.motion`); what it shows is decided by the camera's shutter.
    """

    objects: tuple[Any, ...] = other("the parts: shapes, instances, groups", _objects, plain=list)

    def check(self) -> None:
        _remember_depth(self, self.objects)

    def _parts_at(self, time: float) -> dict[str, Any]:
        return {"objects": [frozen(part, time) for part in self.objects]}


def _placeable(value: Any) -> Any:
    if not isinstance(value, Shape | _Placed):
        raise SceneError(f"got {value!r}; allowed: a shape, a group or an instance")
    if depth(value) >= MAX_NESTING:
        raise SceneError(f"nested deeper than {MAX_NESTING} levels; allowed: at most {MAX_NESTING}")
    return value


class Instance(_Placed):
    """An object once more, elsewhere: triangles and their tree are shared, not copied. It may move, as a `Group` does."""

    of: Any = other("the shape, group or instance that is shown again", _placeable)
    material: Any = child("replaces the material of what is shown; None keeps it", "materials", default=None,
                          optional=True, packed=False)  # fmt: skip

    def check(self) -> None:
        _remember_depth(self, (self.of,))

    def _parts_at(self, time: float) -> dict[str, Any]:
        return {"of": frozen(self.of, time)}


def depth(part: Any) -> int:
    """Levels of nesting below and including `part`; 0 for a plain shape. Known from when the part was made."""
    return getattr(part, "levels", 0)
