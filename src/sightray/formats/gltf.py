"""glTF 2.0, ``.glb`` and ``.gltf``: triangle meshes at the nodes of a scene.

Read here rather than by trimesh, which leaves sparse accessors at zero, does not scale normalised integers, skips
triangle fans, second texture coordinates and texture transforms, drops what hangs below a camera
without a word, and takes memory for as many elements as an accessor claims.

A texture's v runs downwards in glTF and is turned here. Materials become `Principled`; see gltf_materials.py. Vertex
colours, skins, morph targets, animations, lights and cameras are ignored.
"""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from sightray.errors import FormatError, UnsupportedError
from sightray.formats.base import Format, Limits
from sightray.formats.framing import frame_mesh
from sightray.formats.gltf_buffers import Buffers
from sightray.formats.gltf_materials import Materials
from sightray.formats.solid import solid_mesh
from sightray.mathlib.transform import Transform
from sightray.scene.instance import Instance
from sightray.scene.scene import Scene

TRIANGLES, STRIP, FAN = 4, 5, 6
IGNORABLE = ("KHR_materials_", "KHR_texture_transform", "KHR_mesh_quantization", "KHR_lights", "KHR_animation")


class Reader:
    """Meshes of one file, each primitive made once and shown where nodes say."""

    def __init__(self, path: Path, limits: Limits):
        self.path, self.limits = path, limits
        self.file = Buffers(path, limits)
        self.materials = Materials(self.file)
        self.primitives: dict[int, list[Any]] = {}
        self.triangles = 0

    def read(self) -> list[Any]:
        required = self.file.get(self.file.json, "extensionsRequired", list, [])
        if unread := [str(name)[:60] for name in required if not str(name).startswith(IGNORABLE)]:
            raise UnsupportedError(f"{self.path}: it requires {unread[0]}, which is not read")
        placed = self.placed()
        uses = Counter(str(index) for index, _, _ in placed)
        result: list[Any] = []
        for index, matrix, name in placed:
            for mesh in self.mesh(index):
                transform = Transform(matrix)
                if uses[str(index)] == 1:
                    result.append(mesh.replace(transform=transform, name=name or mesh.name))
                else:
                    result.append(Instance(of=mesh, transform=transform, name=name or mesh.name))
        return result

    def placed(self) -> list[tuple[Any, np.ndarray, str]]:
        """Mesh index, world matrix and name of every node that shows a mesh."""
        file = self.file
        nodes = file.get(file.json, "nodes", list, [])
        if not nodes:
            return [(i, np.eye(4), "") for i in range(len(file.get(file.json, "meshes", list, [])))]
        if "scenes" in file.json:
            roots = file.get(file.item("scenes", file.json.get("scene", 0)), "nodes", list, [])
        else:
            below = {str(c) for i in range(len(nodes)) for c in file.get(file.item("nodes", i), "children", list, [])}
            roots = [i for i in range(len(nodes)) if str(i) not in below]
        result, seen = [], set()
        waiting = [(root, np.eye(4), 1) for root in reversed(roots)]
        while waiting:
            index, above, depth = waiting.pop()
            node = file.item("nodes", index)
            if index in seen:
                raise FormatError(f"node {index} stands in two places of the tree; allowed: one", self.path)
            seen.add(index)
            if depth > self.limits.max_nesting or len(seen) > self.limits.max_nodes:
                raise FormatError(f"more than {self.limits.max_nesting} levels or {self.limits.max_nodes} nodes; raise "
                                  "max_nesting or max_nodes if the file is to be trusted", self.path)  # fmt: skip
            matrix = above @ self.local(node)
            if "mesh" in node:
                result.append((node["mesh"], matrix, str(node.get("name", ""))))
            waiting += [(child, matrix, depth + 1) for child in reversed(file.get(node, "children", list, []))]
        return result

    def local(self, node: Any) -> np.ndarray:
        """A node's matrix: given, or translation after rotation after scale."""
        if "matrix" in node:
            return self.file.floats(node, "matrix", 16).reshape(4, 4).T
        x, y, z, w = self.file.floats(node, "rotation", 4, (0, 0, 0, 1))
        size = math.sqrt(x * x + y * y + z * z + w * w)
        if not 0 < size < math.inf:
            raise FormatError("rotation [0, 0, 0, 0]; allowed: a unit quaternion", self.path)
        x, y, z, w = x / size, y / size, z / size, w / size
        matrix = np.eye(4)
        matrix[:3, :3] = np.array([
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]) * self.file.floats(node, "scale", 3, (1, 1, 1))  # fmt: skip
        matrix[:3, 3] = self.file.floats(node, "translation", 3, (0, 0, 0))
        return matrix

    def mesh(self, index: Any) -> list[Any]:
        owner = self.file.item("meshes", index)
        if index not in self.primitives:
            parts = [self.primitive(p, str(owner.get("name", ""))) for p in self.file.get(owner, "primitives", list)]
            self.primitives[index] = [part for part in parts if part is not None]
        return self.primitives[index]

    def primitive(self, owner: Any, name: str) -> Any:
        """One mesh; None for points and lines."""
        attributes = self.file.get(owner, "attributes", dict)
        mode = owner.get("mode", TRIANGLES)
        if mode not in (TRIANGLES, STRIP, FAN) or "POSITION" not in attributes:
            return None
        vertices = self.columns(attributes["POSITION"], 3)
        if "indices" in owner:
            order = self.file.accessor(owner["indices"]).ravel()
            if order.dtype.kind == "f" or (len(order) and int(order.max()) >= len(vertices)):
                raise FormatError(f"an index beyond the {len(vertices)} vertices of mesh '{name[:40]}'", self.path)
        else:
            order = np.arange(len(vertices))
        faces = order.astype(np.int32)[_corners(mode, len(order))]
        if not len(faces):
            return None
        self.triangles += len(faces)
        self.limits.check_triangles(self.triangles, self.path)
        material, texture = self.materials.material(owner["material"]) if "material" in owner else (None, {})
        channel = f"TEXCOORD_{texture.get('texCoord', 0)}"
        uvs = self.uvs(attributes[channel], texture, len(vertices)) if channel in attributes else None
        normals = self.columns(attributes["NORMAL"], 3, len(vertices)) if "NORMAL" in attributes else None
        return solid_mesh(vertices, faces, normals, uvs=uvs, material=material, name=name)

    def columns(self, index: Any, width: int, rows: int | None = None) -> np.ndarray:
        values = self.file.accessor(index)
        if values.shape[1] != width or (rows is not None and len(values) != rows) or not np.isfinite(values).all():
            many = "" if rows is None else f"{rows} "
            raise FormatError(f"accessor {index}: expected {many}rows of {width} finite numbers", self.path)
        return values.astype(np.float64)

    def uvs(self, index: Any, texture: Any, rows: int) -> np.ndarray:
        """Texture coordinates as the material's texture moves them, with v upwards."""
        uv = self.columns(index, 2, rows)
        moved = self.file.get(self.file.get(texture, "extensions", dict, {}), "KHR_texture_transform", dict, {})
        if moved:
            # Counter-clockwise as seen with v downwards, which is clockwise by the signs; see KhronosGroup/glTF#1563.
            angle = float(self.file.get(moved, "rotation", (int, float), 0.0))
            c, s = math.cos(angle), math.sin(angle)
            uv = uv * self.file.floats(moved, "scale", 2, (1, 1)) @ np.array([[c, -s], [s, c]])
            uv = uv + self.file.floats(moved, "offset", 2, (0, 0))
        return np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=1)


def _corners(mode: int, count: int) -> np.ndarray:
    """Which of `count` indices make up each triangle, (n, 3)."""
    if mode == TRIANGLES:
        return np.arange(count // 3 * 3).reshape(-1, 3)
    i = np.arange(max(0, count - 2))
    if mode == FAN:
        return np.stack([i + 1, i + 2, np.zeros_like(i)], axis=1)
    return np.stack([i, i + 1 + i % 2, i + 2 - i % 2], axis=1)


def read_gltf(path: Path, limits: Limits) -> list[Any]:
    """Meshes where the file's nodes put them; those shown more than once are `Instance` of one."""
    return Reader(path, limits).read()


def load(path: Path, limits: Limits) -> Scene:
    """Read and frame."""
    return frame_mesh(read_gltf(path, limits), name=path.stem)


FORMATS = (Format("glTF", (".glb", ".gltf"), load, objects=read_gltf),)
