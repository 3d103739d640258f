"""What labels cost: ``python benchmarks/labels.py [SCENE ...] [--peer-python PYTHON]``, 640 x 480, best of many.

Beside them stand a picture of 16 samples and, with a Python that has Blender's ``bpy``, the same four passes of Cycles
(see `labels_cycles`), to which spheres are meshes of 96 x 192 faces.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import sightray as sr
from sightray.mathlib.cores import core_count
from sightray.scene.compile import flatten

SETS = (("depth",), ("normal",), ("instance",), ("flow",), ("depth", "normal", "instance", "flow"))
TIMES = 15
RINGS, SECTORS = 96, 192
FAR = 100.0  # half the side of what stands for a plane, metres


def best(work: Callable[[], object]) -> float:
    """Shortest time of several, milliseconds; the first, which compiles, does not count."""
    work()
    seconds = []
    for _ in range(TIMES):
        began = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - began)
    return 1e3 * min(seconds)


def main(names: list[str], peer: str) -> None:
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
        print(f"  {cycles(scene, after, peer)}", flush=True)


def cycles(scene: sr.Scene, after: sr.Camera, peer: str) -> str:
    """A line on the same passes of Cycles, or on why there are none."""
    view = scene.camera
    arrays: dict[str, Any] = {"size": [view.width, view.height, core_count()], "vfov": view.vfov}
    turned = np.diag([1.0, -1.0, -1.0, 1.0])  # a camera of Blender looks along -z
    arrays["poses"] = [camera.world_from_camera() @ turned for camera in (view, after)]
    for index, item in enumerate(flatten(scene)):
        arrays["objects"] = index + 1
        vertices, arrays[f"faces{index}"] = triangles(item.shape)
        matrix = item.transform.matrix
        arrays[f"vertices{index}"] = vertices @ matrix[:3, :3].T + matrix[:3, 3]
    with tempfile.TemporaryDirectory() as folder:
        np.savez(f"{folder}/scene.npz", **arrays)
        program = Path(__file__).with_name("labels_cycles.py")
        command = [peer, str(program), f"{folder}/scene.npz", str(TIMES)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    answer = json.loads(done.stdout or '{"absent": "the peer failed"}')
    if "absent" in answer:
        return f"Cycles is missing: {answer['absent']}; name a Python that has it by --peer-python"
    return f"{'Cycles ' + answer['version'] + ', all four':32} {1e3 * min(answer['seconds']):7.1f} ms"


def triangles(shape: Any) -> tuple[np.ndarray, np.ndarray]:
    """A shape as vertices and faces of three or four."""
    if isinstance(shape, sr.Mesh):
        return shape.vertices, shape.faces
    if isinstance(shape, sr.Rectangle):
        q, u, v = np.array([shape.corner, shape.edge_u, shape.edge_v])
        return np.array([q, q + u, q + u + v, q + v]), np.array([[0, 1, 2, 3]])
    if isinstance(shape, sr.Sphere):
        theta, phi = np.linspace(0, np.pi, RINGS + 1)[:, None], np.linspace(0, 2 * np.pi, SECTORS + 1)
        ball = np.broadcast_arrays(np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi))
        corner = (np.arange(RINGS)[:, None] * (SECTORS + 1) + np.arange(SECTORS)).ravel()
        faces = np.stack([corner, corner + 1, corner + SECTORS + 2, corner + SECTORS + 1], axis=-1)
        return np.stack(ball, axis=-1).reshape(-1, 3) * shape.radius + shape.center, faces
    if isinstance(shape, sr.Box):
        corners = np.array(np.meshgrid(*zip(shape.lower, shape.upper, strict=True), indexing="ij")).reshape(3, -1).T
        return corners, np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    if isinstance(shape, sr.Plane):
        n = np.array(shape.normal) / np.linalg.norm(shape.normal)
        u = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
        u *= FAR / np.linalg.norm(u)
        v = np.cross(n, u)
        return np.array([-u - v, u - v, u + v, v - u]) + shape.point, np.array([[0, 1, 2, 3]])
    raise SystemExit(f"{type(shape).__name__} is not translated for Cycles")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="What labels cost.")
    parser.add_argument("scenes", nargs="*", default=["cornell", "whitted", "stage4-reflections"])
    parser.add_argument("--peer-python", default=sys.executable, help="a Python that has Blender's bpy")
    options = parser.parse_args()
    main(options.scenes, options.peer_python)
