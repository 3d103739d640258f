"""PLY, the Stanford triangle format (G. Turk, 1994): ASCII and binary, both byte orders, polygons of any size.

Read here rather than by trimesh, which refuses binary files that mix triangles with other polygons, merges or splits
vertices that carry texture coordinates, and takes counts at their word.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sightray.errors import FormatError, UnsupportedError, unknown
from sightray.formats.base import TEXTURES, Format, Limits, asset, read_bytes
from sightray.formats.framing import frame_mesh
from sightray.formats.polygons import split_polygons
from sightray.formats.solid import solid_mesh
from sightray.materials.lambert import Lambert
from sightray.scene.scene import Scene
from sightray.textures.bitmap import Bitmap

TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
    "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip
ORDERS = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}
UV_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
MAX_PROPERTIES = 200  # of one element


class Property(NamedTuple):
    name: str
    type: str  # a NumPy type, as is the next
    length: str = ""  # of the number in front of a list; empty for plain values


class Element(NamedTuple):
    name: str
    rows: int
    properties: list[Property]


class Lists(NamedTuple):
    """Lists of different lengths: all their values, one after the other, and how many each has."""

    values: np.ndarray
    counts: np.ndarray


def read_ply(path: Path, limits: Limits) -> list[Any]:
    """One mesh, with normals and texture coordinates (see `UV_NAMES`) where the file has them.

    Texture coordinates per face corner give each triangle vertices of its own. A comment ``TextureFile`` becomes the
    material's texture. Colours and all other properties are ignored.
    """
    data = read_bytes(path, limits)
    elements, order, begin, texture = _header(data, path)
    body = data[begin:]
    if order == "ascii":
        elements = [_as_doubles(element) for element in elements]
        body = _ascii_body(data, begin, path)
    tables: dict[str, dict[str, Any]] = {}
    at = 0
    for element in elements:
        if element.rows > 3 * limits.max_triangles:
            raise FormatError(f"{element.rows} rows of element '{element.name}'; allowed: {3 * limits.max_triangles}. "
                              "Raise max_triangles if the file is to be trusted", path)  # fmt: skip
        tables[element.name], at = _read_element(body, at, element, ORDERS[order], path)
        if "vertex" in tables and "face" in tables:
            break

    # Gather what a mesh takes from what the file calls it.
    vertex = tables.get("vertex", {})
    face = tables.get("face", {})
    polygons = face.get("vertex_indices", face.get("vertex_index"))
    if polygons is None and "tristrips" in tables:
        raise UnsupportedError(f"{path}: triangle strips; allowed: an element 'face' with a list 'vertex_indices'")
    vertices = _columns(vertex, "x", "y", "z")
    if vertices is None or not isinstance(polygons, Lists) or not len(polygons.counts):
        raise FormatError("no triangles; expected 'vertex' with x y z and 'face' with a list vertex_indices", path)
    corners = _indices(polygons, len(vertices), path)
    triangles = split_polygons(vertices, polygons.counts, corners)
    limits.check_triangles(len(triangles), path)
    normals = _columns(vertex, "nx", "ny", "nz")
    uvs = next((found for names in UV_NAMES if (found := _columns(vertex, *names)) is not None), None)
    faces = corners[triangles]
    wedges = face.get("texcoord")
    if isinstance(wedges, Lists) and (wedges.counts == 2 * polygons.counts).all():
        uvs = wedges.values.reshape(-1, 2)[triangles.ravel()].astype(np.float64)
        vertices, normals = vertices[faces.ravel()], None if normals is None else normals[faces.ravel()]
        faces = np.arange(faces.size).reshape(-1, 3)
    material = None
    if texture and uvs is not None and (image := asset(path, texture, TEXTURES)).exists():
        material = Lambert(albedo=Bitmap(image=str(image)))
    mesh = solid_mesh(vertices, faces, normals, uvs=uvs, material=material)
    return [] if mesh is None else [mesh]


def _header(data: bytes, path: Path) -> tuple[list[Element], str, int, str]:
    """Elements, byte order, where the body begins, and the texture's file name."""
    end = data.find(b"end_header", 0, 1 << 20)
    if not data.startswith(b"ply") or end < 0:
        raise FormatError("not a PLY file; expected 'ply' in the first line and a line 'end_header'", path)
    begin = data.find(b"\n", end) + 1
    if begin == 0:
        begin = len(data)
    elements: list[Element] = []
    order = texture = ""
    for line, content in enumerate(data[:end].decode("latin-1").splitlines(), 1):
        tokens = content.split()
        try:
            match tokens:
                case ["format", name, *_]:
                    order = name
                case ["element", name, count]:
                    elements.append(Element(name, _count(count), []))
                case ["property", "list", count, kind, name]:
                    elements[-1].properties.append(Property(name, TYPES[kind], TYPES[count]))
                case ["property", kind, name]:
                    elements[-1].properties.append(Property(name, TYPES[kind]))
                case ["comment", "TextureFile", *words]:
                    texture = " ".join(words)
                case [] | ["ply" | "comment" | "obj_info", *_]:
                    pass
                case _:
                    raise FormatError(f"{content[:60]!r}; expected format, element, property, comment", path, line)
        except KeyError as error:
            raise FormatError(unknown("type", str(error.args[0])[:40], TYPES), path, line) from None
        except (IndexError, ValueError) as error:
            if isinstance(error, FormatError):
                raise
            raise FormatError(f"{content[:60]!r}; expected an element and its number of rows", path, line) from None
    if order not in ORDERS:
        raise FormatError(unknown("format", order[:40], ORDERS), path)
    if any(len(element.properties) > MAX_PROPERTIES for element in elements):
        raise FormatError(f"an element of more than {MAX_PROPERTIES} properties", path)
    return elements, order, begin, texture


