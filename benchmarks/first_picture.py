"""How soon there is something to see of a large scene, and in how much memory: ``python benchmarks/first_picture.py``.

A hilly torus of 999,696 triangles on a floor, under a sky and a lamp, 1920x1080, by paths of up to eight bounces. Times are
from the start of the Python process that renders, with kernels in the cache; the best of three. The mesh is read from a PLY
file that is written before.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

SHOW = """
import resource, sys, time
import numpy as np
began = time.perf_counter()
said = {}


def note(what):
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    said.setdefault(what, (time.perf_counter() - began, memory))


import sightray as sr
note("imported")
mesh = sr.load(sys.argv[1]).objects[0]
note("mesh read")
scene = sr.Scene(
    mesh.replace(material=sr.OrenNayar(albedo=(0.7, 0.5, 0.3), sigma=20)),
    sr.Rectangle(corner=(-6, -1.6, 6), edge_u=(12, 0, 0), edge_v=(0, 0, -12), material=sr.Lambert(albedo=0.5)),
    sr.EnvironmentLight(radiance=(0.4, 0.5, 0.7)), sr.SphereLight(center=(4, 6, 4), radius=0.5, radiance=40),
    camera=sr.PerspectiveCamera(eye=(0, 3.0, 9.0), target=(0, 0.4, 0), vfov=40, width=1920, height=1080),
)


def look(progress):
    if progress.stage == "render" and progress.done >= 1920 * 1080 / 16:
        if "coarse picture" not in said:
            progress.image()
            note("coarse picture")


image = sr.render(scene, sr.PathTracer(max_depth=8), samples=1, progress=look)
note("one sample a pixel")
for what, (seconds, memory) in said.items():
    print(f"{what};{seconds:.2f};{memory:.0f}")
if len(sys.argv) > 2:
    image.save(sys.argv[2])
"""


def write_ply(path: Path, vertices: Any, faces: Any) -> None:
    """A binary PLY file of triangles."""
    rows = np.empty(len(faces), [("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, faces
    coordinates = "".join(f"property float {axis}\n" for axis in "xyz")
    head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n{coordinates}element face {len(faces)}\n"
            "property list uchar int vertex_indices\nend_header\n")  # fmt: skip
    path.write_bytes(head.encode() + np.asarray(vertices, "<f4").tobytes() + rows.tobytes())


def main() -> None:
    from sightray.cli.bench_cases import torus_mesh

    vertices, faces = torus_mesh(1_000_000)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "torus.ply"
        write_ply(path, vertices, faces)
        best: dict[str, tuple[float, float]] = {}
        for _ in range(4):  # the first fills the cache
            ran = subprocess.run(
                [sys.executable, "-c", SHOW, str(path), *sys.argv[1:2]], check=True, capture_output=True, text=True
            )
            lines = [line.split(";") for line in ran.stdout.splitlines()]
            best = {what: min(best.get(what, (1e9, 1e9)), (float(s), float(m))) for what, s, m in lines}
    print("| after | seconds | most memory so far, MB |\n|---|---|---|")
    for what, (seconds, memory) in best.items():
        print(f"| {what} | {seconds:.2f} | {memory:.0f} |")


if __name__ == "__main__":
    main()
