"""`Scene`: what there is to see, and how it is looked at."""

from __future__ import annotations

from typing import Any

from sightray.errors import SceneError
from sightray.fields import Color, child, choice, color, integer, other, text
from sightray.lights.base import Light
from sightray.registry import Member
from sightray.scene.instance import _Placed
from sightray.shapes.base import Shape


def _objects(values: Any) -> tuple[Any, ...]:
    try:
        values = tuple(values)
    except TypeError:
        raise SceneError(f"got {values!r}; allowed: a list of shapes, lights, groups and instances") from None
    for value in values:
        if not isinstance(value, Shape | Light | _Placed):
            raise SceneError(f"got {value!r}; allowed: shapes, lights, groups and instances")
    return values


class Scene(Member, family="scene"):
    """Shapes and lights, a camera, and what is behind it all. Immutable: `replace` gives a changed copy.

    Parameters
    ----------
    *objects : shapes, lights, `Group` and `Instance`, in any order.
    camera : what the picture is taken with; None for scenes that are only asked, never rendered.
    background : linear colour where a ray meets nothing.
    ambient : light that reaches every surface from everywhere, times the material's ambient colour.
    integrator : used by `render` where none is given.
    samples : per pixel, used by `render` where none are given.
    transfer : how bytes are made: "srgb" (round) or "floor" (the course rule: no gamma, rounded down).
    """

    objects: tuple[Any, ...] = other("shapes, lights, groups and instances", _objects, default=(), plain=list)
    camera: Any = child("what the picture is taken with", "cameras", default=None, optional=True, packed=False)
    background: Color = color("where a ray meets nothing", default=0.0)
    ambient: Color = color("light from everywhere", default=0.0)
    integrator: Any = child("how light is computed", "integrators", default=None, optional=True, packed=False)
    samples: int = integer("rays of sight per pixel", default=1, at_least=1, at_most=1 << 20)
    transfer: str = choice("how bytes are made", ("srgb", "floor"), default="srgb")
    name: str = text("title", default="")

    def __init__(self, *objects: Any, **values: Any) -> None:
        if objects:
            values["objects"] = objects
        super().__init__(**values)
        object.__setattr__(self, "_compiled", {})

    @property
    def lights(self) -> tuple[Light, ...]:
        """The lights among the objects."""
        return tuple(o for o in self.objects if isinstance(o, Light))

    def __repr__(self) -> str:
        return f"<Scene {self.name or 'untitled'}: {len(self.objects)} objects, {len(self.lights)} of them lights>"
