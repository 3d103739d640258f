"""Which layers are computed, in which order: behind `sightray.label`."""

from __future__ import annotations

from typing import Any

from sightray.cameras.base import Camera
from sightray.errors import SceneError, unknown
from sightray.registry import members
from sightray.scene.compile import require_view
from sightray.scene.queries import thread_option
from sightray.scene.scene import Scene
from sightray.vision.frame import Frame
from sightray.vision.labels import Labels
from sightray.vision.layers.base import Layer
from sightray.vision.view import View, other_view

_plain: dict[type[Layer], Layer] = {}
DEFAULT = ("depth", "normal", "instance")


def known_layers() -> dict[str, type[Layer]]:
    """All layers by label."""
    found: dict[str, Any] = {cls.label: cls for cls in members("vision.layers").values()}  # type: ignore[attr-defined]
    return found


def plain_layer(kind: type[Layer]) -> Layer:
    """The layer with its default options; one for the process, so that scenes keep one row for it."""
    if kind not in _plain:
        _plain[kind] = kind()
    return _plain[kind]


def as_layer(value: Any) -> Layer:
    """A layer from its label, or as it is."""
    if isinstance(value, Layer):
        return value
    known = known_layers()
    if not isinstance(value, str) or value not in known:
        if isinstance(value, str):
            raise SceneError(f"label: {unknown('layer', value, known)}")
        raise SceneError(f"label: got {value!r}; allowed: names of layers, or layers such as CoverageLayer(samples=8)")
    return plain_layer(known[value])


def make_labels(scene: Scene, layers: tuple[Any, ...], *, camera: Any = None, next: Any = None, previous: Any = None,
                stereo: Any = None, classes: Any = None, keypoints: Any = None, threads: Any = None,
                progress: Any = None) -> Labels:  # fmt: skip
    """What `sightray.label` documents."""
    if camera is not None:
        if not isinstance(camera, Camera):
            raise SceneError(f"label: camera: got {camera!r}; allowed: a camera, or None")
        view = View(scene, camera)
        require_view(scene.replace(camera=camera) if scene.camera is None else scene)
    else:
        view = View(scene, require_view(scene))
    others = {"next": next, "previous": previous, "stereo": stereo}
    frame = Frame(
        view, classes=classes, keypoints=keypoints, threads=thread_option("label", threads), progress=progress,
        **{name: other_view(value, view, name) for name, value in others.items()},
    )  # fmt: skip
    wanted = {layer.label: layer for layer in map(as_layer, layers or DEFAULT)}
    compute(frame, wanted)
    return Labels(frame, wanted)


def compute(frame: Frame, wanted: dict[str, Layer]) -> None:
    """Fill ``frame.values`` with layers and all that they need: pixel layers in one pass, then the others in order."""
    order: dict[str, Layer] = {}
    for layer in wanted.values():
        put_in_order(layer, order, frame, wanted)
    pixelwise = [layer for layer in order.values() if layer.pixelwise(frame)]
    frame.values.update(zip([layer.label for layer in pixelwise], frame.run(pixelwise), strict=True))
    for name, layer in order.items():
        if name not in frame.values:
            frame.values[name] = layer.compute(frame)


def put_in_order(layer: Layer, order: dict[str, Layer], frame: Frame, wanted: dict[str, Layer]) -> None:
    """Add a layer to ``order``, after all that it needs."""
    if layer.label not in order:
        for name in layer.needs(frame):
            put_in_order(wanted.get(name) or as_layer(name), order, frame, wanted)
        order[layer.label] = layer
