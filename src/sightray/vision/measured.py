"""Measured geometry: what the measuring functions take, as a scene that only has surfaces."""

from __future__ import annotations

from typing import Any

from sightray.cameras.base import Camera
from sightray.errors import SceneError
from sightray.lights.base import Light
from sightray.scene.instance import _Placed
from sightray.scene.scene import Scene
from sightray.shapes.base import Shape


def require_camera(camera: Any, who: str) -> Camera:
    """The camera, or a `SceneError`."""
    if not isinstance(camera, Camera):
        raise SceneError(f"{who}: camera: got {camera!r}; allowed: a camera, such as PerspectiveCamera(eye=..., target=...)")
    return camera


def measured(geometry: Any, who: str) -> Scene:
    """A scene of the surfaces alone. A scene without lights stays itself, and keeps what it compiled.

    Parameters
    ----------
    geometry : a shape, a `Group` or an `Instance`, a list of these, or a `Scene`, whose lights are left out
    who : the caller, for messages

    Raises
    ------
    SceneError
        If it is anything else, or has no surface.
    """
    if isinstance(geometry, Scene):
        scene = geometry if not geometry.lights else geometry.replace(objects=_surfaces(geometry.objects))
    elif isinstance(geometry, Shape | _Placed):
        scene = Scene(geometry)
    elif isinstance(geometry, list | tuple) and all(isinstance(thing, Shape | _Placed) for thing in geometry):
        scene = Scene(*geometry)
    else:
        raise SceneError(f"{who}: geometry: got {geometry!r}; allowed: a shape, a list of shapes, or a Scene")
    if not scene.objects:
        raise SceneError(f"{who}: geometry: got no shapes; allowed: at least one")
    return scene


def _surfaces(objects: tuple[Any, ...]) -> list[Any]:
    return [thing for thing in objects if not isinstance(thing, Light)]
