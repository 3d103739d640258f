"""Wavefront OBJ: polygons with positions, texture coordinates and normals of their own, and materials by name.

Read here rather than by trimesh, which takes relative indices from the end of the file instead of from where they
stand, drops normals and texture coordinates without a word when one index is bad, ignores smoothing groups, splits
quadrilaterals along the outer diagonal when they are concave, and keeps only four of a material's entries.

Texture coordinates need no turning: OBJ's v runs upwards, as Sightray's does.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from sightray.errors import FormatError
from sightray.formats.base import Format, Limits, asset, number, read_text
from sightray.formats.framing import frame_mesh
from sightray.formats.mtl import read_mtl
from sightray.formats.polygons import split_polygons
from sightray.formats.solid import solid_mesh
from sightray.scene.scene import Scene

POINTS = {"v": ("vertex", 3), "vt": ("texture coordinate", 2), "vn": ("normal", 3)}
IGNORED = frozenset({
    "g", "o", "l", "p", "vp", "mg", "cstype", "deg", "curv", "curv2", "surf", "parm", "trim", "hole", "scrv", "sp",
    "end", "bevel", "c_interp", "d_interp", "lod", "maplib", "usemap", "shadow_obj", "trace_obj", "ctech", "stech",
    "con", "bmat", "step", "call", "csh",
})  # fmt: skip
Key = tuple[str, bool, bool, str]  # material, has texture coordinates, has normals, smoothing group


class Part:
    """Polygons that become one mesh: their corners as written, one after the other, how many each has, and its line."""

    def __init__(self) -> None:
        self.corners: list[str] = []
        self.counts: list[int] = []
        self.lines: list[int] = []


def logical_lines(text: str) -> Iterator[tuple[int, str]]:
    """Lines with their 1-based numbers; a backslash at the end of a line joins it to the next one."""
    begun, head = 0, ""
    for line, content in enumerate(text.splitlines(), 1):
        if content.endswith("\\"):
            begun, head = begun or line, head + content[:-1] + " "
        else:
            yield begun or line, head + content
            begun, head = 0, ""
    if head:
        yield begun, head


class Reader:
    """What has been read so far of one file."""

    def __init__(self, path: Path, limits: Limits):
        self.path, self.limits = path, limits
        self.points: dict[str, list[list[float]]] = {word: [] for word in POINTS}
        self.parts: dict[Key, Part] = {}
        self.materials: dict[str, Any] = {}
        self.material, self.smoothing = "", ""
        self.triangles = 0

    def read(self) -> list[Any]:
        for line, content in logical_lines(read_text(self.path, self.limits)):
            tokens = content.split("#", 1)[0].split()
            if not tokens:
                continue
            word, values = tokens[0], tokens[1:]
            if word in POINTS:
                self.point(word, values, line)
            elif word == "f":
                self.face(values, line)
            elif word == "usemtl":
                self.material = " ".join(values)
            elif word == "mtllib":
                self.library(content.split(None, 1)[1].strip() if values else "", line)
            elif word == "s":
                self.smoothing = values[0] if values and values[0] not in ("off", "0") else ""
            elif word not in IGNORED:
                raise FormatError(f"{word[:40]!r}; expected v, vt, vn, f, usemtl, mtllib, s, o or g", self.path, line)
        if not self.parts:
            raise FormatError("no faces", self.path)
        return self.meshes()

    def point(self, word: str, values: list[str], line: int) -> None:
        what, needed = POINTS[word]
        if word == "vt" and len(values) == 1:
            values = [*values, "0"]  # a texture along a line
        if len(values) < needed:
            raise FormatError(f"{what}: got {len(values)} numbers; expected {needed}", self.path, line)
        # More numbers may follow: a weight, a colour, a third texture coordinate.
        self.points[word].append([number(token, what, self.path, line) for token in values[:needed]])

    def face(self, corners: list[str], line: int) -> None:
        if len(corners) < 3:
            raise FormatError(f"face of {len(corners)} corners; expected at least 3", self.path, line)
        # Relative indices count backwards from here, so they have to be resolved here.
        if any("-" in corner for corner in corners):
            corners = [self.absolute(corner, line) for corner in corners]
        shape = corners[0].split("/")
        key = (self.material, len(shape) > 1 and shape[1] != "", len(shape) > 2 and shape[2] != "", self.smoothing)
        part = self.parts.setdefault(key, Part())
        part.corners += corners
        part.counts.append(len(corners))
        part.lines.append(line)
        self.triangles += len(corners) - 2
        if self.triangles > self.limits.max_triangles:
            self.limits.check_triangles(self.triangles, self.path, line)

    def absolute(self, corner: str, line: int) -> str:
        indices = corner.split("/")
        for i, (word, index) in enumerate(zip(POINTS, indices, strict=False)):
            if index.startswith("-") and index[1:].isdigit() and len(index) < 12:
                indices[i] = str(max(0, len(self.points[word]) + 1 + int(index)))
        return "/".join(indices)

    def library(self, name: str, line: int) -> None:
        """A missing library is only worth a warning: OBJ files travel without theirs, and their shapes can be seen."""
        path = asset(self.path, name, (".mtl",), line)
        if path.exists():
            self.materials.update(read_mtl(path, self.limits))
        else:
            warnings.warn(f"{self.path}:{line}: material library {path} is missing; shapes are grey", stacklevel=2)

    def meshes(self) -> list[Any]:
        """One mesh for each material (more where some of its faces have no normals or texture coordinates)."""
        positions = np.array(self.points["v"]).reshape(-1, 3)
        wholes = [self.indices(key, part) for key, part in self.parts.items()]
        faces = [
            split_polygons(positions, np.array(part.counts), table[which, 0])
            for part, (table, which) in zip(self.parts.values(), wholes, strict=True)
        ]
        smooth = {key[3]: self.smooth(positions, key[3], wholes, faces) for key in self.parts if key[3] and not key[2]}
        result: list[Any] = []
        for key, (table, which), triangles in zip(self.parts, wholes, faces, strict=True):
            material, has_uv, has_normal, group = key
            normals = np.array(self.points["vn"])[table[:, 2]] if has_normal else None
            if not has_normal and group:
                normals = smooth[group][table[:, 0]]
            mesh = solid_mesh(
                positions[table[:, 0]], which[triangles], normals,
                uvs=np.array(self.points["vt"])[table[:, 1]] if has_uv else None,
                material=self.materials.get(material), name=material,
            )  # fmt: skip
            result += [] if mesh is None else [mesh]
        return result

    def indices(self, key: Key, part: Part) -> tuple[np.ndarray, np.ndarray]:
        """Distinct corners as (n, 3) indices (position, texture coordinate, normal), and which one each corner is."""
        number_of: dict[str, int] = {}
        which = np.array([number_of.setdefault(corner, len(number_of)) for corner in part.corners])
        limits = [len(self.points[word]) for word in POINTS]
        used = (True, key[1], key[2])
        table = np.zeros((len(number_of), 3), np.int64)
        for corner, row in number_of.items():
            indices = corner.split("/")
            for i in range(3):
                if not used[i]:
                    continue
                index = indices[i] if i < len(indices) else ""
                if not (index.isascii() and index.isdigit() and len(index) < 12 and 1 <= int(index) <= limits[i]):
                    self.bad_corner(part, corner, i, limits[i])
                table[row, i] = int(index) - 1
        return table, which

    def bad_corner(self, part: Part, corner: str, i: int, limit: int) -> None:
        line = part.lines[int(np.searchsorted(np.cumsum(part.counts), part.corners.index(corner), side="right"))]
        what = list(POINTS.values())[i][0]
        allowed = f"a {what} index from 1 to {limit}" if limit else f"no {what}, as the file has none"
        raise FormatError(f"corner {corner[:40]!r}; expected {allowed}", self.path, line)

    def smooth(self, positions: np.ndarray, group: str, wholes: list[Any], faces: list[Any]) -> np.ndarray:
        """Normals at all positions, of the faces of one smoothing group, whatever their material.

        Weighted by the angle at the corner, so that how polygons were cut does not matter (G. Thürmer, C. Wüthrich,
        "Computing vertex normals from polygonal facets", JGT 3(1), 1998).
        """
        normals = np.zeros_like(positions)
        for key, (table, which), triangles in zip(self.parts, wholes, faces, strict=True):
            if key[3] == group:
                corners = table[which[triangles], 0]
                for i in range(3):
                    a, b, c = (positions[corners[:, (i + step) % 3]] for step in range(3))
                    area = np.cross(b - a, c - a)
                    size = np.linalg.norm(area, axis=1)
                    angle = np.arctan2(size, ((b - a) * (c - a)).sum(axis=1))
                    np.add.at(normals, corners[:, i], area * (angle / np.where(size > 0, size, 1.0))[:, None])
        return normals


def read_obj(path: Path, limits: Limits) -> list[Any]:
    """Meshes of the file, one per material, each named after it."""
    return Reader(path, limits).read()


def load(path: Path, limits: Limits) -> Scene:
    """Read and frame."""
    return frame_mesh(read_obj(path, limits), name=path.stem)


FORMATS = (Format("OBJ", (".obj",), load, objects=read_obj),)
