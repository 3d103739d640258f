"""STL, binary and ASCII: triangles without materials.

Read here rather than by trimesh: its ASCII reader skips over tokens that are no numbers, which shifts all that follow,
and takes the word "vertex" in a solid's name for geometry; and its import alone takes longer than reading the file.
The facets' normals are not used: they follow from the winding, and exporters often write zeros.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from sightray.errors import FormatError
from sightray.formats.base import Format, Limits, number, read_bytes
from sightray.formats.framing import frame_mesh
from sightray.formats.solid import solid_mesh
from sightray.scene.scene import Scene

HEADER = 84  # 80 bytes of anything, then the number of facets
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(path: Path, limits: Limits) -> list[Any]:
    """One mesh per solid; three vertices per triangle, in the order of the file, so that shading is flat."""
    data = read_bytes(path, limits)
    count = int.from_bytes(data[80:HEADER], "little") if len(data) >= HEADER else -1
    # "solid" begins some binary files too, so the length decides; some exporters add bytes at the end.
    fits = count >= 0 and len(data) == HEADER + count * FACET.itemsize
    if not fits and data.lstrip()[:5].lower() == b"solid" and b"\0" not in data:
        return _read_ascii(data.decode("latin-1"), path, limits)
    if count < 0:
        raise FormatError(f"{len(data)} bytes; expected at least {HEADER}, or text that begins with 'solid'", path)
    limits.check_triangles(count, path)
    if len(data) < HEADER + count * FACET.itemsize:
        raise FormatError(
            f"truncated: {count} facets need {HEADER + count * FACET.itemsize} bytes, found {len(data)}", path
        )
    corners = np.frombuffer(data, FACET, count, HEADER)["corners"]
    return _meshes(corners.astype(np.float64), "", path)


def _read_ascii(text: str, path: Path, limits: Limits) -> list[Any]:
    meshes: list[Any] = []
    name = ""
    solid: list[list[float]] = []
    facet: list[list[float]] = []
    for line, content in enumerate(text.splitlines(), 1):
        tokens = content.split()
        word = tokens[0].lower() if tokens else ""
        if word == "vertex":
            if len(tokens) != 4:
                raise FormatError(f"vertex: got {len(tokens) - 1} numbers; expected 3", path, line)
            facet.append([number(token, "vertex", path, line) for token in tokens[1:]])
        elif word == "endfacet":
            if len(facet) != 3:
                raise FormatError(f"facet of {len(facet)} vertices; expected 3", path, line)
            solid += facet
            facet = []
            limits.check_triangles(len(solid) // 3, path, line)
        elif word == "solid":
            name = " ".join(tokens[1:])
        elif word == "endsolid":
            if solid:
                meshes += _meshes(np.array(solid).reshape(-1, 3, 3), name, path)
            solid = []
        elif word not in ("", "facet", "outer", "endloop", "color"):
            raise FormatError(f"{tokens[0][:40]!r}; expected solid, facet, outer loop, vertex, or an end", path, line)
    if solid or facet:
        raise FormatError("truncated: no 'endsolid' at the end", path)
    return meshes


def _meshes(corners: np.ndarray, name: str, path: Path) -> list[Any]:
    if not np.isfinite(corners).all():
        facet = int(np.argwhere(~np.isfinite(corners))[0][0])
        raise FormatError(f"facet {facet}: a coordinate is not finite", path)
    mesh = solid_mesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), name=name)
    return [] if mesh is None else [mesh]


def load(path: Path, limits: Limits) -> Scene:
    """Read and frame."""
    return frame_mesh(read_stl(path, limits), name=path.stem)


FORMATS = (Format("STL", (".stl",), load, objects=read_stl),)
