"""What glTF files are made of: the GLB container, buffers, and accessors as arrays."""

from __future__ import annotations

import base64
import binascii
import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from sightray.errors import FormatError, UnsupportedError
from sightray.formats.base import Limits, asset, read_bytes

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942


class Buffers:
    """The JSON of a file, and the bytes that it refers to."""

    def __init__(self, path: Path, limits: Limits):
        self.path, self.limits = path, limits
        data = read_bytes(path, limits)
        self.binary = b""
        if data.startswith(b"glTF"):
            data, self.binary = self.chunks(data)
        try:
            self.json = json.loads(data)
        except (ValueError, RecursionError) as error:
            raise FormatError(f"not JSON: {str(error)[:200]}", path) from None
        version = str(self.get(self.get(self.json, "asset", dict, {}), "version", str, "2.0"))
        if not version.startswith("2."):
            raise UnsupportedError(f"{path}: glTF version {version[:20]}; allowed: 2.0")
        self.loaded: dict[int, bytes] = {}

    def chunks(self, data: bytes) -> tuple[bytes, bytes]:
        """JSON and binary chunk of a GLB."""
        found = {JSON_CHUNK: b"", BINARY_CHUNK: b""}
        at = 12
        while at + 8 <= len(data):
            length, kind = struct.unpack_from("<II", data, at)
            if at + 8 + length > len(data):
                raise FormatError(f"truncated: a chunk of {length} bytes, found {len(data) - at - 8}", self.path)
            if kind in found and not found[kind]:
                found[kind] = data[at + 8 : at + 8 + length]
            at += 8 + length
        return found[JSON_CHUNK], found[BINARY_CHUNK]

    def get(self, owner: Any, key: str, kind: type | tuple[type, ...], default: Any = None) -> Any:
        """A value of an expected kind; without a default it must be there."""
        value = owner.get(key, default) if isinstance(owner, dict) else None
        if not isinstance(value, kind) or isinstance(value, bool):
            wanted = getattr(kind, "__name__", "a number")
            raise FormatError(f"'{key}': got {str(value)[:60]}; expected {wanted}", self.path)
        return value

    def floats(self, owner: Any, key: str, count: int, default: Any = None) -> np.ndarray:
        """A row of `count` finite numbers."""
        given = owner.get(key, default) if isinstance(owner, dict) else default
        values = np.asarray(given) if isinstance(given, list | tuple) else np.zeros(0)
        if values.shape != (count,) or values.dtype.kind not in "iuf" or not np.isfinite(values).all():
            raise FormatError(f"'{key}': got {str(given)[:60]}; expected {count} finite numbers", self.path)
        return values.astype(np.float64)

    def item(self, key: str, index: Any) -> dict[str, Any]:
        """An object out of one of the file's lists."""
        items = self.get(self.json, key, list, [])
        if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < len(items):
            raise FormatError(f"index {str(index)[:40]} into '{key}'; allowed: 0 to {len(items) - 1}", self.path)
        if not isinstance(items[index], dict):
            raise FormatError(f"'{key}' {index} is not an object", self.path)
        return items[index]

    def uri(self, uri: str, allowed: tuple[str, ...]) -> bytes | Path:
        """Bytes of a data address, or the path of a file beside this one."""
        if uri.startswith("data:"):
            head, _, body = uri.partition(",")
            try:
                if head.endswith(";base64"):
                    return base64.b64decode(body, validate=True)
                return unquote(body).encode("latin-1")
            except (binascii.Error, UnicodeEncodeError) as error:
                raise FormatError(f"a data address: {error}", self.path) from None
        return asset(self.path, unquote(uri), allowed)

    def buffer(self, index: Any) -> bytes:
        owner = self.item("buffers", index)
        if index not in self.loaded:
            found: Any = self.binary
            if "uri" in owner:
                found = self.uri(self.get(owner, "uri", str), (".bin",))
            self.loaded[index] = read_bytes(found, self.limits) if isinstance(found, Path) else found
        return self.loaded[index]

    def view(self, index: Any) -> tuple[memoryview, int]:
        """Bytes of a buffer view, and its stride (0: packed)."""
        owner = self.item("bufferViews", index)
        data = self.buffer(owner.get("buffer"))
        start, length = self.size(owner, "byteOffset", 0), self.size(owner, "byteLength")
        if start + length > len(data):
            raise FormatError(f"bufferView {index} ends at {start + length}; its buffer at {len(data)}", self.path)
        return memoryview(data)[start : start + length], self.size(owner, "byteStride", 0)

    def size(self, owner: Any, key: str, default: int | None = None) -> int:
        value = self.get(owner, key, int, default)
        if value < 0:
            raise FormatError(f"'{key}': got {value}; allowed: at least 0", self.path)
        return value

    def accessor(self, index: Any) -> np.ndarray:
        """An accessor as (count, columns): integers, or float64 for float and normalised ones."""
        owner = self.item("accessors", index)
        count, columns = self.size(owner, "count"), COLUMNS.get(str(owner.get("type")))
        if columns is None:
            got = str(owner.get("type"))[:20]
            raise FormatError(f"accessor {index} of type {got}; allowed: {', '.join(COLUMNS)}", self.path)
        most = 3 * self.limits.max_triangles
        if count > most:
            raise FormatError(f"accessor {index}: {count} elements; allowed: {most}", self.path)
        values = np.zeros((count, columns), self.component(owner))  # zeros where only sparse values are given
        if "bufferView" in owner:
            values = self.strided(owner, owner["bufferView"], count, columns)
        if "sparse" in owner:
            sparse = self.get(owner, "sparse", dict)
            changed = self.size(sparse, "count")
            where, what = self.get(sparse, "indices", dict), self.get(sparse, "values", dict)
            at = self.strided(where, where.get("bufferView"), changed, 1).ravel()
            if len(at) and at.max() >= count:
                raise FormatError(f"accessor {index}: sparse index {at.max()}; allowed: 0 to {count - 1}", self.path)
            values = values.copy()
            what = {**what, "componentType": owner.get("componentType")}
            values[at] = self.strided(what, what.get("bufferView"), changed, columns)
        if values.dtype.kind == "f" or owner.get("normalized") is True:
            top = 1 if values.dtype.kind == "f" else np.iinfo(values.dtype).max
            return np.maximum(values.astype(np.float64) / top, -1.0 if top != 1 else -np.inf)
        return values

    def component(self, owner: Any) -> np.dtype:
        kind = owner.get("componentType")
        if not isinstance(kind, int) or kind not in COMPONENTS:
            raise FormatError(f"componentType {str(kind)[:20]}; allowed: {', '.join(map(str, COMPONENTS))}", self.path)
        return np.dtype(COMPONENTS[kind])

    def strided(self, owner: Any, view: Any, count: int, columns: int) -> np.ndarray:
        """Rows out of a buffer view, after a look at its length."""
        dtype = self.component(owner)
        data, stride = self.view(view)
        row, start = dtype.itemsize * columns, self.size(owner, "byteOffset", 0)
        stride = stride if stride else row
        if stride < row or start + (count - 1) * stride + row > len(data):
            raise FormatError(f"an accessor of {count} rows goes beyond its bufferView of {len(data)} bytes", self.path)
        return np.ndarray((count, columns), dtype, data, start, (stride, dtype.itemsize))
