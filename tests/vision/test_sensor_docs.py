"""docs/sensors.md shows every depth sensor by commands that work, and code that runs."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

import sightray as sr
from sightray.cli.sense import _depth_sensor
from sightray.vision.depth_pictures import depth_picture
from sightray.vision.depth_sensors.base import known_depth_sensors

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "sensors.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| !\[depth\]\(images/sensors/(\w+)\.png\) \| !\[error\]\(images/sensors/(\w+)\.png\) .*`(.*)` \|$",
                  TEXT, re.MULTILINE)  # fmt: skip


def device_of(command: str):
    words = shlex.split(command)
    assert words[:5] == ["sightray", "sense", "examples/corner.yaml", "-o", "out"]
    return _depth_sensor(words[words.index("-d") + 1])


def test_every_depth_sensor_is_shown():
    shown = {type(device_of(command)).__name__ for _, _, command in ROWS}
    assert shown == {name for name, kind in known_depth_sensors().items() if kind.__module__.startswith("sightray.")}
    assert all(error == f"{name}_error" for name, error, _ in ROWS)
    assert all(f"**`{name}`**" in TEXT for name in shown)


@pytest.mark.parametrize("name", ["matched_stereo", "stereo_depth"])
def test_pictures_are_what_the_commands_make(name):
    """Up to the 256 colours that they were saved with."""
    command = next(command for stem, _, command in ROWS if stem == name)
    depth = device_of(command).capture(sr.load(ROOT / "examples/corner.yaml"))
    made = np.asarray(depth_picture(depth, name.replace("_", " ")))
    shown = np.asarray(sr.load_image(ROOT / "docs" / "images" / "sensors" / f"{name}.png"))[..., :3]
    assert shown.shape == made.shape
    assert (np.abs(made - shown).max(axis=-1) > 0.1).mean() < 0.01


def test_code_runs(monkeypatch):
    monkeypatch.chdir(ROOT)
    (block,) = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
    scope: dict[str, object] = {}
    exec(compile(block, "sensors.md", "exec"), scope)
    assert (scope["flight"].depth > 0).mean() > 0.8
    assert (scope["stripes"] > 0).mean() > 0.3
    assert np.isfinite(scope["disparity"]).mean() > 0.3
