"""What commands share: options, and how they become scenes and integrators."""

from __future__ import annotations

from typing import Annotated, Any

import typer

SCENE = Annotated[str, typer.Argument(help="A built-in scene's name, or a file: .yaml .test .nff .obj .ply .stl .glb")]
INTEGRATOR = Annotated[str | None, typer.Option(help="How light is computed: whitted, path, simplepath.")]
SAMPLER = Annotated[
    str | None, typer.Option(help="Where samples fall: sobol, halton, stratified, blue-noise, independent.")
]
SEED = Annotated[int, typer.Option(help="The same seed gives the same picture.")]
WIDTH = Annotated[int | None, typer.Option(help="Pixels; the height follows unless given.")]
HEIGHT = Annotated[int | None, typer.Option(help="Pixels; the width follows unless given.")]
LIMIT = Annotated[list[str] | None, typer.Option(help="Raise a limit on file sizes, such as max_triangles=50000000.")]


def limits(given: list[str] | None) -> dict[str, int]:
    """Limits of `sightray.load` from NAME=NUMBER words."""
    from sightray.errors import SceneError

    found = {}
    for word in given or ():
        name, _, value = word.partition("=")
        if not value.isdigit():
            raise SceneError(f"--limit: got '{word}'; allowed: NAME=NUMBER such as max_triangles=50000000")
        found[name] = int(value)
    return found


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
    return _named("integrators", name)


def named_sampler(name: str | None) -> Any:
    """The sampler of that name, in any case: ``blue-noise`` is `BlueNoiseSampler`."""
    return _named("samplers", name)


def _named(family: str, name: str | None) -> Any:
    """A member with its default options, by the name of its class or module, in any case, with any dashes."""
    if name is None:
        return None
    from sightray.registry import find, members

    spelled = {}
    for known, cls in members(family).items():
        spelled[known.lower()] = spelled[cls.__module__.rsplit(".", 1)[-1].replace("_", "")] = known
    return find(family, spelled.get(name.lower().replace("_", "").replace("-", ""), name))()


def contrast_or_error(given: str | None) -> float | str | None:
    """What ``--adaptive`` means: a number, or the word that `sightray.render` checks."""
    try:
        return None if given is None else float(given)
    except ValueError:
        return given
