"""Our scenes for Cycles, as far as both know the same things: plain numbers and arrays, in one ``.npz`` file.

The file is read by `cycles_peer`, which runs in a Python that has Blender's ``bpy`` and need not have Sightray. Blender
looks along -z of a camera and sends an area light's light along its -z; its sky is upright along z. So the whole world
is turned: our x, y, z are its -y, z, -x.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from sightray.errors import UnsupportedError
from sightray.lights.base import Light
from sightray.scene.compile import flatten

TURN = np.array([[0.0, 0.0, -1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
RINGS, SECTORS = 96, 192  # of spheres, which are meshes there: off by 1.3e-4 of the radius
BEHIND = 2e-4  # of a lamp's width: where its black back stands
FEW_LAMPS = 16  # more are surfaces that glow: Cycles asks every lamp whether a ray meets it, one after the other

BOX_FACES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def write_cycles_scene(scene: Any, max_depth: int, threads: int, path: Path) -> None:
    """Write what `cycles_peer` reads; raises `UnsupportedError` for what is not translated."""
    course = _Course()
    for item in flatten(scene):
        if not isinstance(scene.objects[item.object], Light):
            course.add_object(item)
    few = len(scene.lights) <= FEW_LAMPS
    for light in scene.lights:
        course.add_light(light, few)
    course.add_backs()
    camera = scene.camera
    pose = camera.world_from_camera() @ np.diag([1.0, -1.0, -1.0, 1.0])  # it has y upwards and looks along -z
    told = {
        "camera": {"pose": (TURN @ pose).tolist(), "vfov": camera.vfov, "width": camera.width, "height": camera.height},
        "bounces": max_depth - 1,  # it counts turns after the first surface, we count surfaces
        "threads": threads, "materials": course.materials, "meshes": course.meshes, "objects": course.objects,
        "lights": course.lights, "sky": course.sky,
    }  # fmt: skip
    arrays: dict[str, Any] = {"told": json.dumps(told), **course.arrays}
    np.savez(path, **arrays)


class _Course:
    """What a scene is made of, each thing once; arrays are named."""

    def __init__(self) -> None:
        self.arrays: dict[str, np.ndarray] = {}
        self.materials: list[dict[str, Any]] = []
        self.meshes: list[dict[str, Any]] = []
        self.objects: list[dict[str, Any]] = []
        self.lights: list[dict[str, Any]] = []
        self.sky: str | None = None
        self._plates: list[np.ndarray] = []
        self._known: dict[tuple[int, ...], int] = {}

    def add_object(self, item: Any) -> None:
        key = (id(item.shape), id(item.material))
        if key not in self._known:
            mesh = _mesh(item.shape)
            names = {part: self._keep(values) for part, values in mesh.items() if values is not None}
            self.meshes.append({**names, "material": self._material(item.material)})
            self._known[key] = len(self.meshes) - 1
        self.objects.append({"mesh": self._known[key], "pose": (TURN @ item.transform.matrix).tolist()})

    def add_light(self, light: Any, as_lamp: bool) -> None:
        kind = type(light).__name__
        if kind == "RectangleLight" and light.upright() and light.visible and not light.two_sided:
            q, u, v = (np.asarray(part) for part in (light.corner, light.edge_u, light.edge_v))
            if as_lamp:
                self.lights.append(_area(light))
            else:
                self._add_glow(np.stack([q, q + u, q + u + v, q + v]), light.radiance)
            q = q - light.area_vector() / light.area * (BEHIND * np.linalg.norm(u))
            self._plates.append(np.stack([q, q + u, q + u + v, q + v]))
        elif kind == "EnvironmentLight" and light.transform.is_identity and self.sky is None:
            self.sky = self._keep(light.pixels * np.float32(light.radiance))
        else:
            raise UnsupportedError(f"this {kind} is not translated for Cycles; allowed: RectangleLight with edges at right "
                                   "angles, visible from one side, and one EnvironmentLight that is not turned")  # fmt: skip

    def _add_glow(self, corners: np.ndarray, radiance: Any) -> None:
        self.materials.append({"kind": "Emitter", "color": list(radiance)})
        self.meshes.append({"vertices": self._keep(corners), "faces": self._keep(np.arange(4)[None]),
                            "material": len(self.materials) - 1})  # fmt: skip
        self.objects.append({"mesh": len(self.meshes) - 1, "pose": TURN.tolist()})

    def add_backs(self) -> None:
        """A black plate behind every lamp: theirs let light pass through, ours stop it."""
        if not self._plates:
            return
        self.materials.append({"kind": "Lambert", "color": [0.0, 0.0, 0.0]})
        corners, faces = np.concatenate(self._plates), np.arange(4 * len(self._plates)).reshape(-1, 4)
        self.meshes.append({"vertices": self._keep(corners), "faces": self._keep(faces),
                            "material": len(self.materials) - 1})  # fmt: skip
        self.objects.append({"mesh": len(self.meshes) - 1, "pose": TURN.tolist()})

    def _material(self, material: Any) -> int:
        key = (id(material),)
        if key not in self._known:
            self.materials.append(self._answer(material))
            self._known[key] = len(self.materials) - 1
        return self._known[key]

    def _answer(self, material: Any) -> dict[str, Any]:
        kind = type(material).__name__
        if kind == "Lambert":
            return {"kind": kind, **self._colour(material.albedo)}
        if kind == "Mirror":
            return {"kind": kind, **self._colour(material.reflectance)}
        if kind == "Glass" and not any(material.absorption):
            return {"kind": kind, "color": [1.0, 1.0, 1.0], "ior": material.ior}
        raise UnsupportedError(f"{kind} is not translated for Cycles; allowed: Lambert, Mirror, clear Glass")

    def _colour(self, value: Any) -> dict[str, Any]:
        if isinstance(value, tuple):
            return {"color": list(value)}
        if type(value).__name__ == "Bitmap":
            return {"picture": self._keep(value.pixels)}
        raise UnsupportedError(f"{type(value).__name__} is not translated for Cycles; allowed: colours and Bitmap")

    def _keep(self, values: np.ndarray) -> str:
        name = f"array{len(self.arrays)}"
        self.arrays[name] = np.asarray(values)
        return name


def _area(light: Any) -> dict[str, Any]:
    """A rectangle whose x and y are edge_v and edge_u, so that its z is against the normal."""
    u, v = np.asarray(light.edge_u), np.asarray(light.edge_v)
    width, height = float(np.linalg.norm(v)), float(np.linalg.norm(u))
    pose = np.eye(4)
    pose[:3] = np.column_stack([v / width, u / height, -light.area_vector() / light.area, light.corner + (u + v) / 2])
    return {"pose": (TURN @ pose).tolist(), "width": width, "height": height, "radiance": list(light.radiance)}


def _mesh(shape: Any) -> dict[str, np.ndarray | None]:
    """Corners, faces of three or four of them, and normals and texture coordinates of corners if there are any."""
    kind = type(shape).__name__
    if kind == "Mesh":
        return {"vertices": shape.vertices, "faces": shape.faces, "normals": shape.normals, "uvs": shape.uvs}
    if kind == "Box":
        sides = np.stack(np.meshgrid(*zip(shape.lower, shape.upper, strict=True), indexing="ij"), axis=-1)
        return {"vertices": sides.reshape(-1, 3), "faces": np.array(BOX_FACES)}
    if kind == "Sphere":
        normals, faces = _ball()
        return {"vertices": np.asarray(shape.center) + shape.radius * normals, "faces": faces, "normals": normals}
    raise UnsupportedError(f"{kind} is not translated for Cycles; allowed: Mesh, Sphere, Box")


def _ball() -> tuple[np.ndarray, np.ndarray]:
    """The unit sphere: points (n, 3) and faces of four, (m, 4), whose first corners repeat at the poles."""
    theta = np.linspace(0.0, np.pi, RINGS + 1)[1:-1, None]
    phi = np.arange(SECTORS) * (2 * np.pi / SECTORS)
    belt = np.stack(
        np.broadcast_arrays(np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)), axis=-1
    )
    points = np.concatenate([belt.reshape(-1, 3), [[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]])
    ring = np.arange(RINGS + 1)[:, None] - 1
    index = ring * SECTORS + np.arange(SECTORS)
    index[0], index[-1] = len(points) - 2, len(points) - 1
    right = np.roll(index, -1, axis=1)
    quads = np.stack([index[:-1], index[1:], right[1:], right[:-1]], axis=-1).reshape(-1, 4)
    return points, quads
