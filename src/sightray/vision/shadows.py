"""`shadow_mask`: the lecture's segmentation of shadow areas, from measured geometry and a light of known pose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from sightray.errors import SceneError
from sightray.lights.base import Light
from sightray.vision.label import make_labels
from sightray.vision.layers.light_shares import LightSharesLayer
from sightray.vision.measured import measured, require_camera


@dataclass(frozen=True)
class ShadowMask:
    """Which pixels lie in shadow, and why. Arrays are (height, width), row 0 on top.

    Attributes
    ----------
    visible_fraction : float64
        Share of the light that the point in the pixel's centre sees: 1 where it is lit, 0 in the umbra, between in the
        penumbra of lights with an area. Parts of the light count by what they would bring to a surface that faces
        them. NaN for the background.
    attached : bool
        The surface itself is turned away from all of the light.
    cast : bool
        Something hides all, or a part, of what the surface is turned to.
    background : bool
        No surface is seen, or the light itself.
    """

    visible_fraction: np.ndarray
    attached: np.ndarray
    cast: np.ndarray
    background: np.ndarray

    @property
    def umbra(self) -> np.ndarray:
        """Where nothing of the light is seen: (height, width) bool."""
        return self.visible_fraction == 0

    @property
    def penumbra(self) -> np.ndarray:
        """Where a part of the light is seen: (height, width) bool."""
        return (self.visible_fraction > 0) & (self.visible_fraction < 1)


def shadow_mask(geometry: Any, camera: Any, light: Any, *, rays: int = 4, threads: int | None = None) -> ShadowMask:
    """Segment the shadow that a light of known pose casts on measured geometry.

    Parameters
    ----------
    geometry : Mesh, PointCloud, any other shape, a `Group` or an `Instance`, a list of these, or a `Scene`
        What was measured, metres, world. Lights, camera and materials of a scene do not matter.
    camera : Camera
        Every pixel is asked at its centre, in the middle of the exposure; lens distortion included.
    light : Light
        At its known place. Its strength does not matter.
    rays : int, 1 to 64
        Lights with an area are asked at the middles of `rays` x `rays` parts of each cell of their `grid`, so the share
        is known to about 1 / (rays grid). Lights without an area are asked once, whatever it is.
    threads : at most so many; by default one for every core.

    Returns
    -------
    ShadowMask

    Raises
    ------
    SceneError
        If an argument is something else, or there is no surface.

    Examples
    --------
    >>> import sightray as sr
    >>> floor, ball = sr.Plane(point=(0, 0, 0), normal=(0, 1, 0)), sr.Sphere(center=(0, 1, 0), radius=0.5)
    >>> camera = sr.PerspectiveCamera(eye=(0, 3, 6), target=(0, 0, 0), width=9, height=9)
    >>> found = sr.vision.shadow_mask([floor, ball], camera, sr.PointLight(position=(0, 4, 0)))
    >>> bool(found.cast[4, 4]), float(found.visible_fraction[8, 4])
    (True, 1.0)
    """
    view = require_camera(camera, "shadow_mask")
    scene = measured(geometry, "shadow_mask")
    if not isinstance(light, Light):
        raise SceneError(f"shadow_mask: light: got {light!r}; allowed: a light, such as PointLight(position=...)")
    index = len(scene.objects)
    lit = scene.replace(objects=[*scene.objects, light])
    labels = make_labels(lit, (LightSharesLayer(rays=rays), "instance"), camera=view, threads=threads)
    seen, before = labels.light_shares[..., 0], labels.light_shares[..., 1]
    background = (labels.instance < 0) | (labels.instance == index)
    return ShadowMask(
        visible_fraction=np.where(background, np.nan, seen),
        attached=(before == 0) & ~background,
        cast=(seen < before) & ~background,
        background=background,
    )
