"""`Labels`: what `sightray.label` gives back."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sightray.cameras.base import Camera
from sightray.errors import did_you_mean
from sightray.images import Image
from sightray.scene.scene import Scene
from sightray.vision.layers.base import Layer
from sightray.vision.view import View

if TYPE_CHECKING:
    from sightray.vision.frame import Frame, ObjectInfo


class Labels:
    """The label layers of one picture: ``labels.depth``, or ``labels["depth"]``; read them, save them, look at them.

    Every value belongs to the ray through a pixel's *centre*, at (column + 0.5, row + 0.5), the lens's centre, and the
    middle of the exposure, so labels are never mixed of two surfaces; `coverage` alone counts many rays. Layers for
    pixels are arrays (height, width) or (height, width, n), row 0 on top. All vectors are in the frame that the layer
    names: ``world`` (right-handed, metres) or ``camera`` (x right, y down, z forward).

    Attributes
    ----------
    layers : tuple of str
        Labels of the layers that were asked for, in that order. ``labels[name]`` is the array (or whatever the layer's
        class says); ``labels.about(name)`` is the `Layer`, with its unit, frame, background value and description.
    scene : Scene
        What was labelled.
    width, height : int, pixels
    camera : Camera
        What the picture was labelled with.
    intrinsics : (3, 3) float64, pixels, or None
        K of a pinhole camera: ``[u, v, 1] ~ K @ p_camera``, with the top-left pixel's *centre* at (0.5, 0.5): formats
        that put it at (0, 0) subtract 0.5 from both coordinates of the principal point. Of a camera with lens
        distortion the straight part, beside the fields of ``labels.camera``. None for cameras without focal lengths.
    world_from_camera, camera_from_world : (4, 4) float64, metres
        Pose of the camera in OpenCV's frame, and its inverse.
    objects : tuple of ObjectInfo
        Everything that can be seen: ``index`` (its value in `instance`), ``name``, ``category`` (class), ``kind``,
        ``world_from_object`` (4, 4), and the box ``lower``, ``upper`` in its own frame. Layers with a row for each
        object (`boxes`, `poses`, `amodal_masks` ...) follow this order.
    classes : tuple of str
        Names of classes; a value of `semantic` is an index in it.
    materials : tuple of Material
        A value of `material` is an index in it.
    lights : tuple of Light
        In the order of the last axis of `light_visibility` and the like.
    views : dict of str to View
        The other views that were given, under "next", "previous" and "stereo".

    Examples
    --------
    >>> import sightray as sr
    >>> scene = sr.Scene(sr.Sphere(radius=1, name="ball"),
    ...                  camera=sr.PerspectiveCamera(eye=(0, 0, 5), target=(0, 0, 0), width=9, height=9))
    >>> labels = sr.label(scene, "depth", "instance")
    >>> float(labels.depth[4, 4]), int(labels.instance[4, 4]), int(labels.instance[0, 0])
    (4.0, 0, -1)
    >>> labels.objects[0].name, labels.layers
    ('ball', ('depth', 'instance'))
    """

    layers: tuple[str, ...]
    scene: Scene
    width: int
    height: int
    camera: Camera
    intrinsics: np.ndarray | None
    world_from_camera: np.ndarray
    camera_from_world: np.ndarray
    classes: tuple[str, ...]
    materials: tuple[Any, ...]
    lights: tuple[Any, ...]
    views: dict[str, View]

    def __init__(self, frame: Frame, layers: dict[str, Layer]):
        view = frame.view
        self._frame, self._about = frame, layers
        self.layers = tuple(layers)
        self.scene = view.given
        self.width, self.height, self.camera = frame.width, frame.height, view.camera
        self.intrinsics, self.world_from_camera = view.intrinsics, view.world_from_camera
        self.camera_from_world = view.camera_from_world
        self.classes, self.materials = frame.classes, frame.materials
        others = {"next": frame.next, "previous": frame.previous, "stereo": frame.stereo}
        self.lights = view.scene.lights
        self.views = {name: other for name, other in others.items() if other is not None}

    @property
    def objects(self) -> tuple[ObjectInfo, ...]:
        """Everything that can be seen, in the scene's order."""
        return self._frame.objects

    def __getitem__(self, name: str) -> Any:
        if name not in self._about:
            raise KeyError(self._missing(name))
        return self._frame.values[name]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name not in self._about:
            raise AttributeError(self._missing(name))
        return self._frame.values[name]

    def hidden(self, name: str) -> Any:
        """A layer that was computed because another needs it, too."""
        return self._frame.values[name]

    def _missing(self, name: str) -> str:
        if name.startswith("_"):
            return f"Labels has no attribute '{name}'"
        return f"no layer '{name}'{did_you_mean(name, self._about)} Here: {', '.join(self._about)}"

    def __contains__(self, name: object) -> bool:
        return name in self._about

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self._about})

    def __repr__(self) -> str:
        return f"<Labels {self.width}x{self.height}: {', '.join(self.layers)}>"

    def about(self, name: str) -> Layer:
        """The layer's class with its options: what its values mean."""
        if name not in self._about:
            raise KeyError(self._missing(name))
        return self._about[name]

    def picture(self, name: str, *, legend: bool = True) -> Image:
        """A layer in colours, for people: with a legend below that says what they stand for.

        Raises
        ------
        SceneError
            If the layer is no picture, such as `boxes`.
        """
        from sightray.vision.pictures import paint

        self.about(name)
        return paint(self, name, legend)

    def save(self, folder: str | Path) -> Path:
        """Write everything into a folder, made if it is not there; each file whole or not at all.

        ``NAME.npy`` holds a layer bit for bit, ``NAME.png`` its picture with a legend; ``layers.exr`` all layers for
        pixels as 32-bit floats and integers under their names (ids are stored plus one, so that 0 is the background);
        ``labels.json`` all that is no array for pixels, the camera, objects, classes, and what each layer means.

        Returns
        -------
        Path
            The folder.

        Raises
        ------
        SceneError
            If the folder cannot be made or written.
        """
        from sightray.vision.save import save

        return save(self, Path(folder))
