"""How cameras and objects of a recipe move."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from sightray.errors import SceneError
from sightray.formats.yaml_nodes import Node
from sightray.formats.yaml_transform import parse_transform
from sightray.mathlib.transform import Transform
from sightray.vision.rigs import Rig, posed, stereo_rig
from sightray.vision.trajectory import INTERPOLATIONS, Keyframes, Orbit, Trajectory

if TYPE_CHECKING:
    from sightray.vision.recipe_stage import Stage

SHAKE = ("position", "degrees", "low", "high")
VIEW = ("target", "distance", "azimuth", "elevation", "roll", "speed", "shake")
PATH = ("interpolation", "keyframes", "shake")
MOTION = ("interpolation", "keyframes")


def view_of(stage: Stage) -> Trajectory | None:
    """How the camera stands and moves: ``view`` or ``path``; None for what the scene says."""
    view, path, values = stage.drawn("view"), stage.drawn("path"), stage.values
    if view is not None:
        entries = values.mapping(view, "view", VIEW)
        found: Trajectory = values.located(
            lambda: Orbit(values.numbers(entries, "target", (0, 0, 0), 3), values.number(entries, "distance", 3.0),
                          elevation=values.number(entries, "elevation", 20.0),
                          azimuth=values.number(entries, "azimuth", 0.0), roll=values.number(entries, "roll", 0.0),
                          speed=values.number(entries, "speed", 0.0)), line=view.line)  # fmt: skip
        return _shaken(stage, found, entries)
    if path is None:
        return None
    entries = values.mapping(path, "path", PATH, ("keyframes",))
    frames = [values.mapping(part, "keyframes", ("time", "eye", "target"), ("time", "eye", "target"))
              for part in _list(stage, entries["keyframes"])]  # fmt: skip
    times = [values.number(frame, "time", 0.0) for frame in frames]
    eyes, targets = ([values.numbers(frame, key, (), 3) for frame in frames] for key in ("eye", "target"))
    kind = values.word(entries, "interpolation", "cubic", INTERPOLATIONS)
    found = values.located(lambda: Keyframes.looking(times, eyes, targets, interpolation=kind), line=path.line)
    return _shaken(stage, found, entries)


def _shaken(stage: Stage, trajectory: Trajectory, entries: dict[str, Node]) -> Trajectory:
    if "shake" not in entries:
        return trajectory
    values, node = stage.values, entries["shake"]
    shake = values.mapping(node, "shake", SHAKE)
    options = {key: values.number(shake, key, 0.0) for key in shake}
    return values.located(lambda: trajectory.shaken(stage.dice.at("shake").whole(), **options), line=node.line)


def motion_of(stage: Stage, node: Node) -> Trajectory:
    """How an object moves from where it was put."""
    values = stage.values
    entries = values.mapping(node, "motion", MOTION, ("keyframes",))
    frames = [values.mapping(part, "keyframes", ("time", "transform"), ("time",))
              for part in _list(stage, entries["keyframes"])]  # fmt: skip
    times = [values.number(frame, "time", 0.0) for frame in frames]
    poses = [_transform(stage, frame) for frame in frames]
    kind = values.word(entries, "interpolation", "cubic", INTERPOLATIONS)
    return values.located(lambda: Keyframes(times, poses, kind), line=node.line)


def _transform(stage: Stage, entries: dict[str, Node]) -> Transform:
    found = parse_transform(entries["transform"], stage.recipe.path, "transform") if "transform" in entries else None
    return found or Transform()


def rig_of(stage: Stage, camera: Any) -> Rig | None:
    """The cameras: ``rig: {stereo: baseline}``, or ``rig: {cameras: {name: pose in the rig}}``."""
    node, values = stage.drawn("rig"), stage.values
    if node is None:
        return None
    entries = values.mapping(node, "rig", ("stereo", "cameras"))
    if len(entries) != 1:
        raise values.error("rig: expected 'stereo' or 'cameras'", node.line)
    if "stereo" in entries:
        return values.located(lambda: stereo_rig(camera, values.number(entries, "stereo", 0.1)), line=node.line)
    stated = entries["cameras"]
    if not isinstance(stated.value, dict) or not stated.value:
        raise values.error("rig: cameras: expected poses by name", stated.line)
    lead = camera.world_from_camera()
    poses = {name: _transform(stage, {"transform": part}).matrix for name, part in stated.value.items()}
    if not np.allclose(next(iter(poses.values())), np.eye(4)):
        raise values.error("rig: cameras: the first one is the rig's frame: its pose is []", stated.line)
    try:
        return Rig({name: posed(camera, lead @ pose) for name, pose in poses.items()})
    except SceneError as error:
        raise values.error(f"rig: {error}", stated.line) from None


def _list(stage: Stage, node: Node) -> list[Node]:
    if not isinstance(node.value, list) or not node.value:
        raise stage.values.error("keyframes: expected a list of at least one", node.line)
    return node.value
