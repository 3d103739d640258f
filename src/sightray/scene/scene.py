"""`Scene`: what there is to see, and how it is looked at."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from sightray.errors import SceneError
from sightray.fields import Color, child, choice, color, integer, other, text
from sightray.lights.base import Light
from sightray.registry import Member
from sightray.scene.instance import _Placed, frozen
from sightray.shapes.base import Shape

if TYPE_CHECKING:
    import numpy as np

    from sightray.scene.hits import ClosestPoints, Hits, Layers


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
    medium : what fills the space around the objects, such as fog; None for a vacuum.
    integrator : used by `render` where none is given.
    samples : per pixel, used by `render` where none are given.
    transfer : how bytes are made: "srgb" (round), "floor" (the course rule: no gamma, rounded down) or "gamma2.2" (the
        course rule with gamma).
    """

    objects: tuple[Any, ...] = other("shapes, lights, groups and instances", _objects, default=(), plain=list)
    camera: Any = child("what the picture is taken with", "cameras", default=None, optional=True, packed=False)
    background: Color = color("where a ray meets nothing", default=0.0)
    ambient: Color = color("light from everywhere", default=0.0)
    medium: Any = child("what fills the space around the objects, such as fog", "media", default=None, optional=True,
                        packed=False)  # fmt: skip
    integrator: Any = child("how light is computed", "integrators", default=None, optional=True, packed=False)
    samples: int = integer("rays of sight per pixel", default=1, at_least=1, at_most=1 << 20)
    transfer: str = choice("how bytes are made", ("srgb", "floor", "gamma2.2"), default="srgb")
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

    def at(self, time: float) -> Scene:
        """The scene as it is at a time, seconds: nothing in it moves. The camera stays as it is.

        Queries see a scene at time 0; ask ``scene.at(time).intersect(...)`` about other moments.
        """
        return self.replace(objects=[frozen(thing, time) for thing in self.objects])

    def intersect(self, origins: Any, directions: Any, t_max: Any = math.inf, *, t_min: float = 0.0,
                  precision: str = "exact", threads: int | None = None) -> Hits:  # fmt: skip
        """The nearest hit of each ray.

        Parameters
        ----------
        origins, directions : (..., 3) arrays of floats or integers, world
            Broadcast against one another; any strides. Directions need no unit length: a hit is at
            origin + t * direction, with t in units of the direction as given.
        t_max : number, or (...) array
            Where rays end. Hits have t_min < t < t_max.
        t_min : where rays begin.
        precision : "exact" or "fast"
            "exact": hits are decided in double precision, whatever the scale. "fast" gives leave to decide them in single
            precision, as other ray tracers do: a sixth to a quarter faster where a mesh is among at most four items, the
            same elsewhere. Then t is off by up to about 1e-5 of the mesh's size, and so are t_min and t_max; three rays in
            ten thousand, at edges, name the triangle next to theirs, and rays may slip between two triangles.
        threads : at most so many; by default one for every core.

        Returns
        -------
        Hits
            Arrays of the broadcast shape. No ray at all, and therefore a miss (t infinite, shape -1), is what has an
            origin or direction with NaN or infinity, a direction of length zero, or t_max <= t_min or NaN.

        Raises
        ------
        SceneError
            If an argument has another shape or type.
        """
        from sightray.scene.queries import intersect

        return intersect(self, origins, directions, t_max, t_min, precision, threads)

    def occluded(self, origins: Any, directions: Any, t_max: Any = math.inf, *, t_min: float = 0.0,
                 precision: str = "exact", threads: int | None = None) -> np.ndarray:  # fmt: skip
        """Whether each ray hits anything with t_min < t < t_max: (...) bool. Arguments as for `intersect`."""
        from sightray.scene.queries import occluded

        return occluded(self, origins, directions, t_max, t_min, precision, threads)

    def intersect_all(self, origins: Any, directions: Any, t_max: Any = math.inf, *, t_min: float = 0.0,
                      threads: int | None = None) -> Layers:  # fmt: skip
        """Every surface along each ray, in order. Arguments as for `intersect`.

        A ray through the edge or vertex of a mesh crosses it once, or not at all where it only touches.
        """
        from sightray.scene.queries import intersect_all

        return intersect_all(self, origins, directions, t_max, t_min, threads)

    def count(self, origins: Any, directions: Any, t_max: Any = math.inf, *, t_min: float = 0.0,
              threads: int | None = None) -> np.ndarray:  # fmt: skip
        """How many surfaces each ray crosses, the rows of `intersect_all`: (...) int64. Arguments as for `intersect`."""
        from sightray.scene.queries import count

        return count(self, origins, directions, t_max, t_min, threads)

    def closest_point(self, points: Any, *, threads: int | None = None) -> ClosestPoints:
        """The point of the scene's meshes that is nearest to each of `points`, (..., 3), world.

        Raises
        ------
        UnsupportedError
            If the scene shows a shape that is no mesh. Lights are left out.
        """
        from sightray.scene.closed import closest_point

        return closest_point(self, points, threads)

    def signed_distance(self, points: Any, *, threads: int | None = None) -> np.ndarray:
        """Distance of each of `points`, (..., 3), to the scene's meshes, negative inside: (...) float64.

        Infinite for points that are not finite. Raises as `contains` does.
        """
        from sightray.scene.closed import signed_distance

        return signed_distance(self, points, threads)

    def contains(self, points: Any, *, threads: int | None = None) -> np.ndarray:
        """Whether each of `points`, (..., 3), is inside of the scene's meshes: (...) bool.

        Inside is where surfaces wind around the point (not zero times): within any of several bodies, even where they
        overlap, but not in a cavity whose normals point into it. A point on a surface, in rounding, may go either way.

        Raises
        ------
        UnsupportedError
            If the scene shows a shape that is no mesh. Lights are left out.
        SceneError
            If a mesh is not closed; the message says how many edges are open.
        """
        from sightray.scene.closed import contains

        return contains(self, points, threads)
