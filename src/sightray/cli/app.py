"""Commands of the command line, as a Typer application."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

app = typer.Typer(
    help="Sightray follows rays of sight through scenes: pictures to look at and pictures to measure.",
    no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None,
)  # fmt: skip

SCENE = Annotated[str, typer.Argument(help="A built-in scene's name, or a file: .yaml .test .nff .obj .ply .stl .glb")]
INTEGRATOR = Annotated[str | None, typer.Option(help="How light is computed: whitted, path, simplepath.")]
SEED = Annotated[int, typer.Option(help="The same seed gives the same picture.")]
WIDTH = Annotated[int | None, typer.Option(help="Pixels; the height follows unless given.")]
HEIGHT = Annotated[int | None, typer.Option(help="Pixels; the width follows unless given.")]


@app.command()
def render(
    scene: SCENE,
    output: Annotated[Path | None, typer.Option("--output", "-o", help=".png .jpg .exr .hdr .pfm .npy")] = None,
    integrator: INTEGRATOR = None,
    samples: Annotated[int | None, typer.Option(help="Rays of sight per pixel.")] = None,
    adaptive: Annotated[
        float | None, typer.Option(help="More samples where neighbours' contrast is above this, 0 to 1.")
    ] = None,
    seed: SEED = 0,
    width: WIDTH = None,
    height: HEIGHT = None,
    threads: Annotated[int | None, typer.Option(help="Default: one for every core.")] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress.")] = False,
) -> None:
    """Make a picture of a scene."""
    import sightray as sr
    from sightray.cli.progress import showing_progress
    from sightray.images import check_writable

    path = output or Path(f"{Path(scene).stem}.png")
    check_writable(path)
    loaded = resized(sr.load(scene), width, height)
    with showing_progress(quiet) as progress:
        image = sr.render(
            loaded, named_integrator(integrator), samples=samples, adaptive=adaptive, seed=seed, threads=threads,
            progress=progress, partial_ok=True,
        )  # fmt: skip
    image.save(path)
    info = image.info
    rate = info["rays"] / max(info["seconds"], 1e-9) / 1e6
    print(f"{path}: {image.width}x{image.height}, {info['seconds']:.2f} s, {rate:.1f} Mrays/s")
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
) -> None:
    """Print the tree of rays behind one pixel, with numbers."""
    import sightray as sr
    from sightray.errors import SceneError

    try:
        column, row = (int(part) for part in pixel.split(","))
    except ValueError:
        raise SceneError(f"--pixel: got '{pixel}'; allowed: COLUMN,ROW such as 320,240") from None
    loaded = resized(sr.load(scene), width, height)
    print(sr.explain(loaded, pixel=(column, row), integrator=named_integrator(integrator), seed=seed))


@app.command()
def scenes() -> None:
    """List the built-in scenes."""
    from sightray import scenes as built_in

    for name in built_in.names():
        print(f"{name:18} {built_in.summary(name)}")


@app.callback(invoke_without_command=True)
def options(version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False) -> None:
    """Sightray follows rays of sight through scenes: pictures to look at and pictures to measure."""
    if version:
        from importlib import metadata

        print(f"sightray {metadata.version('sightray')}")
        raise typer.Exit


def resized(scene: Any, width: int | None, height: int | None) -> Any:
    """The scene with another picture size; the missing side follows the camera's proportions."""
    if width is None and height is None:
        return scene
    from sightray.scene.compile import require_camera

    camera = require_camera(scene)
    if width is None:
        width = max(1, round(height * camera.width / camera.height))
    if height is None:
        height = max(1, round(width * camera.height / camera.width))
    return scene.replace(camera=camera.resized(width, height))


def named_integrator(name: str | None) -> Any:
    """The integrator of that class or module name, in any case, with its default options: ``path`` is `PathTracer`."""
    if name is None:
        return None
    from sightray.registry import find, members

    spelled = {}
    for known, cls in members("integrators").items():
        spelled[known.lower()] = spelled[cls.__module__.rsplit(".", 1)[-1]] = known
    return find("integrators", spelled.get(name.lower().replace("_", ""), name))()


# Commands in files of their own, which use what stands above.
from sightray.cli import bench as _bench  # noqa: E402
from sightray.cli import heatmap as _heatmap  # noqa: E402

app.add_typer(_bench.bench)
app.command()(_heatmap.heatmap)
