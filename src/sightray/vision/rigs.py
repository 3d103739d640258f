"""Cameras at given poses, and several cameras that move as one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from sightray.cameras.base import Camera
from sightray.errors import SceneError
from sightray.mathlib.transform import Transform
from sightray.vision.trajectory import rigid
from sightray.vision.view import is_linear


def posed(camera: Camera, world_from_camera: Any) -> Camera:
    """The same camera elsewhere.

    Parameters
    ----------
    camera : one with a field ``pose``, or with ``eye``, ``target`` and ``up``; the distance between eye and target, at
        which lenses may be in focus, stays.
    world_from_camera : (4, 4), rigid; axes as in OpenCV.

    Raises
    ------
    SceneError
        If the camera states its pose in another way.
    """
    pose = rigid(world_from_camera, "posed")
    fields = camera.given
    if "pose" in fields:
        return camera.replace(pose=Transform(pose))
    if {"eye", "target", "up"} <= fields.keys():
        distance = float(np.linalg.norm(np.subtract(camera.target, camera.eye)))  # type: ignore[attr-defined]
        eye, level = pose[:3, 3], {"roll": 0.0} if "roll" in fields else {}
        return camera.replace(eye=eye, target=eye + distance * pose[:3, 2], up=-pose[:3, 1], **level)
    raise SceneError(f"posed: got a {type(camera).__name__}; allowed: cameras with a pose, or with eye, target and up")


class Rig:
    """Several cameras that are fixed to one another.

    Parameters
    ----------
    cameras : camera by name, the first one leads: the rig's frame is its frame. Their own poses say where they stand to
        one another; only that matters.

    Examples
    --------
    >>> import sightray as sr
    >>> pair = stereo_rig(sr.PerspectiveCamera(width=64, height=48), baseline=0.1)
    >>> left, right = pair.at(np.eye(4)).values()
    >>> right.eye
    (0.1, 0.0, 0.0)
    """

    def __init__(self, cameras: Mapping[str, Camera]):
        self.cameras = dict(cameras)
        if not self.cameras or not all(isinstance(camera, Camera) for camera in self.cameras.values()):
            raise SceneError(f"Rig: got {cameras!r}; allowed: cameras by name, at least one")
        first = np.linalg.inv(next(iter(self.cameras.values())).world_from_camera())
        self.rig_from_camera = {name: first @ camera.world_from_camera() for name, camera in self.cameras.items()}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the cameras."""
        return tuple(self.cameras)

    @property
    def rectified(self) -> bool:
        """Whether these are two pinholes side by side with the same axes, for disparity."""
        if len(self.cameras) != 2 or not all(is_linear(camera) for camera in self.cameras.values()):
            return False
        aside = self.rig_from_camera[self.names[1]]
        level = np.eye(4)
        level[0, 3] = aside[0, 3]
        left, right = (camera.intrinsics() for camera in self.cameras.values())  # type: ignore[attr-defined]
        alike = (np.abs(left - right)[[0, 1, 1], [0, 1, 2]] <= 1e-9 * left[0, 0]).all()
        return bool(aside[0, 3] > 0 and np.abs(aside - level).max() <= 1e-9 * max(1.0, aside[0, 3]) and alike)

    def at(self, world_from_rig: Any) -> dict[str, Camera]:
        """The cameras, with the first one at this pose."""
        pose, lead = np.asarray(world_from_rig, np.float64), self.names[0]
        return {
            name: posed(camera, pose if name == lead else pose @ self.rig_from_camera[name])
            for name, camera in self.cameras.items()
        }


def stereo_rig(camera: Camera, baseline: float) -> Rig:
    """A rectified pair: "left" is the camera, "right" the same, `baseline` metres along its +x axis.

    A camera that states its pose by eye and target is made again from its axes; those of the two differ by rounding.
    """
    if not baseline > 0:
        raise SceneError(f"stereo_rig: baseline {baseline!r}; allowed: a length > 0, metres")
    aside = np.eye(4)
    aside[0, 3] = baseline
    return Rig({"left": camera, "right": posed(camera, camera.world_from_camera() @ aside)})
