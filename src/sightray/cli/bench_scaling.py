"""``sightray bench scaling``: how the time of a ray grows with triangles and pixels, and shrinks with threads.

*Threads*: the balls of `bench_cases` with one thread, two and so on, by the clock. **Efficiency** is the rate with k threads
over k times the rate with one; the same by processor time tells what threads cost one another (memory, caches), however
busy the machine is with other things. *Triangles*: a torus with hills of a thousand up to four million. A ray visits about
log n nodes of a balanced tree; how well the cost fits a + b log2 n is told by the least squares' share of explained
variance, R². What comes on top are caches, which large trees do not fit in, and that coherent rays share less of a tree
whose triangles are smaller than pixels. *Image size*: the balls, seen by cameras of more and more pixels.

All go through `Scene.intersect`, with NumPy arrays in and out. Rounds take turns, and the best counts. But for threads, one
thread is measured by its own processor time, so that other programs disturb little.
"""

from __future__ import annotations

import json as json_module
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sightray.cli.bench_cases import Rays, balls_mesh, bounce_rays, camera_rays, mesh_case, torus_mesh
from sightray.cli.bench_rays import warm_up

TRIANGLES = (1_000, 4_000, 16_000, 64_000, 256_000, 1_000_000, 4_000_000)
SIDES = (64, 128, 256, 512, 1024, 2048)  # pixels
EYE, TARGET, HALF = (0, -14, 4.0), (0, 0, 0), 0.5  # how the balls are looked at
ROUNDS = 5


class Row(NamedTuple):
    """What a ray costs somewhere, in nanoseconds; and the build of a tree."""

    x: int  # threads, triangles, or pixels
    coherent: float
    diffuse: float
    build: float = 0.0  # nanoseconds each triangle
    processor: tuple[float, float] = (0.0, 0.0)  # nanoseconds of all threads together, coherent and diffuse


class Fit(NamedTuple):
    """a + b log2 n through costs."""

    a: float
    b: float
    explained: float  # R², 1 for costs on the line


def in_turns(calls: dict[Any, Callable[[], Any]], rounds: int) -> dict[Any, tuple[float, float]]:
    """The best of each call by the clock and by processor time, in seconds, after one that warms up."""
    clock: dict[Any, list[float]] = {key: [] for key in calls}
    processor: dict[Any, list[float]] = {key: [] for key in calls}
    for turn in range(rounds + 1):
        for key, call in calls.items():
            start, busy = time.perf_counter(), time.process_time()
            call()
            if turn > 0:
                processor[key].append(time.process_time() - busy)
                clock[key].append(time.perf_counter() - start)
    return {key: (min(clock[key]), min(processor[key])) for key in calls}


Call = tuple[Any, Rays, int]  # scene, rays, threads


def nanoseconds(calls: dict[tuple[int, str], Call], rounds: int) -> dict[tuple[int, str], tuple[float, float]]:
    """What a ray costs by the clock and by processor time, by key."""

    def asks(scene: Any, rays: Rays, threads: int) -> Callable[[], Any]:
        return lambda: scene.intersect(*rays, threads=threads)

    spent = in_turns({key: asks(*call) for key, call in calls.items()}, rounds)
    each = {key: 1e9 / len(call[1][0]) for key, call in calls.items()}
    return {key: (each[key] * clock, each[key] * busy) for key, (clock, busy) in spent.items()}


def over_threads(most: int, rounds: int) -> list[Row]:
    """Costs with 1, 2, 4 ... threads, and with as many as there are cores."""
    import sightray as sr

    vertices, faces = balls_mesh()
    scene = sr.Scene(sr.Mesh(vertices=vertices, faces=faces))
    coherent = camera_rays(EYE, TARGET, HALF)
    rays = {"coherent": coherent, "diffuse": bounce_rays(scene, *coherent)}
    numbers = sorted({1 << k for k in range(most.bit_length()) if 1 << k <= most} | {most})
    found = nanoseconds({(k, kind): (scene, rays[kind], k) for k in numbers for kind in rays}, rounds)
    rows = []
    for k in numbers:
        (coherent_clock, coherent_busy), (diffuse_clock, diffuse_busy) = found[k, "coherent"], found[k, "diffuse"]
        rows.append(Row(k, coherent_clock, diffuse_clock, processor=(coherent_busy, diffuse_busy)))
    return rows


def over_triangles(largest: int, rounds: int) -> list[Row]:
    """Costs on meshes up to `largest` triangles."""
    import sightray as sr

    rows = []
    for wanted in [n for n in TRIANGLES if n <= largest] or [largest]:
        vertices, faces = torus_mesh(wanted)
        given = {"vertices": vertices, "faces": faces}
        build = in_turns({0: lambda given=given: sr.Mesh(**given).tree()}, min(rounds, 3))[0][1]  # type: ignore[misc]
        case = mesh_case("torus", vertices, faces)
        found = nanoseconds({(0, kind): (case.scene, rays, 1) for kind, rays in case.rays.items()}, rounds)
        rows.append(Row(len(faces), found[0, "coherent"][1], found[0, "diffuse"][1], 1e9 * build / len(faces)))
    return rows


