"""The verbs: `load`, `render`, `explain`."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from sightray.engine.explain import Explanation
from sightray.engine.progress import Callback
from sightray.errors import SceneError, unknown
from sightray.images import Image
from sightray.registry import Member
from sightray.scene.scene import Scene


def render(
    scene: Scene,
    integrator: Member | None = None,
    *,
    samples: int | None = None,
    seed: int = 0,
    threads: int | None = None,
    sampler: Member | None = None,
    filter: Member | None = None,
    adaptive: float | None = None,
    max_samples: int | None = None,
    accelerator: Member | str | None = None,
    progress: Callback | None = None,
    partial_ok: bool = False,
) -> Image:
    """Make a picture of a scene.

    Parameters
    ----------
    scene : what to see; it must have a camera.
    integrator : how light is computed; by default the scene's own, else `Whitted`.
    samples : rays of sight per pixel; by default the scene's. A single one goes through the pixel's centre.
    seed : names the random numbers: the same seed gives the same picture, whatever the number of threads.
    threads : by default one for every core.
    sampler : where samples fall; by default `IndependentSampler`.
    filter : reconstruction filter for more than one sample; by default `BoxFilter`.
    adaptive : contrast between neighbours (0 to 1) above which pixels get additional samples; None for none.
    max_samples : samples of those pixels; by default 4 times `samples`, and at least 9.
    accelerator : structure that finds hits, or its name such as "kdtree"; by default `Bvh`.
    progress : called about ten times a second with a `Progress`.
    partial_ok : return the unfinished picture on Ctrl-C instead of raising `KeyboardInterrupt`; its
        ``info["complete"]`` is then False.

    Returns
    -------
    Image
        (height, width, 3) float32, linear Rec. 709. ``image.info`` holds samples, seed, rays and seconds.

    Raises
    ------
    SceneError
        If the scene has no camera or no shapes, or an option makes no sense.
    """
    from sightray.accelerators.base import accelerator_named
    from sightray.engine.adaptive import where_neighbours_differ
    from sightray.engine.run import run
    from sightray.filters.box import BoxFilter
    from sightray.integrators.whitted import Whitted
    from sightray.samplers.base import default_sampler
    from sightray.scene.compile import compile_scene, require_view

    _expect(scene, Scene, "render", "scene")
    integrator = _member(integrator, "integrators", "integrator") or scene.integrator or Whitted()
    samples = scene.samples if samples is None else _whole("samples", samples, 1, 1 << 20)
    seed = _whole("seed", seed, 0, (1 << 63) - 1)
    threads = None if threads is None else _whole("threads", threads, 1, 4096)
    refine = None
    if adaptive is not None:
        if not 0 <= adaptive <= 1:
            raise SceneError(f"render: adaptive: got {adaptive!r}; allowed: a contrast from 0 to 1, or None")
        most = max(9, 4 * samples) if max_samples is None else _whole("max_samples", max_samples, samples, 1 << 20)
        refine = partial(where_neighbours_differ, threshold=adaptive, extra=most - samples)
    require_view(scene)
    outcome = run(
        compile_scene(scene, _member(accelerator_named(accelerator), "accelerators", "accelerator")), integrator,
        _member(sampler, "samplers", "sampler") or default_sampler(), _member(filter, "filters", "filter") or BoxFilter(),
        samples=samples, seed=seed, threads=threads, progress=progress, refine=refine,
    )  # fmt: skip
    if not outcome.complete and not partial_ok:
        raise KeyboardInterrupt
    info = {
        "integrator": repr(integrator), "samples": samples, "seed": seed, "rays": outcome.rays,
        "seconds": outcome.seconds, "complete": outcome.complete, "sample_count": outcome.film.counts(),
    }  # fmt: skip
    return Image(outcome.film.image(), transfer=scene.transfer, info=info)


def _expect(value: Any, kind: type, verb: str, name: str) -> None:
    if not isinstance(value, kind):
        raise SceneError(f"{verb}: {name}: got {value!r}; allowed: a {kind.__name__}")


def _member(value: Any, family: str, name: str) -> Any:
    if value is not None and getattr(type(value), "family", None) != family:
        raise SceneError(f"render: {name}: got {value!r}; allowed: one of the {family}, or None")
    return value


def _whole(name: str, value: Any, least: int, most: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not least <= value <= most:
        raise SceneError(f"render: {name}: got {value!r}; allowed: a whole number from {least} to {most}")
    return int(value)


def load(path: str | Path, **limits: Any) -> Scene:
    """Read a scene: a built-in scene's name, or a file of any supported format; `formats` lists them.

    Raises
    ------
    FormatError, SceneError
        With file, line, what was found and what is allowed.
    """
    from sightray import scenes
    from sightray.formats import load_scene

    if str(path) in scenes.names():
        return scenes.build(str(path))
    if not Path(path).suffix and not Path(path).exists():
        raise SceneError(unknown("built-in scene", str(path), scenes.names()) + "; or a file's name with its suffix")
    return load_scene(path, **limits)


def explain(scene: Scene, *, pixel: tuple[int, int], integrator: Member | None = None, seed: int = 0) -> Explanation:
    """The tree of rays behind one pixel, with numbers: print it.

    Parameters
    ----------
    scene : what to see; it must have a camera.
    pixel : (column, row), from the top-left.
    integrator : by default the scene's own, else `Whitted`.
    seed : as for `render`.

    Returns
    -------
    Explanation
        Its text shows every ray of the pixel-centre sample: what it met, what each light gave, each term; ``color`` is
        their weighted sum and the pixel of a picture with one sample.
    """
    from sightray.engine.explain import explain_pixel
    from sightray.integrators.whitted import Whitted
    from sightray.scene.compile import compile_scene, require_view

    _expect(scene, Scene, "explain", "scene")
    require_view(scene)
    try:
        column, row = (int(v) for v in pixel)
    except (TypeError, ValueError):
        raise SceneError(f"explain: pixel: got {pixel!r}; allowed: (column, row), two whole numbers") from None
    chosen = _member(integrator, "integrators", "integrator") or scene.integrator or Whitted()
    return explain_pixel(compile_scene(scene), chosen, column, row, seed)


def save(scene: Scene, path: str | Path) -> None:
    """Write a scene as native YAML; large meshes go into files beside it."""
    from sightray.formats import save_scene

    _expect(scene, Scene, "save", "scene")
    save_scene(scene, path)