def _count(token: str) -> int:
    if not token.isascii() or not token.isdigit() or len(token) > 18:
        raise ValueError
    return int(token)


def _as_doubles(element: Element) -> Element:
    return element._replace(properties=[Property(p.name, "f8", "f8" if p.length else "") for p in element.properties])


def _ascii_body(data: bytes, begin: int, path: Path) -> bytes:
    """The numbers of an ASCII body as little-endian doubles, so that from here on there is one way to read."""
    text = data[begin:].decode("latin-1")
    try:
        return np.array(text.split(), dtype="<f8").tobytes()
    except ValueError:
        before = data.count(b"\n", 0, begin)
        for line, content in enumerate(text.splitlines(), before + 1):
            for token in content.split():
                try:
                    float(token)
                except ValueError:
                    raise FormatError(f"got {token[:40]!r}; expected a number", path, line) from None
        raise


def _read_element(body: bytes, at: int, element: Element, order: str, path: Path) -> tuple[dict[str, Any], int]:
    """Columns of an element by property name, and where the next one begins."""
    properties = element.properties
    shortest = sum(np.dtype(p.length if p.length else p.type).itemsize for p in properties)
    if element.rows * shortest > len(body) - at:
        raise FormatError(
            f"truncated: {element.rows} rows of element '{element.name}' need {element.rows * shortest} bytes or more, "
            f"found {len(body) - at}", path,
        )  # fmt: skip
    if element.rows == 0 or not properties:
        return {}, at

    # Most files have lists of one length, all triangles: then rows are alike, and NumPy reads them at once.
    lengths = [len(values) for values in _walk_row(body, at, element, order, path)[0]]
    row = np.dtype([
        entry for i, (p, n) in enumerate(zip(properties, lengths, strict=True))
        for entry in ([(f"n{i}", order + p.length)] if p.length else []) + [(f"v{i}", order + p.type, (n,))]
    ])  # fmt: skip
    if element.rows * row.itemsize <= len(body) - at:
        table = np.frombuffer(body, row, element.rows, at)
        if all((table[f"n{i}"] == lengths[i]).all() for i, p in enumerate(properties) if p.length):
            columns: dict[str, Any] = {}
            for i, p in enumerate(properties):
                values = table[f"v{i}"]
                columns[p.name] = Lists(values.ravel(), np.full(element.rows, lengths[i])) if p.length else values[:, 0]
            return columns, at + element.rows * row.itemsize

    rows = []
    for _ in range(element.rows):
        row_values, at = _walk_row(body, at, element, order, path)
        rows.append(row_values)
    columns = {}
    for i, p in enumerate(properties):
        joined = np.concatenate([values[i] for values in rows])
        columns[p.name] = Lists(joined, np.array([len(values[i]) for values in rows])) if p.length else joined
    return columns, at


def _walk_row(body: bytes, at: int, element: Element, order: str, path: Path) -> tuple[list[Any], int]:
    """One row as an array per property (of one value where it is no list), and where the row ends."""
    row = []
    for p in element.properties:
        n = 1.0
        if p.length:
            width = np.dtype(p.length).itemsize
            n = float(np.frombuffer(body, order + p.length, 1, at)[0]) if at + width <= len(body) else -1.0
            at += width
        width = np.dtype(p.type).itemsize
        if not (0 <= n <= (len(body) - at) // width and n == int(n)):
            raise FormatError(f"a list '{p.name}' of element '{element.name}' goes beyond the end of the file", path)
        row.append(np.frombuffer(body, order + p.type, int(n), at))
        at += int(n) * width
    return row, at


def _columns(table: dict[str, Any], *names: str) -> np.ndarray | None:
    """Columns side by side as doubles; None unless all are there."""
    found = [table.get(name) for name in names]
    if not all(isinstance(column, np.ndarray) for column in found):
        return None
    return np.stack([column.astype(np.float64) for column in found if column is not None], axis=1)


def _indices(polygons: Lists, vertices: int, path: Path) -> np.ndarray:
    """Corners of all polygons, checked."""
    if (polygons.counts < 3).any():
        bad = int(np.argmax(polygons.counts < 3))
        raise FormatError(f"face {bad} has {polygons.counts[bad]} corners; allowed: at least 3", path)
    raw = polygons.values
    wrong = ~((raw >= 0) & (raw < vertices) & (raw == np.floor(raw)))
    if wrong.any():
        raise FormatError(f"vertex index {raw[np.argmax(wrong)]}; allowed: 0 to {vertices - 1}", path)
    return raw.astype(np.int64)


def load(path: Path, limits: Limits) -> Scene:
    """Read and frame."""
    return frame_mesh(read_ply(path, limits), name=path.stem)


FORMATS = (Format("PLY", (".ply",), load, objects=read_ply),)
