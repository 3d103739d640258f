"""Labels as files: ``NAME.npy``, ``NAME.png``, ``layers.exr`` and ``labels.json``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sightray.errors import SceneError
from sightray.images.atomic import writing
from sightray.images.exr import write_layers

if TYPE_CHECKING:
    from sightray.vision.labels import Labels


def check_folder(folder: Path) -> Path:
    """Make a folder if it is not there, and find out whether files can be made in it; `SceneError` if not."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with writing(folder / "labels.json.try") as aside:
            aside.write_bytes(b"")
        (folder / "labels.json.try").unlink()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise SceneError(f"{folder}: no folder that can be written: {reason}") from error
    return folder


def save(labels: Labels, folder: Path) -> Path:
    """See `Labels.save`."""
    check_folder(folder)
    channels: dict[str, np.ndarray] = {}
    components: dict[str, str] = {}
    about = {}
    for name in labels.layers:
        layer, values = labels.about(name), labels[name]
        about[name] = {"doc": layer.summary(), "unit": layer.unit, "frame": layer.frame}
        if layer.picture:
            labels.picture(name).save(folder / f"{name}.png")
            about[name]["picture"] = f"{name}.png"
        if isinstance(values, dict):
            about[name]["value"] = plain(values)
            continue
        about[name] |= _write_arrays(folder, name, values)
        if layer.letters:
            about[name]["background"] = plain(layer.background)
        if layer.letters and values.shape[:2] == (labels.height, labels.width):
            channels[name] = values + 1 if layer.background == -1 else values
            if len(layer.letters) > 1:
                components[name] = layer.letters
    if channels:
        write_layers(folder / "layers.exr", channels, components=components)
    with writing(folder / "labels.json") as aside:
        aside.write_text(json.dumps({**facts(labels), "layers": about}, indent=1), encoding="utf-8")
    return folder


def _write_arrays(folder: Path, name: str, values: Any) -> dict[str, Any]:
    """An array as ``NAME.npy``, several under their names as ``NAME.npz``; what JSON says of it."""
    if isinstance(values, np.ndarray):
        with writing(folder / f"{name}.npy") as aside, open(aside, "wb") as file:
            np.save(file, values)
        return {"file": f"{name}.npy", "dtype": str(values.dtype), "shape": list(values.shape)}
    with writing(folder / f"{name}.npz") as aside, open(aside, "wb") as file:
        np.savez_compressed(file, **values._asdict())
    return {"file": f"{name}.npz", "arrays": list(values._fields)}


def facts(labels: Labels) -> dict[str, Any]:
    """All about a picture that is no layer, ready for JSON."""
    return {
        "width": labels.width, "height": labels.height, "camera": _camera(labels), "classes": list(labels.classes),
        "materials": [repr(material) for material in labels.materials],
        "objects": [plain(vars(thing)) for thing in labels.objects],
        "views": {name: _view(view.camera, view) for name, view in labels.views.items()},
        "pixel_coordinates": "the centre of the top-left pixel is (0.5, 0.5)",
        "camera_frame": "x right, y down, z forward",
    }  # fmt: skip


def _camera(labels: Labels) -> dict[str, Any]:
    return _view(labels.camera, labels)


def _view(camera: Any, view: Any) -> dict[str, Any]:
    fields = {name: camera.fields[name].plain(value) for name, value in camera.values().items()}
    return {
        "type": type(camera).__name__, "fields": plain(fields), "intrinsics": plain(view.intrinsics),
        "world_from_camera": plain(view.world_from_camera),
    }  # fmt: skip


def plain(value: Any) -> Any:
    """A value as JSON can hold it: arrays as lists, numbers that are not finite as None."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    if hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    return value if isinstance(value, int | str | bool | None) else repr(value)
