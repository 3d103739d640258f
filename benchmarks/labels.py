"""What labels cost: ``python benchmarks/labels.py [SCENE ...]``, 640 x 480, best of many, beside a picture of 16 samples."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np

import sightray as sr

SETS = (("depth",), ("normal",), ("instance",), ("flow",), ("depth", "normal", "instance", "flow"))
TIMES = 15


def best(work: Callable[[], object]) -> float:
    """Shortest time of several, milliseconds; the first, which compiles, does not count."""
    work()
    seconds = []
    for _ in range(TIMES):
        began = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - began)
    return 1e3 * min(seconds)


def main(names: list[str]) -> None:
    for name in names:
        scene = sr.load(name)
        scene = scene.replace(camera=scene.camera.resized(640, 480))
        pose = scene.camera.world_from_camera()
        step = 0.02 * np.linalg.norm(pose[:3, 3]) * pose[:3, 0]
        after = scene.camera.replace(eye=np.add(scene.camera.eye, step), target=np.add(scene.camera.target, step))
        print(name)
        for layers in SETS:
            spent = best(lambda layers=layers, scene=scene, after=after: sr.label(scene, *layers, next=after))
            print(f"  {', '.join(layers):32} {spent:7.1f} ms")
        began = time.perf_counter()
        sr.render(scene, samples=16)
        print(f"  {'picture, 16 samples':32} {1e3 * (time.perf_counter() - began):7.1f} ms")


if __name__ == "__main__":
    main(sys.argv[1:] or ["cornell", "whitted", "stage4-reflections"])
