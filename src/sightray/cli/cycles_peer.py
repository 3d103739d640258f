"""Renders a scene with Cycles, over and over: a program of its own, for a Python that has Blender's ``bpy``.

    python cycles_peer.py SCENE.npz

It builds what `cycles_scene` wrote, says on a line of JSON which version it is, and then answers each line of JSON
``{"samples": n, "seed": s, "path": "picture.exr"}`` with one when the picture is there. Sightray starts it only to be
measured against, and only where somebody has installed ``bpy``. Nothing of Sightray is imported here.

Settings are those of a fair race: no denoising, no adaptive sampling, no clamps, no blurred caustics, pixels of a box,
one tile, data kept between pictures; the light tree and sampling pattern are Cycles' own choice.
"""

from __future__ import annotations

import json
import math
import os
import sys
from typing import Any

RADIANCE = math.pi  # an area light of 1 W and 1 m² has the radiance 1/pi of a matte plate that sends out 1 W/m²


def main() -> None:
    # Blender talks on standard output; answers go where that was.
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    try:
        import bpy
    except ImportError:
        print(json.dumps({"absent": "bpy is not installed"}), file=answers, flush=True)
        return
    import numpy as np

    arrays = dict(np.load(sys.argv[1]))
    told = json.loads(str(arrays.pop("told")))
    build(bpy, told, arrays)
    print(json.dumps({"version": bpy.app.version_string}), file=answers, flush=True)
    for line in sys.stdin:
        wanted = json.loads(line)
        scene = bpy.context.scene
        scene.cycles.samples, scene.cycles.seed, scene.render.filepath = (
            wanted["samples"], wanted["seed"], wanted["path"],
        )  # fmt: skip
        bpy.ops.render.render(write_still=True)
        print(json.dumps({"done": wanted["path"]}), file=answers, flush=True)


def build(bpy: Any, told: dict[str, Any], arrays: dict[str, Any]) -> None:
    """Make the scene in Blender's own file, which is empty at first."""
    from mathutils import Matrix

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    settings(scene, told)
    materials = [material(bpy, answer, arrays) for answer in told["materials"]]
    meshes = [mesh(bpy, parts, arrays, materials) for parts in told["meshes"]]
    for placed in told["objects"]:
        put(bpy, meshes[placed["mesh"]], Matrix(placed["pose"]))
    for lit in told["lights"]:
        put(bpy, area_light(bpy, lit), Matrix(lit["pose"])).visible_camera = True
    sky(bpy, None if told["sky"] is None else arrays[told["sky"]])
    seen = bpy.data.cameras.new("camera")
    seen.sensor_fit, seen.angle_y = "VERTICAL", math.radians(told["camera"]["vfov"])
    seen.clip_start, seen.clip_end = 1e-4, 1e6
    scene.camera = put(bpy, seen, Matrix(told["camera"]["pose"]))


def settings(scene: Any, told: dict[str, Any]) -> None:
    """How and how large the picture is."""
    render, cycles = scene.render, scene.cycles
    render.engine, cycles.device = "CYCLES", "CPU"
    render.resolution_x, render.resolution_y = told["camera"]["width"], told["camera"]["height"]
    render.resolution_percentage = 100
    render.threads_mode, render.threads = "FIXED", told["threads"]
    render.use_persistent_data = True
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    render.image_settings.exr_codec = "NONE"
    cycles.use_adaptive_sampling = cycles.use_denoising = cycles.use_auto_tile = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0.0
    cycles.pixel_filter_type = "BOX"
    for kind in ("max", "diffuse", "glossy", "transmission"):
        setattr(cycles, f"{kind}_bounces", told["bounces"])


def put(bpy: Any, data: Any, pose: Any) -> Any:
    """Something at its place in the scene."""
    placed = bpy.data.objects.new(data.name, data)
    placed.matrix_world = pose
    bpy.context.scene.collection.objects.link(placed)
    return placed


def mesh(bpy: Any, parts: dict[str, Any], arrays: dict[str, Any], materials: list[Any]) -> Any:
    """A mesh of triangles or of faces of four, which may have collapsed edges."""
    import numpy as np

    faces = [[k for i, k in enumerate(face) if k != face[i - 1]] for face in arrays[parts["faces"]].tolist()]
    made = bpy.data.meshes.new("mesh")
    made.from_pydata(arrays[parts["vertices"]].tolist(), [], faces)
    corners = np.array([corner for face in faces for corner in face])
    if "uvs" in parts:
        made.uv_layers.new().data.foreach_set("uv", arrays[parts["uvs"]].astype(np.float32)[corners].ravel())
    if "normals" in parts:
        made.normals_split_custom_set_from_vertices(arrays[parts["normals"]].tolist())
    made.materials.append(materials[parts["material"]])
    return made


def material(bpy: Any, answer: dict[str, Any], arrays: dict[str, Any]) -> Any:
    """A surface of one node, with a picture before it if it has one."""
    made = bpy.data.materials.new(answer["kind"])
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    nodes.clear()
    kinds = {"Lambert": "BsdfDiffuse", "Mirror": "BsdfAnisotropic", "Glass": "BsdfGlass", "Emitter": "Emission"}
    node, out = nodes.new(f"ShaderNode{kinds[answer['kind']]}"), nodes.new("ShaderNodeOutputMaterial")
    links.new(node.outputs[0], out.inputs["Surface"])
    if "Roughness" in node.inputs:
        node.inputs["Roughness"].default_value = 0.0
    made.cycles.emission_sampling = "FRONT"  # of what glows; there is a black plate behind it
    if "ior" in answer:
        node.inputs["IOR"].default_value = answer["ior"]
    if "color" in answer:
        node.inputs["Color"].default_value = (*answer["color"], 1.0)
    else:
        texture = nodes.new("ShaderNodeTexImage")
        texture.image = picture(bpy, arrays[answer["picture"]])
        links.new(texture.outputs["Color"], node.inputs["Color"])
    return made


def picture(bpy: Any, pixels: Any) -> Any:
    """A picture of linear colours, (h, w, 3); its rows are from the bottom up there."""
    import numpy as np

    height, width = pixels.shape[:2]
    made = bpy.data.images.new("picture", width, height, alpha=False, float_buffer=True)
    made.colorspace_settings.name = "Linear Rec.709"
    full = np.ones((height, width, 4), np.float32)
    full[..., :3] = pixels[::-1, :, :3]
    made.pixels.foreach_set(full.ravel())
    made.pack()
    return made


def area_light(bpy: Any, lit: dict[str, Any]) -> Any:
    """A rectangle that shines along -z."""
    made = bpy.data.lights.new("light", "AREA")
    made.shape, made.size, made.size_y = "RECTANGLE", lit["width"], lit["height"]
    made.energy = RADIANCE * lit["width"] * lit["height"]
    made.color = lit["radiance"]
    return made


def sky(bpy: Any, pixels: Any) -> None:
    """What is behind everything: a picture all around, or nothing."""
    made = bpy.data.worlds.new("sky")
    bpy.context.scene.world = made
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    shine = nodes["Background"]
    if pixels is None:
        shine.inputs["Strength"].default_value = 0.0
        return
    around = nodes.new("ShaderNodeTexEnvironment")
    around.image = picture(bpy, pixels)
    links.new(around.outputs["Color"], shine.inputs["Color"])


if __name__ == "__main__":
    main()
