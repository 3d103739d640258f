"""``sightray bench render``: path tracing, by itself and against Mitsuba 3 and Cycles: time, paths each second, time to
equal error.

Every renderer draws the same scenes at the same size and depth, in turns, so that what else the machine does meets all
alike. The error of a picture is relMSE, the mean of (x - r)² / (r² + 0.01) over pixels and channels, against a reference
r of many more samples. For unbiased renderers it falls as one over the time, nearly; **time to error** is read from the
straight line through the logarithms of what was measured. We run first with as many samples in every pixel, as the
others do, which is what paths each second are compared by; then with ``adaptive="error"``, which spends as many where the
estimated error is, and the scene's own number of shadow rays; and with both kinds of samples by `SharedPathTracer`. Time to
error is compared by the best of these. The reference is ours, with as many samples everywhere.

Cycles runs in a process of its own (see `bench_cycles`); the time to hand over the scene and the picture is not counted
for it. ``bias`` is how far the mean of a renderer's picture is from the reference's, of all samples and rounds together:
beyond noise it tells that two did not render the same scene.
"""

from __future__ import annotations

import json as json_module
import math
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

SCENES = ("cornell", "still-life", "teapot-under-sky", "thousand-lights")
SIDE = 128  # height of the pictures, pixels
SAMPLES = (16, 32, 64, 128)
REFERENCE = 2048
EPSILON = 0.01

Render = Callable[[int, int], np.ndarray]  # samples and seed to a picture


class Renderer(NamedTuple):
    """Somebody who can render a scene."""

    name: str
    render: Render
    fixed: float = 0.0  # seconds of each picture that are not counted


class Result(NamedTuple):
    """What a renderer does on a scene."""

    scene: str
    renderer: str
    mpaths_per_second: float
    seconds: tuple[float, ...]  # for each of SAMPLES
    relmse: tuple[float, ...]
    seconds_to_error: float  # to reach what we reach with the most samples
    bias: float  # mean over that of the reference, minus 1
    absent: str = ""


def rel_mse(picture: np.ndarray, reference: np.ndarray) -> float:
    """Mean of squared differences over squared references."""
    return float(np.mean((picture - reference) ** 2 / (reference**2 + EPSILON)))


def bench_scene(name: str, height: int) -> Any:
    """A built-in scene at the size of the race."""
    import sightray as sr

    scene = sr.load(name)
    camera = scene.camera
    return scene.replace(camera=camera.resized(round(height * camera.width / camera.height), height), ambient=0)


def depth_of(scene: Any) -> int:
    """Bounces: the scene's own, or 8."""
    return getattr(scene.integrator, "max_depth", 8) if scene.integrator is not None else 8


def sightray_renderers(scene: Any, threads: int) -> list[Renderer]:
    """Ourselves: first as the others do it, then with what we have beside."""
    import sightray as sr

    plain = sr.PathTracer(max_depth=depth_of(scene))
    own = plain if scene.integrator is None else scene.integrator
    shared = sr.SharedPathTracer(max_depth=depth_of(scene), light_samples=getattr(own, "light_samples", 1))
    ways = {"sightray": (plain, None), "sightray, adaptive": (own, "error"), "sightray, shared": (shared, None),
            "sightray, shared, adaptive": (shared, "error")}  # fmt: skip

    def renderer(name: str, tracer: Any, adaptive: Any) -> Renderer:
        return Renderer(name, lambda samples, seed: np.asarray(
            sr.render(scene, tracer, samples=samples, seed=seed, threads=threads, adaptive=adaptive)))  # fmt: skip

    return [renderer(name, *way) for name, way in ways.items()]


def mitsuba_renderer(scene: Any, threads: int) -> Renderer:
    """Mitsuba 3, compiling with LLVM, three colours."""
    import drjit
    import mitsuba as mi

    from sightray.cli.mitsuba_scene import mitsuba_dict

    mi.set_variant("llvm_ad_rgb")
    drjit.set_thread_count(threads)
    loaded = mi.load_dict(mitsuba_dict(scene, mi, depth_of(scene)))
    return Renderer(f"Mitsuba {mi.__version__}", lambda samples, seed: np.array(
        mi.render(loaded, spp=samples, seed=seed)))  # fmt: skip


def cycles_renderer(scene: Any, threads: int) -> Renderer:
    """Cycles on the processor, in its own process."""
    from sightray.cli.bench_cycles import Cycles

    cycles = Cycles(scene, depth_of(scene), threads)
    return Renderer(cycles.name, cycles.render, cycles.fixed)


PEERS = {"Mitsuba": mitsuba_renderer, "Cycles": cycles_renderer}


