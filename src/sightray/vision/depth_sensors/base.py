"""The contract of depth sensors: devices that measure how far things are, with the errors that real ones have.

A depth sensor is a device whose (left) eye is the scene's camera. `capture` gives the depths that it would have delivered,
beside the exact ones of `sightray.label`, pixel by pixel. All its noise is a function of a seed and the number of a frame.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from sightray.engine.progress import Callback, Progress
from sightray.engine.run import run
from sightray.errors import SceneError
from sightray.fields import Point
from sightray.film.film import SUM, WEIGHT
from sightray.filters.box import BoxFilter
from sightray.integrators.whitted import Whitted
from sightray.lights.projector import ProjectorLight
from sightray.mathlib.transform import Transform
from sightray.registry import Member, members
from sightray.samplers.base import default_sampler
from sightray.scene.compile import Compiled, compile_scene, require_view
from sightray.scene.scene import Scene
from sightray.vision.view import is_linear


class DepthSensor(Member, family="vision.depth_sensors"):
    """Base of all depth sensors."""

    def capture(self, scene: Scene, seed: int = 0, frame: int = 0, threads: int | None = None,
                progress: Callback | None = None) -> np.ndarray:  # fmt: skip
        """The depths that the sensor delivers.

        Parameters
        ----------
        scene : one with a camera, whose picture the depths belong to.
        seed, frame : whole numbers >= 0; the noise is a function of both, so that every frame can be made by itself.
        threads : by default one for every core. Depths do not depend on it.
        progress : called with a `Progress` now and then, while kernels are compiled and pictures are made.

        Returns
        -------
        (h, w) float64, metres along the axis of sight; 0 where nothing was measured.

        Raises
        ------
        SceneError
            If the scene has no camera, or one that the sensor cannot be built around.
        """
        raise NotImplementedError(f"{type(self).__name__} does not say how it measures")

    def accept(self, scene: Scene) -> None:
        """Raise a `SceneError` if the sensor cannot be built around the scene's camera; asked before time is spent."""
        if scene.camera is None:
            raise SceneError(f"{type(self).__name__}: got a scene without a camera; allowed: one with a camera")

    @classmethod
    def summary(cls) -> str:
        """The first sentence about the sensor."""
        return " ".join((cls.__doc__ or "").split("\n\n")[0].split())


def known_depth_sensors() -> dict[str, type[DepthSensor]]:
    """All depth sensors by the name of their class."""
    found: dict[str, Any] = members("vision.depth_sensors")
    return found


def require_pinhole(sensor: DepthSensor, scene: Scene) -> None:
    """Raise a `SceneError` unless the scene's camera is a pinhole."""
    if scene.camera is None or not is_linear(scene.camera):
        raise SceneError(
            f"{type(sensor).__name__}: got a scene with {scene.camera!r}; allowed: one with a pinhole camera"
        )


def mean_light(
    scene: Scene, integrator: Any = None, *, samples: int, seed: int, threads: int | None = None,
    progress: Callback | None = None,
) -> np.ndarray:  # fmt: skip
    """What `sightray.render` would make, before it is rounded to single precision: (h, w, 3) float64.

    The scene's own integrator counts, else `Whitted`.
    """
    require_view(scene)
    return light_of(compile_scene(scene), integrator, samples=samples, seed=seed, threads=threads, progress=progress)


def light_of(
    compiled: Compiled, integrator: Any = None, *, samples: int, seed: int, threads: int | None = None,
    progress: Callback | None = None,
) -> np.ndarray:  # fmt: skip
    """`mean_light` of a scene whose tables are there."""
    light = integrator or compiled.scene.integrator or Whitted()
    outcome = run(compiled, light, default_sampler(), BoxFilter(), samples=samples, seed=seed, threads=threads,
                  progress=progress)  # fmt: skip
    if not outcome.complete:
        raise KeyboardInterrupt
    pixels = outcome.film.pixels
    weight = pixels[..., WEIGHT : WEIGHT + 1]
    return np.divide(pixels[..., SUM : SUM + 3], weight, out=np.zeros_like(pixels[..., :3]), where=weight > 0)


def one_of(progress: Callback | None, count: int) -> Callable[[int], Callback | None]:
    """What the pictures of a series report to, by their number: `progress` is told how far all `count` of them are."""
    began, rays = time.perf_counter(), [0] * count

    def of(index: int) -> Callback | None:
        def tell(now: Progress) -> None:
            if now.stage != "compile":
                rays[index] = now.rays
                now = now._replace(done=index * now.total + now.done, total=count * now.total, rays=sum(rays),
                                   seconds=time.perf_counter() - began)  # fmt: skip
            if progress is not None:
                progress(now)

        return None if progress is None else tell

    return of


def sight_rays(camera: Any) -> tuple[np.ndarray, np.ndarray]:
    """Rays of sight through the pixels' centres: origins, directions, (h, w, 3) each, in the camera's frame, metres."""
    x, y = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    origins, directions = camera.rays(np.stack([x, y], axis=-1))
    return camera.in_camera(origins), directions @ camera.world_from_camera()[:3, :3]


def beside(camera: Any, place: Any) -> Point:
    """A point of the camera's frame, metres, in the world."""
    x, y, z = Transform(camera.world_from_camera()).point([place])[0].tolist()
    return x, y, z


def projector_beside(camera: Any, aside: float, picture: np.ndarray, vfov: float, intensity: float) -> ProjectorLight:
    """A projector `aside` metres along the camera's +x that looks the same way, with a grey picture, (h, w)."""
    return ProjectorLight(
        image=np.repeat(picture[..., None], 3, axis=-1).astype(np.float32), eye=beside(camera, (aside, 0, 0)),
        target=beside(camera, (aside, 0, 1)), up=-camera.world_from_camera()[:3, 1], vfov=vfov,
        intensity=(intensity,) * 3,
    )  # fmt: skip
