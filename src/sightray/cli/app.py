"""Commands of the command line, as a Typer application."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from sightray.cli.bench import bench
from sightray.cli.common import (
    HEIGHT,
    INTEGRATOR,
    LIMIT,
    SAMPLER,
    SCENE,
    SEED,
    WIDTH,
    contrast_or_error,
    limits,
    named_integrator,
    named_sampler,
    resized,
)
from sightray.cli.dataset import dataset
from sightray.cli.heatmap import heatmap
from sightray.cli.label import label
from sightray.cli.sense import sense

app = typer.Typer(
    help="Sightray follows rays of sight through scenes: pictures to look at and pictures to measure.",
    no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None,
)  # fmt: skip
app.add_typer(bench)
app.command()(heatmap)
app.command()(label)
app.command()(sense)
app.command()(dataset)


@app.command()
def render(
    scene: SCENE,
    output: Annotated[Path | None, typer.Option("--output", "-o", help=".png .jpg .exr .hdr .pfm .npy")] = None,
    integrator: INTEGRATOR = None,
    samples: Annotated[int | None, typer.Option(help="Rays of sight per pixel.")] = None,
    time: Annotated[float | None, typer.Option(help="Seconds of rendering.")] = None,
    target_error: Annotated[
        float | None, typer.Option(help="Stop at this relative standard error, such as 0.02.")
    ] = None,
    adaptive: Annotated[
        str | None, typer.Option(help="'error': samples go where noise is. Or more of them at contrasts above 0 to 1.")
    ] = None,
    sampler: SAMPLER = None,
    seed: SEED = 0,
    width: WIDTH = None,
    height: HEIGHT = None,
    limit: LIMIT = None,
    threads: Annotated[int | None, typer.Option(help="Default: one for every core.")] = None,
    denoise: Annotated[bool, typer.Option("--denoise", help="Remove noise; needs sightray[denoise].")] = False,
    checkpoint: Annotated[Path | None, typer.Option(help="File to go on from if the render is killed.")] = None,
    checkpoint_every: Annotated[float, typer.Option(help="Seconds between its states.")] = 60.0,
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the checkpoint if there is one.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress.")] = False,
) -> None:
    """Make a picture of a scene."""
    import sightray as sr
    from sightray.cli.progress import showing_progress, told
    from sightray.images import check_writable

    path = output or Path(f"{Path(scene).stem}.png")
    check_writable(path)
    loaded = resized(sr.load(scene, **limits(limit)), width, height)
    with showing_progress(quiet) as progress:
        image = sr.render(
            loaded, named_integrator(integrator), samples=samples, time=time, target_error=target_error,
            adaptive=contrast_or_error(adaptive), sampler=named_sampler(sampler), seed=seed, threads=threads,
            denoise=denoise, checkpoint=checkpoint, checkpoint_every=checkpoint_every, resume=resume,
            progress=progress, partial_ok=True,
        )  # fmt: skip
    image.save(path)
    info = image.info
    print(f"{path}: {image.width}x{image.height}, {told(info)}")
    if info["invalid_samples"]:
        share = info["invalid_samples"] / max(1, info["invalid_samples"] + info["sample_count"].sum())
        print(f"sightray: warning: {info['invalid_samples']} samples were no finite numbers ({100 * share:.2g} %) and "
              "were left out", file=sys.stderr)  # fmt: skip
    if not info["complete"]:
        print("sightray: interrupted; saved what there is", file=sys.stderr)
        raise typer.Exit(130)


@app.command()
def explain(
    scene: SCENE,
    pixel: Annotated[str, typer.Option(help="COLUMN,ROW from the top-left, such as 320,240.")],
    integrator: INTEGRATOR = None,
    seed: SEED = 0,
    width: WIDTH = None,
    height: HEIGHT = None,
    limit: LIMIT = None,
) -> None:
    """Print the tree of rays behind one pixel, with numbers."""
    import sightray as sr
    from sightray.errors import SceneError

    try:
        column, row = (int(part) for part in pixel.split(","))
    except ValueError:
        raise SceneError(f"--pixel: got '{pixel}'; allowed: COLUMN,ROW such as 320,240") from None
    loaded = resized(sr.load(scene, **limits(limit)), width, height)
    print(sr.explain(loaded, pixel=(column, row), integrator=named_integrator(integrator), seed=seed))


@app.command()
def scenes() -> None:
    """List the built-in scenes."""
    from sightray import scenes as built_in

    width = max(map(len, built_in.names()))
    for name in built_in.names():
        print(f"{name:{width}}  {built_in.summary(name)}")


@app.callback(invoke_without_command=True)
def options(version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False) -> None:
    """Sightray follows rays of sight through scenes: pictures to look at and pictures to measure."""
    if version:
        from importlib import metadata

        print(f"sightray {metadata.version('sightray')}")
        raise typer.Exit