def race(name: str, peers: bool, threads: int, folder: Path | None, rounds: int = 3) -> list[Result]:
    """All renderers on one scene."""
    scene = bench_scene(name, SIDE)
    runners, absent = sightray_renderers(scene, threads), []
    for peer, make in PEERS.items() if peers else ():
        try:
            runners.append(make(scene, threads))
        except Exception as reason:
            said = f"{type(reason).__name__}: {reason}".splitlines()[0][:100]
            absent.append(Result(name, peer, math.nan, (), (), math.nan, math.nan, said))
    reference = runners[2].render(REFERENCE, 1_000_003)

    # In turns; the first round warms up and is not counted. The median of times, the mean of errors.
    times: dict[tuple[str, int], list[float]] = {}
    errors: dict[tuple[str, int], list[float]] = {}
    means: dict[str, list[float]] = {}
    for turn in range(rounds + 1):
        for samples in SAMPLES:
            for runner in runners:
                start = time.perf_counter()
                picture = runner.render(samples, turn)
                taken = time.perf_counter() - start - runner.fixed
                if turn > 0:
                    times.setdefault((runner.name, samples), []).append(taken)
                    errors.setdefault((runner.name, samples), []).append(rel_mse(picture, reference))
                    means.setdefault(runner.name, []).extend([float(picture.mean(dtype=float))] * samples)
                if folder is not None and turn == rounds:
                    _save(picture, folder / f"{name}-{runner.name.lower().replace(', ', '-').split()[0]}-{samples}.png")
    if folder is not None:
        _save(reference, folder / f"{name}-reference.png")
    goal = float(np.mean(errors[runners[0].name, SAMPLES[-1]]))
    pixels = reference.shape[0] * reference.shape[1]
    found = []
    for runner in runners:
        seconds = tuple(float(np.median(times[runner.name, s])) for s in SAMPLES)
        error = tuple(float(np.mean(errors[runner.name, s])) for s in SAMPLES)
        rate = pixels * SAMPLES[-1] / seconds[-1] / 1e6
        bias = float(np.mean(means[runner.name])) / float(reference.mean(dtype=float)) - 1
        found.append(Result(name, runner.name, rate, seconds, error, time_to(goal, seconds, error), bias))
    return found + absent


def time_to(goal: float, seconds: tuple[float, ...], errors: tuple[float, ...]) -> float:
    """When the error falls to the goal, by a straight line through logarithms of times and errors."""
    slope, offset = np.polyfit(np.log(errors), np.log(seconds), 1)
    return float(np.exp(offset + slope * np.log(goal)))


def _save(picture: np.ndarray, path: Path) -> None:
    import sightray as sr

    sr.Image(np.float32(picture[..., :3])).save(path)


def render(peers: bool, json: bool, folder: Path | None, only: str | None, peer_python: Path | None = None) -> None:
    """Measure, and print a table or JSON. `peer_python` has what this Python has not: Blender's ``bpy``."""
    from sightray.cli.bench_cycles import PYTHON
    from sightray.mathlib.cores import core_count

    if peer_python is not None:
        os.environ[PYTHON] = str(peer_python)
    os.environ.setdefault("DRJIT_LIBLLVM_PATH", "/usr/lib/x86_64-linux-gnu/libLLVM-19.so")
    threads = core_count()
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    names = SCENES if only is None else tuple(name.strip() for name in only.split(","))
    results = [result for name in names for result in race(name, peers, threads, folder)]
    if json:
        rows = [result._asdict() for result in results]
        print(json_module.dumps({"threads": threads, "samples": SAMPLES, "results": rows}, indent=2))
        return
    print_results(results, threads)


def print_results(results: list[Result], threads: int) -> None:
    """A table: for peers in brackets how many times as many paths we trace, and how much sooner we reach an error."""
    from rich.console import Console
    from rich.table import Table

    title = f"Path tracing at height {SIDE}, {threads} threads; in brackets: sightray is that many times as fast"
    table = Table(title=title)
    for heading in ("scene", "renderer", "Mpaths/s", f"s at {SAMPLES[-1]}", f"relMSE at {SAMPLES[-1]}", "s to our error",
                    "mean"):  # fmt: skip
        table.add_column(heading, justify="left" if heading in ("scene", "renderer") else "right")
    even: dict[str, Result] = {}
    best: dict[str, Result] = {}
    for row in results:
        if row.absent:
            table.add_row(row.scene, row.renderer, f"absent: {row.absent}", "", "", "", "")
            continue
        rate, when = f"{row.mpaths_per_second:.2f}", f"{row.seconds_to_error:.2f}"
        if row.renderer.startswith("sightray"):
            even.setdefault(row.scene, row)
            best[row.scene] = min(row, best.get(row.scene, row), key=lambda one: one.seconds_to_error)
        else:
            rate += f" ({even[row.scene].mpaths_per_second / row.mpaths_per_second:.2f})"
            when += f" ({row.seconds_to_error / best[row.scene].seconds_to_error:.2f})"
        table.add_row(row.scene, row.renderer, rate, f"{row.seconds[-1]:.2f}", f"{row.relmse[-1]:.2e}", when,
                      f"{row.bias:+.2%}")  # fmt: skip
    Console().print(table)
