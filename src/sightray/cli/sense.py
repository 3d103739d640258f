"""``sightray sense``: what a camera's sensor, and depth sensors, deliver of a scene."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Annotated, Any

import typer

from sightray.cli.common import HEIGHT, INTEGRATOR, LIMIT, SCENE, SEED, WIDTH, limits, named_integrator, resized

CAMERA = (
    "Take the picture with a sensor: its fields in braces, such as '{exposure: 0.01, bits: 8}'; '{}' for the default."
)
DEPTH = "A depth sensor: its name, or '{type: TimeOfFlight, samples: 64}'; may be repeated; 'list' lists them all."


def sense(
    scene: SCENE,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Folder for the files.")] = None,
    sensor: Annotated[str | None, typer.Option(help=CAMERA)] = None,
    depth_sensor: Annotated[list[str] | None, typer.Option("--depth-sensor", "-d", help=DEPTH)] = None,
    integrator: INTEGRATOR = None,
    samples: Annotated[int | None, typer.Option(help="Rays of sight per pixel of the picture.")] = None,
    seed: SEED = 0,
    frame: Annotated[int, typer.Option(help="Number of the picture; each has noise of its own.")] = 0,
    width: WIDTH = None,
    height: HEIGHT = None,
    limit: LIMIT = None,
    threads: Annotated[int | None, typer.Option(help="Default: one for every core.")] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress.")] = False,
) -> None:
    """Deliver what sensors would: a picture with noise, measured depths, and how far those are off."""
    import sightray as sr
    from sightray.cli.progress import showing_progress
    from sightray.errors import SceneError
    from sightray.vision.save import check_folder
    from sightray.vision.sensor import noise_source

    if depth_sensor == ["list"]:
        _list()
        return
    if output is None:
        raise SceneError("sense: --output: missing; name a folder for the files, such as -o sensed")
    noise_source("sense", seed, frame)
    camera = None if sensor is None else _camera_sensor(sensor)
    devices = _named([_depth_sensor(text) for text in depth_sensor or ()])
    if camera is None and not devices:
        raise SceneError("sense: neither --sensor nor --depth-sensor; name at least one, such as -d TimeOfFlight")
    loaded = resized(sr.load(scene, **limits(limit)), width, height)
    if integrator is not None:
        loaded = loaded.replace(integrator=named_integrator(integrator))
    for device in devices.values():
        device.accept(loaded)
    check_folder(output)
    began, about = time.perf_counter(), {}
    if camera is not None:
        with showing_progress(quiet) as progress:
            image = sr.render(loaded, samples=samples, seed=seed, threads=threads, progress=progress)
        about["picture"] = _save_picture(output, camera, camera.capture(image, seed=seed, frame=frame))
    with showing_progress(quiet) as progress:
        exact = sr.label(loaded, "depth", threads=threads, progress=progress).depth if devices else None
    for name, device in devices.items():
        with showing_progress(quiet) as progress:
            depth = device.capture(loaded, seed, frame, threads, progress)
        about[name] = _save_depth(output, name, device, depth, exact)
    facts = {"seed": seed, "frame": frame, "sensors": about}
    _write(output / "sensors.json", json.dumps(facts, indent=1).encode())
    print(f"{output}: {', '.join(about)}, {time.perf_counter() - began:.1f} s")
    for name in devices:
        print(f"  {name}: {about[name]['told']}")


def _list() -> None:
    from sightray.vision.depth_sensors.base import known_depth_sensors

    for name, kind in sorted(known_depth_sensors().items()):
        print(f"{name:16} {kind.summary()}")


def _builder(option: str, text: str) -> tuple[Any, Any]:
    """A builder whose complaints name the option, and the option's value as nodes."""
    from sightray.formats.base import Limits
    from sightray.formats.yaml_build import Builder
    from sightray.formats.yaml_nodes import Node, parse

    path = Path(option)
    return Builder(Node({}, 1), path, Limits()), parse(text, path, Limits())


def _camera_sensor(text: str) -> Any:
    from sightray.vision.recipe_values import Values
    from sightray.vision.sensor import Sensor

    builder, node = _builder("--sensor", text)
    Values(Path("--sensor")).mapping(node, "sensor", tuple(Sensor.given))
    return builder.construct(Sensor, builder.values(node, Sensor, "sensor"), node, "sensor")


def _depth_sensor(text: str) -> Any:
    """A depth sensor from its name, in any case and with any dashes, or from a mapping."""
    from sightray.vision.depth_sensors.base import known_depth_sensors

    builder, node = _builder("--depth-sensor", text)
    kind = node.value["type"] if isinstance(node.value, dict) and "type" in node.value else node
    if isinstance(kind.value, str):
        spelled = {name.lower(): name for name in known_depth_sensors()}
        kind.value = spelled.get(kind.value.lower().replace("_", "").replace("-", ""), kind.value)
    return builder.member(node, ("vision.depth_sensors",), "depth sensor")


def _named(devices: list[Any]) -> dict[str, Any]:
    """Depth sensors by the names of their modules; a second one of a kind gets a number."""
    found: dict[str, Any] = {}
    for device in devices:
        name = type(device).__module__.rsplit(".", 1)[-1]
        alike = sum(known == name or known.startswith(f"{name}-") for known in found)
        found[name if alike == 0 else f"{name}-{alike + 1}"] = device
    return found


def _write(path: Path, content: Any) -> None:
    """Bytes, or an array as NumPy saves it: whole or not at all."""
    import numpy as np

    from sightray.images.atomic import writing

    with writing(path) as aside, open(aside, "wb") as file:
        if isinstance(content, bytes):
            file.write(content)
        else:
            np.save(file, content)


def _save_picture(folder: Path, sensor: Any, numbers: Any) -> dict[str, Any]:
    from sightray.vision.writers.sensors import png_of

    _write(folder / "picture.npy", numbers)
    _write(folder / "picture.png", png_of(numbers))
    return {"sensor": repr(sensor), "files": ["picture.npy", "picture.png"], "most": 2**sensor.bits - 1}


def _save_depth(folder: Path, name: str, sensor: Any, depth: Any, exact: Any) -> dict[str, Any]:
    import numpy as np

    from sightray.vision.depth_pictures import depth_picture, error_picture

    title = name.replace("_", " ")
    _write(folder / f"{name}.npy", depth)
    depth_picture(depth, title).save(folder / f"{name}.png")
    error_picture(depth, exact, title).save(folder / f"{name}_error.png")
    seen = depth > 0
    off = np.abs(depth - exact)[seen & np.isfinite(exact)]
    median = 1000 * float(np.median(off)) if len(off) else float("nan")
    told = f"{100 * seen.mean():.1f} % measured, median error {median:.3g} mm"
    return {"sensor": repr(sensor), "files": [f"{name}.npy", f"{name}.png", f"{name}_error.png"], "told": told}
