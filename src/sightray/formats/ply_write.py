"""Writing meshes as PLY: binary, little-endian, float64, so that reading gives back every bit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from sightray.images.atomic import writing


def write_ply(path: Path, mesh: Any) -> None:
    """Write vertices, faces, and where the mesh has them normals (``nx ny nz``) and texture coordinates (``s t``)."""
    columns = [("x", "y", "z", mesh.vertices), ("nx", "ny", "nz", mesh.normals), ("s", "t", mesh.uvs)]
    given = [(names, values) for *names, values in columns if values is not None]
    properties = "".join(f"property double {name}\n" for names, _ in given for name in names)
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(mesh.vertices)}\n{properties}"
        f"element face {len(mesh.faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    faces = np.empty(len(mesh.faces), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
    faces["count"], faces["corners"] = 3, mesh.faces
    with writing(path) as aside, open(aside, "wb") as file:
        file.write(header.encode("ascii"))
        file.write(np.concatenate([values for _, values in given], axis=1).astype("<f8").tobytes())
        file.write(faces.tobytes())
