"""How fast Whitted pictures are: ``python benchmarks/whitted.py``, the first table of docs/performance.md.

Each line is measured in a process of its own, medians of five after one run that fills the cache, except "cold", which
empties it first.
"""

from __future__ import annotations

import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time

IMAGE = """
import sys, time
import sightray as sr
sys.path.insert(0, {here!r})
from benchmarks import whitted
scene = whitted.{name}()
image = sr.render(scene)
image = sr.render(scene)
print(image.info["seconds"], image.info["rays"])
"""


def hundred_thousand_triangles():
    """A wavy sheet of 100,352 triangles that shades and mirrors itself: shadows and one bounce, 640x480."""
    import numpy as np

    import sightray as sr

    n = 225
    x, z = np.meshgrid(np.linspace(-3, 3, n), np.linspace(-3, 3, n))
    y = 0.25 * np.sin(3 * x) * np.cos(2 * z) + 0.05 * np.sin(17 * x + 5 * z)
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    halves = (corner, corner + n, corner + 1), (corner + 1, corner + n, corner + n + 1)
    faces = np.concatenate([np.stack(half, axis=1) for half in halves])
    sheet = sr.Mesh(
        vertices=np.stack([x, y, z], -1).reshape(-1, 3), faces=faces,
        material=sr.Phong(diffuse=(0.3, 0.5, 0.7), specular=0.4, mirror=0.3),
    )  # fmt: skip
    return sr.Scene(
        sheet, sr.PointLight(position=(3, 4, 2), intensity=40), sr.DirectionalLight(direction=(1, -1, -0.5), irradiance=0.6),
        camera=sr.PerspectiveCamera(eye=(0, 2.5, 5), vfov=45, width=640, height=480),
        integrator=sr.Whitted(max_depth=1), background=(0.5, 0.6, 0.8),
    )  # fmt: skip


def cornell():
    import sightray as sr

    return sr.load("cornell")


def seconds(arguments, cache):
    began = time.perf_counter()
    subprocess.run(arguments, check=True, capture_output=True, env={**os.environ, "SIGHTRAY_CACHE_DIR": cache})
    return time.perf_counter() - began


def main() -> None:
    print(f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}")
    here = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, "out.png")
        whole = [sys.executable, "-m", "sightray", "render", "cornell", "-o", out]
        cold = [seconds(whole, os.path.join(folder, f"cold{k}")) for k in range(3)]
        warm = [seconds(whole, os.path.join(folder, "cold0")) for k in range(5)]
        print(f"sightray render cornell, whole process, cold   {statistics.median(cold):6.2f} s")
        print(f"sightray render cornell, whole process, warm   {statistics.median(warm):6.2f} s")
        for name in ("cornell", "hundred_thousand_triangles"):
            command = [sys.executable, "-c", IMAGE.format(here=here, name=name)]
            runs = []
            for _ in range(5):
                done = subprocess.run(command, check=True, capture_output=True, text=True,
                                      env={**os.environ, "SIGHTRAY_CACHE_DIR": os.path.join(folder, "cold0")})  # fmt: skip
                runs.append([float(x) for x in done.stdout.split()])
            took, rays = statistics.median(r[0] for r in runs), runs[0][1]
            print(f"{name:44}   {took:6.2f} s   {rays / took / 1e6:5.1f} Mrays/s")


if __name__ == "__main__":
    main()
