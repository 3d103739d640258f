"""A `Take`: one moment of a dataset before it is photographed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from sightray.scene.scene import Scene
from sightray.vision.depth_sensors.base import DepthSensor
from sightray.vision.sensor import Sensor
from sightray.vision.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Take:
    """The scenes and cameras of one frame.

    Parameters
    ----------
    frame, sequence, step, time : see `Shot`.
    scene : what there is; its own camera is none of the take's.
    cameras : by name.
    following, later : the scene and the cameras of the next moment, for flow; None if there is none.
    blurred, shutters : what the shutter sees: the scene in motion, and the cameras in motion, by name; None for pictures of
        an instant.
    stereo : whether there are two cameras, a rectified pair.
    classes : names of classes by names of objects, for `label`; they also number the classes.
    targets : indices in ``scene.objects`` of what the dataset is about; None for all that have an end.
    trajectory, next_time : see `Shot`.
    seeds : of the random numbers of each camera's picture, and of its sensors' noise.
    sensor : what makes numbers of each picture; None for pictures as they are rendered.
    depth_sensors : by name; each is built around each camera.
    note : more about the frame, for its mark; ready for JSON.
    """

    frame: int
    scene: Scene
    cameras: Mapping[str, Any]
    sequence: int = 0
    step: int = 0
    time: float = 0.0
    following: Scene | None = None
    later: Mapping[str, Any] | None = None
    blurred: Scene | None = None
    shutters: Mapping[str, Any] = field(default_factory=dict)
    stereo: bool = False
    classes: Mapping[str, str] | None = None
    targets: tuple[int, ...] | None = None
    trajectory: Trajectory | None = None
    next_time: float | None = None
    seeds: tuple[int, ...] = (0,)
    sensor: Sensor | None = None
    depth_sensors: Mapping[str, DepthSensor] = field(default_factory=dict)
    note: dict[str, Any] = field(default_factory=dict)
