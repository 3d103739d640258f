"""``sightray label``: exact labels of a scene's picture, as files."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from sightray.cli.common import HEIGHT, LIMIT, SCENE, WIDTH, limits, resized

LAYERS = "Names with commas between, such as depth,normal,instance; 'list' lists them all."


def label(
    scene: SCENE,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Folder for the files.")] = None,
    layers: Annotated[str, typer.Option(help=LAYERS)] = "depth,normal,instance",
    next: Annotated[str | None, typer.Option(help="The next picture's scene, for flow.")] = None,
    previous: Annotated[str | None, typer.Option(help="The previous picture's scene, for backward flow.")] = None,
    stereo: Annotated[str | None, typer.Option(help="A scene with the other camera of a rectified pair.")] = None,
    width: WIDTH = None,
    height: HEIGHT = None,
    limit: LIMIT = None,
    threads: Annotated[int | None, typer.Option(help="Default: one for every core.")] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress.")] = False,
) -> None:
    """Make exact labels of a scene's picture: depth, normals, instances, flow, boxes, poses and more."""
    import sightray as sr
    from sightray.cli.progress import showing_progress
    from sightray.errors import SceneError
    from sightray.vision.label import as_layer, known_layers
    from sightray.vision.save import check_folder

    if layers == "list":
        for name, kind in sorted(known_layers().items()):
            print(f"{name:24} {kind.summary()}")
        return
    if output is None:
        raise SceneError("label: --output: missing; name a folder for the files, such as -o labels")
    wanted = [as_layer(name.strip()) for name in layers.split(",")]
    allowed = limits(limit)
    views = [None if path is None else resized(sr.load(path, **allowed), width, height)
             for path in (scene, next, previous, stereo)]  # fmt: skip
    check_folder(output)
    began = time.perf_counter()
    with showing_progress(quiet) as progress:
        labels = sr.label(
            views[0], *wanted, next=views[1], previous=views[2], stereo=views[3], threads=threads, progress=progress
        )  # fmt: skip
    seconds = time.perf_counter() - began
    labels.save(output)
    print(f"{output}: {labels.width}x{labels.height}, {', '.join(labels.layers)}, {seconds:.2f} s")
