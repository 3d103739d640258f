"""Label passes of Cycles: a program of its own, for a Python that has Blender's ``bpy``; `benchmarks/labels.py` starts it.

    python labels_cycles.py SCENE.npz TIMES

Renders the passes Z, normal, object index and vector (flow) at one sample a pixel, black materials and no light, data kept
between pictures, and prints the version and the seconds of each picture after the first as JSON. Passes stay in Blender:
what it takes to get them out as arrays is not counted.
"""

from __future__ import annotations

import json
import math
import os
import sys
import time
from typing import Any

import numpy as np


def main() -> None:
    answers = os.fdopen(os.dup(1), "w")  # Blender talks on standard output
    os.dup2(2, 1)
    try:
        import bpy
    except ImportError:
        print(json.dumps({"absent": f"{sys.executable} has no bpy"}), file=answers, flush=True)
        return
    build(bpy, dict(np.load(sys.argv[1])))
    seconds = []
    for _ in range(1 + int(sys.argv[2])):
        began = time.perf_counter()
        bpy.ops.render.render(write_still=False)
        seconds.append(time.perf_counter() - began)
    print(json.dumps({"version": bpy.app.version_string, "seconds": seconds[1:]}), file=answers, flush=True)


def build(bpy: Any, arrays: dict[str, np.ndarray]) -> None:
    """The scene, its camera with the pose of the next frame, and the settings."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    settings(scene, *arrays["size"].tolist())
    black = bpy.data.materials.new("black")
    black.use_nodes = True
    black.node_tree.nodes.clear()
    for index in range(int(arrays["objects"])):
        mesh = bpy.data.meshes.new("mesh")
        mesh.from_pydata(arrays[f"vertices{index}"].tolist(), [], arrays[f"faces{index}"].tolist())
        mesh.materials.append(black)
        thing = bpy.data.objects.new("thing", mesh)
        thing.pass_index = index + 1
        scene.collection.objects.link(thing)
    camera = bpy.data.cameras.new("camera")
    camera.sensor_fit, camera.angle_y = "VERTICAL", math.radians(float(arrays["vfov"]))
    camera.clip_start, camera.clip_end = 1e-3, 1e5
    scene.camera = bpy.data.objects.new("camera", camera)
    scene.collection.objects.link(scene.camera)
    scene.camera.rotation_mode = "QUATERNION"
    for frame, pose in enumerate(arrays["poses"], 1):
        from mathutils import Matrix

        scene.camera.matrix_world = Matrix(pose.tolist())
        scene.camera.keyframe_insert("location", frame=frame)
        scene.camera.keyframe_insert("rotation_quaternion", frame=frame)
    scene.frame_set(1)


def settings(scene: Any, width: int, height: int, threads: int) -> None:
    """One sample in the middle of a box, all passes, nothing else."""
    render, cycles, layer = scene.render, scene.cycles, scene.view_layers[0]
    render.engine, cycles.device = "CYCLES", "CPU"
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
    render.threads_mode, render.threads = "FIXED", threads
    render.use_persistent_data = True
    cycles.samples, cycles.pixel_filter_type = 1, "BOX"
    cycles.use_adaptive_sampling = cycles.use_denoising = cycles.use_auto_tile = False
    cycles.max_bounces = 0
    for name in ("z", "normal", "object_index", "vector"):
        setattr(layer, f"use_pass_{name}", True)


if __name__ == "__main__":
    main()
