"""Scenes that move: cameras and objects on trajectories."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sightray.cameras.base import Camera
from sightray.cameras.moving import MovingCamera
from sightray.errors import SceneError, unknown
from sightray.lights.base import Light
from sightray.mathlib.motion import Motion
from sightray.mathlib.transform import Transform
from sightray.scene.instance import Instance
from sightray.scene.scene import Scene
from sightray.vision.rigs import Rig, posed
from sightray.vision.trajectory import Still, Trajectory


class Animation:
    """A scene whose camera and objects move: `at` gives the scene of any moment.

    Parameters
    ----------
    scene : what there is.
    camera : how the camera moves, or the first one of the rig; None: it stands.
    objects : how objects move, by their names: the trajectory moves what stands in the scene, so its identity is no
        movement.
    rig : several cameras instead of the scene's.

    Examples
    --------
    >>> import sightray as sr
    >>> from sightray.vision import Animation, Orbit
    >>> scene = sr.Scene(sr.Sphere(name="ball"), camera=sr.PerspectiveCamera(width=64, height=48))
    >>> moving = Animation(scene, camera=Orbit(radius=5, elevation=0, speed=90))
    >>> moving.at(1.0).camera.eye
    (5.0, 0.0, 0.0)
    """

    def __init__(self, scene: Scene, *, camera: Trajectory | None = None,
                 objects: Mapping[str, Trajectory] | None = None, rig: Rig | None = None):  # fmt: skip
        if camera is None:
            lead = next(iter(rig.cameras.values())) if rig is not None else scene.camera
            if lead is None:
                raise SceneError("Animation: the scene has no camera; give it one, or a rig")
            camera = Still(lead.world_from_camera())
        self.scene, self.camera, self.rig = scene, camera, rig
        self.objects = dict(objects or {})
        names = [getattr(thing, "name", "") for thing in scene.objects if not isinstance(thing, Light)]
        for name in self.objects:
            if names.count(name) != 1:
                found = (
                    unknown("object", name, filter(None, names)) if name not in names else f"'{name}' more than once"
                )
                raise SceneError(f"Animation: objects: {found}")

    def objects_at(self, t: float) -> tuple[Any, ...]:
        """The scene's objects at time t, seconds."""
        return tuple(
            moved(thing, self.objects[name].pose(t)) if (name := getattr(thing, "name", "")) in self.objects else thing
            for thing in self.scene.objects
        )

    def cameras_at(self, t: float) -> dict[str, Camera]:
        """Cameras by name at time t; one without a rig, named "camera"."""
        pose = self.camera.pose(t)
        if self.rig is not None:
            return self.rig.at(pose)
        return {"camera": posed(self.scene.camera, pose)}

    def at(self, t: float) -> Scene:
        """The scene at time t, with its camera, or the first one of the rig."""
        objects = self.objects_at(t) if self.objects else self.scene.objects
        return self.scene.replace(objects=objects, camera=next(iter(self.cameras_at(t).values())))

    def blurred(self, t: float, exposure: float, readout: float = 0.0) -> tuple[Scene, dict[str, Camera]]:
        """What a shutter sees that is open for `exposure` seconds around t: the scene, and cameras by name, in motion.

        With `readout`, the bottom row is exposed so many seconds after the top one, and the picture's middle row around t.
        In that time, objects and the camera, or the rig as a whole, go from their poses at its begin to those at t, and on
        to those at its end.
        Labels of the middle of the exposure are those of `at`.
        """
        half = 0.5 * (exposure + readout)
        times = (t - half, t, t + half)
        objects = tuple(
            Instance(of=thing, motion=Motion([(s, self.objects[name].pose(s)) for s in times]), name=name)
            if (name := getattr(thing, "name", "")) in self.objects else thing
            for thing in self.scene.objects
        )  # fmt: skip
        poses = Motion([(s, next(iter(self.cameras_at(s).values())).world_from_camera()) for s in times])
        found: dict[str, Camera] = {}
        for name, still in self.cameras_at(t).items():
            rows = {"shutter_open": times[0], "shutter_close": times[0] + exposure, "readout": readout}
            mount = None if self.rig is None else self.rig.rig_from_camera[name]
            found[name] = MovingCamera(camera=still.replace(**rows), poses=poses, mount=mount)
        return self.scene.replace(objects=objects, camera=next(iter(found.values()))), found


def moved(thing: Any, pose: Any) -> Any:
    """An object moved by a matrix, shown by an `Instance`, which shares its triangles; the name stays."""
    return Instance(of=thing, transform=Transform(pose), name=thing.name)