def over_pixels(rounds: int) -> list[Row]:
    """Costs of pictures of several sizes."""
    import sightray as sr

    vertices, faces = balls_mesh()
    scene = sr.Scene(sr.Mesh(vertices=vertices, faces=faces))
    calls: dict[tuple[int, str], Call] = {}
    for side in SIDES:
        coherent = camera_rays(EYE, TARGET, HALF, side)
        calls[side, "coherent"] = scene, coherent, 1
        calls[side, "diffuse"] = scene, bounce_rays(scene, *coherent), 1
    found = nanoseconds(calls, rounds)
    return [Row(side * side, found[side, "coherent"][1], found[side, "diffuse"][1]) for side in SIDES]


def fitted(rows: list[Row], kind: str) -> Fit:
    """The line a + b log2 n through costs by triangles."""
    x, y = np.log2([row.x for row in rows]), np.array([getattr(row, kind) for row in rows])
    b, a = np.polyfit(x, y, 1) if len(rows) > 1 else (0.0, y[0])
    spread = float(((y - y.mean()) ** 2).sum())
    return Fit(float(a), float(b), 1.0 - float(((y - a - b * x) ** 2).sum()) / spread if spread > 0 else 1.0)


def efficiency(rows: list[Row], row: Row) -> list[float]:
    """The rate with k threads over k times the rate with one, coherent and diffuse; and the same by processor time."""
    one, busy = rows[0], [a / b if b > 0 else 1.0 for a, b in zip(rows[0].processor, row.processor, strict=True)]
    return [one.coherent / (row.x * row.coherent), one.diffuse / (row.x * row.diffuse), *busy]


def scaling(json: bool, plot: Path | None, largest: int, rounds: int = ROUNDS) -> None:
    """Measure and print the three tables, and draw them."""
    from sightray.mathlib.cores import core_count

    warm_up(core_count())
    threads, triangles = over_threads(core_count(), rounds), over_triangles(largest, rounds)
    pixels = over_pixels(rounds)
    if plot is not None:
        plot.write_text(plotted(threads, triangles, pixels), encoding="utf-8")
    if json:
        tables = {"threads": threads, "triangles": triangles, "pixels": pixels}
        plain: dict[str, Any] = {name: [row._asdict() for row in rows] for name, rows in tables.items()}
        plain["fit"] = {kind: fitted(triangles, kind)._asdict() for kind in ("coherent", "diffuse")}
        print(json_module.dumps(plain, indent=2))
        return
    told = {row.x: [f"{share:.2f}" for share in efficiency(threads, row)] for row in threads}
    heads = ("efficiency, coherent", "diffuse", "by processor time, coherent", "diffuse")
    print_rows("threads, balls", threads, heads, told)
    print_rows("triangles, torus", triangles, ("build, ns each",), {row.x: [f"{row.build:.0f}"] for row in triangles})
    for kind in ("coherent", "diffuse"):
        fit = fitted(triangles, kind)
        print(f"{kind}: {fit.a:.1f} + {fit.b:.1f} log2 n nanoseconds, R² {fit.explained:.3f}")
    print_rows("pixels, balls", pixels, (), {})


def print_rows(title: str, rows: list[Row], more: tuple[str, ...], cells: dict[int, list[str]]) -> None:
    """A table of costs."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title=f"{title}: nanoseconds each ray, nearest hit", title_justify="left")
    for heading in (title.split(",")[0], "coherent", "diffuse", *more):
        table.add_column(heading, justify="right")
    for row in rows:
        table.add_row(f"{row.x:,}", f"{row.coherent:.1f}", f"{row.diffuse:.1f}", *cells.get(row.x, []))
    Console(width=150).print(table)


def plotted(threads: list[Row], triangles: list[Row], pixels: list[Row]) -> str:
    """The three tables as charts."""
    from sightray.cli.charts import Chart, svg

    def curves(rows: list[Row]) -> dict[str, Any]:
        return {kind: [(row.x, getattr(row, kind)) for row in rows] for kind in ("coherent", "diffuse")}

    lines = {}
    for kind in ("coherent", "diffuse"):
        fit = fitted(triangles, kind)
        lines[kind] = [(row.x, max(0.0, fit.a + fit.b * np.log2(row.x))) for row in (triangles[0], triangles[-1])]
    rates = {kind: [(row.x, 1e3 / getattr(row, kind)) for row in threads] for kind in ("coherent", "diffuse")}
    return svg([
        Chart("Cost and triangles (dashed: a + b log n)", "triangles", "ns a ray", curves(triangles), True, lines),
        Chart("Cost and image size", "pixels", "ns a ray", curves(pixels), True),
        Chart("Rate and threads", "threads", "Mrays/s", rates),
    ])  # fmt: skip
