"""docs/labels.md shows every layer, made by commands that work, and code that runs."""

from __future__ import annotations

import re
import sys
import types
from pathlib import Path

import numpy as np
import pytest

import sightray as sr
from sightray import registry
from sightray.vision.label import known_layers

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "labels.md"
TEXT = PAGE.read_text(encoding="utf-8")
ROWS = re.findall(r"^\| (!?.*?) ?\| \*\*`(\w+)`\*\*(.*?) \| (.*) \|$", TEXT, re.MULTILINE)


@pytest.fixture
def forget_slant():
    yield
    registry._members["vision.layers"].pop("SlantLayer", None)


def ours():
    return {name: kind for name, kind in known_layers().items() if kind.__module__.startswith("sightray.")}


def test_every_layer_is_shown_with_what_it_says_of_itself():
    assert {name for _, name, _, _ in ROWS} == set(ours())
    for picture, name, what, _ in ROWS:
        kind = ours()[name]
        assert kind.summary() in what, name
        assert kind.unit in what, name
        assert (picture == f"![{name}](images/labels/{name}.png)") == bool(kind.picture), name


def test_commands_name_layers_and_files_that_exist():
    for _, name, _, command in ROWS:
        found = re.fullmatch(r"`sightray label (\S+) -o out --layers (\w+)((?: --\w+ \S+)*)`", command)
        if name != "keypoints":
            assert found, command
            scene, layer, options = found.groups()
            assert layer == name
            for path in (scene, *options.split()[1::2]):
                assert (ROOT / path).exists(), path


@pytest.mark.parametrize("name", ["depth", "instance", "flow", "disparity", "visible_boxes"])
def test_pictures_are_what_the_commands_make(name):
    room, after, right = (sr.load(ROOT / "examples" / f"{stem}.yaml") for stem in ("room", "room_next", "room_right"))
    made = np.asarray(sr.label(room, name, next=after, stereo=right).picture(name, legend=False))
    shown = np.asarray(sr.load_image(ROOT / "docs" / "images" / "labels" / f"{name}.png"))[: len(made)]
    assert (np.abs(made - shown).max(axis=-1) > 0.02).mean() < 1e-3


def test_conventions_name_tests_that_exist_and_show_figures():
    text = (ROOT / "docs" / "conventions.md").read_text(encoding="utf-8")
    tests = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("test_*.py"))
    lines = [line for line in text.splitlines() if line.startswith("| ") and not line.startswith("| what ")]
    assert len(lines) > 30
    for line in lines:
        named = re.findall(r"`(test_\w+)`", line)
        assert named, line
        for name in named:
            assert f"def {name}(" in tests, name
    for figure in re.findall(r"\]\((images/\S+)\)", text):
        assert (ROOT / "docs" / figure).exists(), figure


def test_code_runs(tmp_path, monkeypatch, forget_slant):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    module = types.ModuleType("labels_page")
    monkeypatch.setitem(sys.modules, "labels_page", module)
    scope = module.__dict__
    blocks = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
    assert len(blocks) == 5
    for number, block in enumerate(blocks):
        path = tmp_path / f"block{number}.py"
        path.write_text(block, encoding="utf-8")
        exec(compile(block, path, "exec"), scope)
    assert (tmp_path / "whitted-labels" / "labels.json").exists()
    slant = np.asarray(scope["slant"])
    assert 0 <= np.nanmin(slant) < np.nanmax(slant) <= np.pi / 2
    assert scope["labels"].classes[:2] == ("room", "thing")
    assert scope["raw"].shape == scope["depth"].shape == (512, 512)
    assert scope["raw"].dtype == np.uint16
