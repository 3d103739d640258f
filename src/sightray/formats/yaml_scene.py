"""The native scene file: YAML with the classes and fields that scenes have in Python.

::

    camera: {type: PerspectiveCamera, eye: [0, 1, 4], target: [0, 1, 0], vfov: 40}
    integrator: {type: Whitted, max_depth: 6}
    background: 0.2
    materials:
      floor: {type: Lambert, albedo: [0.7, 0.6, 0.5]}
    objects:
      - {type: Plane, point: [0, 0, 0], normal: [0, 1, 0], material: floor}
      - {type: Mesh, file: bunny.ply, transform: [{scale: 10}, {rotate: {axis: [0, 1, 0], degrees: 30}}]}
      - {type: PointLight, position: [2, 4, 3], intensity: 60}

Top-level keys are the fields of `Scene`, and the sections ``materials``, ``textures`` and ``shapes``, whose members are
referred to by name. A mesh may name a file of any mesh format, a `Bitmap` a picture, relative to the scene file.
"""

from __future__ import annotations

from pathlib import Path

from sightray.formats.base import Format, Limits, read_text
from sightray.formats.yaml_build import Builder
from sightray.formats.yaml_nodes import parse
from sightray.formats.yaml_write import Writer
from sightray.scene.scene import Scene


def load(path: Path, limits: Limits) -> Scene:
    """Read."""
    return Builder(parse(read_text(path, limits), path, limits), path, limits).scene()


def save(scene: Scene, path: Path) -> None:
    """Write; large meshes and textures beside the file."""
    Writer(scene, path).write()


FORMATS = (Format("Sightray", (".yaml", ".yml"), load, save=save),)
