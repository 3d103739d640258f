"""From a `Take` to its `Shot` pictures: rendering and labelling."""

from __future__ import annotations

from collections.abc import Iterable
from copy import copy

import numpy as np

from sightray.cameras.base import Camera
from sightray.engine.run import run
from sightray.filters.box import BoxFilter
from sightray.images import Image
from sightray.integrators.whitted import Whitted
from sightray.mathlib.table import link
from sightray.samplers.base import default_sampler
from sightray.scene.compile import Compiled, compile_scene
from sightray.scene.scene import Scene
from sightray.scene.world import CAMERA
from sightray.vision.label import make_labels
from sightray.vision.shot import PICTURE, Shot
from sightray.vision.take import Take
from sightray.vision.view import View
from sightray.vision.writers.base import Writer

SAFE = ("instance",)  # a layer that is always made, for labels need one


def layers_of(writers: Iterable[Writer], take: Take) -> tuple[str, ...]:
    """All label layers that writers read of a take."""
    names = [name for writer in writers for name in writer.wanted(take.following is not None, take.stereo)]
    return tuple(dict.fromkeys([*names, *SAFE]))


def photograph(take: Take, writers: Iterable[Writer], samples: int, threads: int | None = None) -> list[Shot]:
    """A picture and labels by each camera of a take; without pictures if `samples` is 0.

    The tables of a scene are made once, for the labels and the pictures of all cameras.
    """
    names, layers, shots = tuple(take.cameras), layers_of(writers, take), []
    for index, name in enumerate(names):
        camera = take.cameras[name]
        following = None
        if take.following is not None and take.later is not None:
            following = View(take.following, take.later[name])
        other = take.cameras[names[1 - index]] if take.stereo else None
        labels = make_labels(take.scene, layers, camera=camera, next=following, stereo=other, classes=take.classes,
                             threads=threads)  # fmt: skip
        for device in take.depth_sensors.values():
            device.accept(take.scene.replace(camera=camera))
        image = delivered = None
        measured: dict[str, np.ndarray] = {}
        if samples:
            seen, eye = (take.scene, camera) if take.blurred is None else (take.blurred, take.shutters[name])
            image = picture(seen, eye, samples, take.seeds[index], threads)
            measured = measure(take, camera, take.seeds[index], threads)
            if take.sensor is not None:
                delivered = take.sensor.capture(image, seed=take.seeds[index], frame=take.frame)
        shots.append(Shot(
            labels, image, frame=take.frame, camera=index, cameras=names, sequence=take.sequence, step=take.step,
            time=take.time, trajectory=take.trajectory, next_time=take.next_time, targets=take.targets, threads=threads,
            delivered=delivered, measured=measured,
            bits=8 if take.sensor is None else take.sensor.bits, devices=devices_of(take) if samples else {},
        ))  # fmt: skip
    return shots


def measure(take: Take, camera: Camera, seed: int, threads: int | None) -> dict[str, np.ndarray]:
    """What each depth sensor of a take measures around one of its cameras; each has noise of its own."""
    scene = take.scene.replace(camera=camera)
    return {
        name: device.capture(scene, seed + 1 + k, take.frame, threads)
        for k, (name, device) in enumerate(take.depth_sensors.items())
    }


def devices_of(take: Take) -> dict[str, str]:
    """The sensors of a take in words."""
    own = {} if take.sensor is None else {PICTURE: repr(take.sensor)}
    return own | {name: repr(device) for name, device in take.depth_sensors.items()}


def picture(scene: Scene, camera: Camera, samples: int, seed: int, threads: int | None) -> Image:
    """The scene's picture by one of its cameras and its own integrator, as `sightray.render` makes it."""
    outcome = run(looking(compile_scene(scene), camera), scene.integrator or Whitted(), default_sampler(), BoxFilter(),
                  samples=samples, seed=seed, threads=threads)  # fmt: skip
    if not outcome.complete:
        raise KeyboardInterrupt
    return Image(outcome.film.image(), transfer=scene.transfer)


def looking(compiled: Compiled, camera: Camera) -> Compiled:
    """The compiled scene with another camera. Its tables stay the same, with room for one at a time."""
    link(compiled.world, CAMERA, compiled.tables.row_of(camera))
    found = copy(compiled)
    found.scene = compiled.scene.replace(camera=camera)
    return found
