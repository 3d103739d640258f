"""From a `Take` to its `Shot` pictures: rendering and labelling."""

from __future__ import annotations

from collections.abc import Iterable

from sightray.engine.run import run
from sightray.filters.box import BoxFilter
from sightray.images import Image
from sightray.integrators.whitted import Whitted
from sightray.samplers.base import default_sampler
from sightray.scene.compile import compile_scene
from sightray.scene.scene import Scene
from sightray.vision.label import make_labels
from sightray.vision.shot import Shot
from sightray.vision.take import Take
from sightray.vision.writers.base import Writer

SAFE = ("instance",)  # a layer that is always made, for labels need one


def layers_of(writers: Iterable[Writer], take: Take) -> tuple[str, ...]:
    """All label layers that writers read of a take."""
    names = [name for writer in writers for name in writer.wanted(take.following is not None, take.stereo)]
    return tuple(dict.fromkeys([*names, *SAFE]))


def photograph(take: Take, writers: Iterable[Writer], samples: int, threads: int | None = None) -> list[Shot]:
    """A picture and labels by each camera of a take; without pictures if `samples` is 0."""
    names, layers, shots = tuple(take.cameras), layers_of(writers, take), []
    for index, name in enumerate(names):
        camera = take.cameras[name]
        following = None
        if take.following is not None and take.later is not None:
            following = take.following.replace(camera=take.later[name])
        other = take.cameras[names[1 - index]] if take.stereo else None
        scene = take.scene if take.scene.camera is camera else take.scene.replace(camera=camera)
        labels = make_labels(scene, layers, next=following, stereo=other, classes=take.classes, threads=threads)
        seen = scene if take.blurred is None else take.blurred[name]
        image = picture(seen, samples, take.seeds[index], threads) if samples else None
        shots.append(Shot(
            labels, image, frame=take.frame, camera=index, cameras=names, sequence=take.sequence, step=take.step,
            time=take.time, targets=take.targets, threads=threads,
        ))  # fmt: skip
    return shots


def picture(scene: Scene, samples: int, seed: int, threads: int | None) -> Image:
    """The scene's picture by its own integrator, as `sightray.render` makes it."""
    outcome = run(compile_scene(scene), scene.integrator or Whitted(), default_sampler(), BoxFilter(), samples=samples,
                  seed=seed, threads=threads)  # fmt: skip
    if not outcome.complete:
        raise KeyboardInterrupt
    return Image(outcome.film.image(), transfer=scene.transfer)
