"""``sightray heatmap``: a picture of what each pixel's ray of sight costs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from sightray.cli.common import HEIGHT, SCENE, WIDTH, resized


def heatmap(
    scene: SCENE,
    output: Annotated[Path, typer.Option("--output", "-o", help=".png .jpg .exr .hdr .pfm .npy")],
    accelerator: Annotated[str, typer.Option(help="The structure, such as bvh, kdtree, grid.")] = "bvh",
    count: Annotated[str, typer.Option(help="nodes: visited; tests: primitives asked.")] = "nodes",
    width: WIDTH = None,
    height: HEIGHT = None,
) -> None:
    """Make a picture of what each pixel's ray of sight costs in a structure, with a scale in numbers."""
    import sightray as sr
    from sightray.accelerators.base import accelerator_named
    from sightray.engine.heat import paint
    from sightray.engine.survey import count_costs
    from sightray.errors import SceneError, unknown
    from sightray.images import Image, check_writable

    if count not in ("nodes", "tests"):
        raise SceneError(f"--count: {unknown('cost', count, ['nodes', 'tests'])}")
    structure = accelerator_named(accelerator)
    check_writable(output)
    loaded = resized(sr.load(scene), width, height)
    costs = getattr(count_costs(loaded, structure), count)
    camera: Any = loaded.camera
    Image(paint(costs.reshape(camera.height, camera.width))).save(output)
    print(f"{output}: {type(structure).__name__}, {count} per ray: mean {costs.mean():.2f}, most {costs.max()}, "
          f"total {costs.sum()}")  # fmt: skip
