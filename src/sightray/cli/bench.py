"""``sightray bench``: measurements, as tables for people or as JSON."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from sightray.cli.common import SCENE

bench: typer.Typer = typer.Typer(name="bench", no_args_is_help=True, rich_markup_mode=None)


@bench.callback()
def measurements() -> None:
    """Measure: rays and paths each second, and structures over a scene."""


@bench.command()
def rays(
    case: Annotated[
        str, typer.Option(help="balls, thin, million, instances, spheres, stadium, adversarial; a mesh file; or all.")
    ] = "balls",
    peers: Annotated[bool, typer.Option(help="Also Open3D, Mitsuba, embreex, trimesh, if installed.")] = False,
    threads: Annotated[int | None, typer.Option(min=1, help="At most so many; by default one for every core.")] = None,
    rounds: Annotated[int, typer.Option(min=1, help="Of which medians are taken.")] = 7,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Rays each second, coherent and diffuse, nearest and any hit; by default on half a million triangles."""
    from sightray.cli import bench_rays

    bench_rays.rays(peers, as_json, case, threads, rounds)


@bench.command()
def scaling(
    largest: Annotated[int, typer.Option(min=1000, help="Triangles of the largest mesh.")] = 4_000_000,
    plot: Annotated[Path | None, typer.Option(help="Draw the tables as an SVG file.")] = None,
    rounds: Annotated[int, typer.Option(min=1, help="Of which medians are taken.")] = 5,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """What a ray costs, by threads, triangles and image size."""
    from sightray.cli import bench_scaling

    bench_scaling.scaling(as_json, plot, largest, rounds)


@bench.command()
def render(
    peers: Annotated[bool, typer.Option(help="Also Mitsuba 3, and Cycles by Blender's bpy, if installed.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="Folder to save all pictures in.")] = None,
    only: Annotated[str | None, typer.Option(help="Names of scenes with commas between; by default all four.")] = None,
    peer_python: Annotated[Path | None, typer.Option(
        help="A Python that has bpy, if this one has not.", envvar="SIGHTRAY_PEER_PYTHON")] = None,
) -> None:
    """Path tracing: paths each second, error, and time to equal error, on four scenes. Takes minutes."""
    from sightray.cli import bench_render

    bench_render.render(peers, as_json, output, only, peer_python)


@bench.command()
def accelerators(
    scene: SCENE,
    only: Annotated[
        str | None, typer.Option(help="Names with commas between, such as bvh,kdtree; by default all.")
    ] = None,
    rays: Annotated[
        int, typer.Option(min=1, help="About how many rays of sight to take, evenly over the picture.")
    ] = 5000,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, one object for each structure.")] = False,
) -> None:
    """Compare the structures that find hits: what they cost to build, and nodes and tests for each ray of sight."""
    import sightray as sr
    from sightray.accelerators.base import accelerator_named
    from sightray.engine.survey import survey
    from sightray.registry import members

    names = members("accelerators") if only is None else [name.strip() for name in only.split(",")]
    chosen = [accelerator_named(name) for name in names]
    loaded = with_pixels(sr.load(scene), rays)
    found = [survey(loaded, accelerator) for accelerator in sorted(chosen, key=lambda a: type(a).__name__)]
    if as_json:
        print(json.dumps([row._asdict() for row in found], indent=2))
    else:
        print_table(scene, found)


def with_pixels(scene: Any, count: int) -> Any:
    """The scene with a picture of the same shape that has about `count` pixels, if it has more."""
    from sightray.scene.compile import require_camera

    camera = require_camera(scene)
    shrink = min(1.0, (count / (camera.width * camera.height)) ** 0.5)
    width, height = (max(1, round(side * shrink)) for side in (camera.width, camera.height))
    return scene.replace(camera=camera.resized(width, height))


def print_table(scene: str, found: list[Any]) -> None:
    """What structures cost, a row each."""
    from rich.console import Console
    from rich.table import Table

    first = found[0]
    title = f"{scene}: {first.primitives} primitives, {first.rays} rays of sight, {first.hits} hits"
    table = Table(title=title, title_justify="left")
    table.add_column("accelerator")
    for heading in ("build s", "MB", "nodes/ray", "tests/ray", "Mrays/s"):
        table.add_column(heading, justify="right")
    for row in found:
        table.add_row(
            row.accelerator, f"{row.build_seconds:.3f}", f"{row.bytes / 1e6:.2f}", f"{row.nodes_per_ray:.1f}",
            f"{row.tests_per_ray:.1f}", f"{row.mrays_per_second:.3f}",
        )  # fmt: skip
    Console().print(table)
    print("One thread. Brute asks items, and meshes find their triangles by trees of their own, as in Bvh.")
