"""``sightray dataset``: pictures and labels for training, from a recipe."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from sightray.vision.dataset import Making

FORMAT = "Names with commas between, such as bop,coco; 'list' lists them all. Default: as the recipe says."


def dataset(
    recipe: Annotated[
        Path | None, typer.Argument(help="The recipe, a YAML file; docs/datasets.md explains it.")
    ] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Folder for the dataset.")] = None,
    frames: Annotated[int | None, typer.Option(help="Moments; each gives one picture per camera.")] = None,
    workers: Annotated[int, typer.Option(help="Processes.")] = 1,
    format: Annotated[str | None, typer.Option(help=FORMAT)] = None,
    samples: Annotated[int | None, typer.Option(help="Rays of sight per pixel; 0 for labels without pictures.")] = None,
    seed: Annotated[int | None, typer.Option(help="Names the random numbers.")] = None,
    threads: Annotated[int | None, typer.Option(help="Of all workers together. Default: one for every core.")] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress.")] = False,
) -> None:
    """Make a dataset from a recipe, or go on with one: pictures and exact labels in the formats of others."""
    from sightray.errors import SceneError
    from sightray.vision.dataset import make_dataset
    from sightray.vision.writers.base import known_writers

    if format == "list":
        for name, kind in sorted(known_writers().items()):
            print(f"{name:12} {kind.summary()}")
        return
    if recipe is None:
        raise SceneError("dataset: RECIPE: missing; name a YAML file")
    if output is None:
        raise SceneError("dataset: --output: missing; name a folder for the files, such as -o data")
    formats = None if format is None else [name.strip() for name in format.split(",")]
    show = _Lines(quiet)
    try:
        make_dataset(recipe, output, frames=frames, formats=formats, workers=workers, samples=samples, seed=seed,
                     threads=threads, progress=show)  # fmt: skip
    except KeyboardInterrupt:
        print(f"sightray: interrupted; {show.done} of {show.total} frames are complete: the same command goes on",
              file=sys.stderr)  # fmt: skip
        raise typer.Exit(130) from None
    print(f"{output}: {show.total} frames, {show.summary}")


class _Lines:
    """Progress: one line that is written over on a terminal, a line every few seconds elsewhere."""

    EVERY = 5.0

    def __init__(self, quiet: bool):
        self.quiet, self.done, self.total, self.last = quiet, 0, 0, -1e9
        self.summary = ""

    def __call__(self, making: Making) -> None:
        self.done, self.total = making.done, making.total
        self.summary = f"{making.fresh} made now, {making.seconds:.1f} s, {making.per_minute:.1f} frames/min"
        if self.quiet:
            return
        ended, terminal = making.done == making.total, sys.stderr.isatty()
        if terminal or ended or making.seconds - self.last >= self.EVERY:
            self.last = making.seconds
            print(_describe(making), file=sys.stderr, flush=True, end="" if terminal and not ended else "\n")


def _describe(making: Making) -> str:
    """A moment in words."""
    start = "\r\x1b[2K" if sys.stderr.isatty() else ""
    left = ""
    if making.fresh and making.done < making.total:
        minutes, seconds = divmod(round(making.seconds_left), 60)
        left = f", {minutes // 60}:{minutes % 60:02}:{seconds:02} left"
    rate = f", {making.per_minute:.1f} frames/min, {making.bytes / 1e6:.0f} MB" if making.fresh else ""
    return f"{start}{making.done}/{making.total} frames{rate}{left}"
