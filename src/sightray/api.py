"""The verbs: `load`, `render`, `label`, `explain`, `save`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from sightray.engine.explain import Explanation
from sightray.engine.progress import Callback
from sightray.errors import SceneError, unknown
from sightray.images import Image
from sightray.registry import Member
from sightray.scene.scene import Scene
from sightray.vision.labels import Labels


def render(
    scene: Scene,
    integrator: Member | None = None,
    *,
    samples: int | None = None,
    time: float | None = None,
    target_error: float | None = None,
    seed: int = 0,
    threads: int | None = None,
    sampler: Member | None = None,
    filter: Member | None = None,
    adaptive: float | str | None = None,
    max_samples: int | None = None,
    accelerator: Member | str | None = None,
    denoise: bool = False,
    checkpoint: str | Path | None = None,
    checkpoint_every: float = 60.0,
    resume: bool = False,
    progress: Callback | None = None,
    partial_ok: bool = False,
) -> Image:
    """Make a picture of a scene.

    Parameters
    ----------
    scene : what to see; it must have a camera.
    integrator : how light is computed; by default the scene's own, else `Whitted`.
    samples : rays of sight per pixel; by default the scene's. A single one goes through the pixel's centre. With
        `time` or `target_error` this is the most there may be, on average over the pixels; by default 2^20.
    time : seconds of rendering, without compiling, after which it ends. One sample of each pixel is always taken.
    target_error : relative standard error at which it ends, such as 0.02: the root of the mean over all pixels of
        ``s² / (l² + (0.1 m)²)``, where s is the standard error of a pixel's luminance l, and m the mean luminance of
        the picture. Samplers that spread samples evenly err less than this estimate says.
    seed : names the random numbers: the same seed gives the same picture, whatever the number of threads.
    threads : by default one for every core.
    sampler : where samples fall; by default `SobolSampler`.
    filter : reconstruction filter for more than one sample; by default `BoxFilter`.
    adaptive : "error" moves samples to where the estimated error is, which `target_error` always does. Or a contrast
        between neighbours (0 to 1) above which pixels get additional samples. None for none.
    max_samples : most samples of a pixel when adaptive: by contrast, by default 4 times `samples` and at least 9; by
        error 2^20.
    accelerator : structure that finds hits, or its name such as "kdtree"; by default `Bvh`.
    denoise : remove noise afterwards, guided by the colours and normals seen first; needs ``sightray[denoise]``.
    checkpoint : file for the state of the render, written every `checkpoint_every` seconds, at the end, and when it
        is interrupted. A killed render goes on from there with `resume`, and if it was not `time` that ended it, comes
        out the same to the last bit. The file stays when all is done, and serves to add samples if the sampler does not
        need to know their number (`StratifiedSampler` and `BlueNoiseSampler` do).
    resume : go on from `checkpoint` if that file exists. Everything but the limits must be as it was.
    progress : called about ten times a second with a `Progress`, whose ``image()`` is the picture so far.
    partial_ok : return the unfinished picture on Ctrl-C instead of raising `KeyboardInterrupt`; its
        ``info["complete"]`` is then False.

    Returns
    -------
    Image
        (height, width, 3) float32, linear Rec. 709. ``image.info`` holds: ``integrator``, ``sampler``, ``seed``;
        ``samples`` (mean per pixel), ``rays``, ``seconds``; ``stopped``, why it ended ("samples", "time",
        "target_error" or "interrupted"), and ``complete``, whether nobody interrupted; ``sample_count`` (h, w) int64
        and ``standard_error`` (h, w) float64 of the luminance of each pixel (infinite below two samples), and ``error``,
        of the whole picture as defined above; ``invalid_samples``, how many were no finite numbers and were left out.

    Raises
    ------
    SceneError
        If the scene has no camera or no shapes, an option makes no sense, or the checkpoint is of another render.
    UnsupportedError
        If the denoiser is not installed.
    """
    from sightray.accelerators.base import accelerator_named
    from sightray.engine.denoise import denoised, guides, require_denoiser
    from sightray.engine.options import Options
    from sightray.engine.run import run
    from sightray.filters.box import BoxFilter
    from sightray.integrators.whitted import Whitted
    from sightray.samplers.base import default_sampler
    from sightray.scene.compile import compile_scene, require_view

    _expect(scene, Scene, "render", "scene")
    if denoise:
        require_denoiser()
    integrator = _member(integrator, "integrators", "integrator") or scene.integrator or Whitted()
    sampler = _member(sampler, "samplers", "sampler") or default_sampler()
    filter = _member(filter, "filters", "filter") or BoxFilter()
    structure = _member(accelerator_named(accelerator), "accelerators", "accelerator")
    options = Options(
        samples=samples, default_samples=scene.samples, time=time, target_error=target_error, adaptive=adaptive,
        max_samples=max_samples, seed=seed, threads=threads,
    )  # fmt: skip
    require_view(scene)
    kept = options.checkpoint(checkpoint, checkpoint_every, resume, scene, integrator, sampler, filter)
    compiled = compile_scene(scene, structure)
    outcome = run(
        compiled, integrator, sampler, filter, samples=options.expected, seed=options.seed,
        schedule=options.schedule, limits=options.limits, threads=options.threads, progress=progress, checkpoint=kept,
    )  # fmt: skip
    if not outcome.complete and not partial_ok:
        raise KeyboardInterrupt
    info = {"integrator": repr(integrator), "sampler": repr(sampler), "seed": options.seed, **outcome.facts()}
    image = Image(outcome.film.image(), transfer=scene.transfer, info=info)
    if denoise and outcome.complete:
        image = denoised(image, *guides(compiled, sampler, filter, seed=options.seed, threads=options.threads))
    return image


def denoise(image: Image, albedo: Any = None, normal: Any = None) -> Image:
    """Remove noise from a picture by Intel's Open Image Denoise; needs ``pip install sightray[denoise]``.

    Parameters
    ----------
    image : linear picture.
    albedo : what it shows without light, 0 to 1: an `Image` or (height, width, 3) floats; keeps textures sharp.
    normal : shading normals, components -1 to 1: likewise; keeps edges sharp. Needs `albedo`.

    Returns
    -------
    Image
        As large; alpha is left out. ``info["denoised"]`` is True.

    Raises
    ------
    UnsupportedError
        If the denoiser is not installed.
    SceneError
        Guides of another size, or values that are not finite.
    """
    from sightray.engine.denoise import denoised

    _expect(image, Image, "denoise", "image")
    return denoised(image, albedo, normal)


def _expect(value: Any, kind: type, verb: str, name: str) -> None:
    if not isinstance(value, kind):
        raise SceneError(f"{verb}: {name}: got {value!r}; allowed: a {kind.__name__}")


def _member(value: Any, family: str, name: str) -> Any:
    if value is not None and getattr(type(value), "family", None) != family:
        raise SceneError(f"render: {name}: got {value!r}; allowed: one of the {family}, or None")
    return value


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


def label(
    scene: Scene,
    *layers: str | Member,
    camera: Member | None = None,
    next: Any = None,
    previous: Any = None,
    stereo: Any = None,
    classes: Mapping[str, str] | Sequence[str] | None = None,
    keypoints: Mapping[str, Any] | None = None,
    threads: int | None = None,
    progress: Callback | None = None,
) -> Labels:
    """Exact labels of a picture, for computer vision.

    Parameters
    ----------
    scene : what to see.
    *layers : what is wanted: names such as "depth", or layers with options such as ``CoverageLayer(samples=8)``; by
        default depth, normal and instance. docs/labels.md shows each.
    camera : by default the scene's own.
    next, previous : the pictures after and before, for flow and correspondences: a `Scene` with its camera, another
        camera for the same scene, or how many seconds later (or earlier) the same camera takes it. Objects are known
        again by their name where it is unique, else by their index.
    stereo : the other camera of a rectified pair, for disparity.
    classes : names of classes for `semantic`: a mapping from names of objects, or a list that sets the order. What is
        not named is its own class: its name, else its kind.
    keypoints : for the layer `keypoints`: name of an object -> (n, 3) points in its own frame, metres.
    threads : by default one for every core. Labels do not depend on it.
    progress : called with a `Progress` while kernels are compiled.

    Returns
    -------
    Labels
        ``labels.depth`` is (height, width) float64, and so on; ``labels.save(folder)``, ``labels.picture("depth")``.

    Raises
    ------
    SceneError
        If the scene has no camera or no shapes, a layer is unknown, or one needs a view that was not given.
    """
    from sightray.vision.label import make_labels

    _expect(scene, Scene, "label", "scene")
    return make_labels(scene, layers, camera=camera, next=next, previous=previous, stereo=stereo, classes=classes,
                       keypoints=keypoints, threads=threads, progress=progress)  # fmt: skip


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
