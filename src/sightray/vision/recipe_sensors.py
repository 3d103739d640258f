"""The devices that a recipe names: what its camera delivers, and the depth sensors beside it."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from sightray.formats.yaml_build import Builder
from sightray.formats.yaml_nodes import Node
from sightray.vision.depth_sensors.base import DepthSensor
from sightray.vision.sensor import Sensor
from sightray.vision.shot import PICTURE

if TYPE_CHECKING:
    from sightray.vision.recipe_stage import Stage

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,59}")  # becomes a folder


def sensor_of(stage: Stage) -> Sensor | None:
    """``sensor: {exposure: 0.01, bits: 8, ...}``: fields of `Sensor`."""
    node = stage.drawn("sensor")
    if node is None:
        return None
    stage.values.mapping(node, "sensor", tuple(Sensor.given))
    builder = _builder(stage)
    found: Sensor = builder.construct(Sensor, builder.values(node, Sensor, "sensor"), node, "sensor")
    return found


def depth_sensors_of(stage: Stage) -> dict[str, DepthSensor]:
    """``depth_sensors: {name: {type: TimeOfFlight, ...}, ...}``: depth sensors by names of folders."""
    node = stage.drawn("depth_sensors")
    if node is None:
        return {}
    if not isinstance(node.value, dict) or not node.value:
        raise stage.values.error("depth_sensors: expected depth sensors by name", node.line)
    found: dict[str, DepthSensor] = {}
    for name, part in node.value.items():
        if not NAME.fullmatch(name) or name == PICTURE:
            allowed = f"letters, digits, _ and -, and not '{PICTURE}'"
            raise stage.values.error(f"depth_sensors: name {name[:60]!r}; allowed: {allowed}", node.keys[name])
        found[name] = _builder(stage).member(part, ("vision.depth_sensors",), f"depth_sensors.{name}")
    return found


def _builder(stage: Stage) -> Builder:
    return Builder(Node({}, 1), stage.recipe.path, stage.recipe.limits)
