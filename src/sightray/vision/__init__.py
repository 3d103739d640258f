"""Exact labels for computer vision: layers for every pixel, boxes, poses, correspondences, and how they are written.

`sightray.label` makes a `Labels`. A layer is one file of `vision/layers`; docs/labels.md shows each. Pixel layers are
computed in one pass (`frame`): tiles of 8 x 8 pixels, whose records (`record`) are filled by casting the camera's own
rays through the pixels' centres (`casting`), and then handed to each layer's kernel.
"""

from __future__ import annotations

from typing import Any

_HOMES = {
    "Animation": "animation",
    "Around": "trajectory",
    "Keyframes": "trajectory",
    "Making": "dataset",
    "MatchedStereo": "depth_sensors.matched_stereo",
    "Orbit": "trajectory",
    "Recipe": "recipe",
    "Rig": "rigs",
    "Sensor": "sensor",
    "Shaken": "trajectory",
    "Shot": "shot",
    "StereoDepth": "depth_sensors.stereo_depth",
    "Still": "trajectory",
    "StructuredLight": "depth_sensors.structured_light",
    "TimeOfFlight": "depth_sensors.time_of_flight",
    "Trajectory": "trajectory",
    "back_project": "back_projection",
    "load_recipe": "recipe",
    "make_dataset": "dataset",
    "posed": "rigs",
    "shadow_mask": "shadows",
    "stereo_rig": "rigs",
    "write_shots": "marks",
}


def __getattr__(name: str) -> Any:
    """Names that people use, from the modules that they live in; imported when first asked for."""
    import importlib

    if name not in _HOMES:
        raise AttributeError(f"module 'sightray.vision' has no attribute '{name}'")
    return getattr(importlib.import_module(f"sightray.vision.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOMES])
