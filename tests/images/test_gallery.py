"""The gallery: every scene file loads and has its picture and its entry, and between them they show every member."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import sightray as sr
from sightray import scenes
from sightray.images import load_image
from sightray.registry import Member, members

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
FILES = sorted((ROOT / "examples" / "gallery").glob("*.yaml"))


def parts_of(thing, seen):
    """Add the names of all members within `thing` to `seen`."""
    if isinstance(thing, Member):
        seen.add(type(thing).__name__)
        for value in thing.values().values():
            parts_of(value, seen)
    elif isinstance(thing, list | tuple):
        for part in thing:
            parts_of(part, seen)


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_each_scene_file_has_its_picture_and_its_command(path):
    scene = sr.load(path)
    assert scene.integrator is not None, "states its integrator"
    assert f"`sightray render examples/gallery/{path.name} -o {path.stem}.png`" in PAGE
    assert f"(pictures/gallery/{path.stem}.png)" in PAGE
    height, width = load_image(ROOT / "docs" / "pictures" / "gallery" / f"{path.stem}.png").pixels.shape[:2]
    assert (height, width) == (scene.camera.height, scene.camera.width)


@pytest.mark.parametrize("family", ["integrators", "materials", "lights", "cameras", "textures", "media"])
def test_every_member_is_shown(family):
    seen: set[str] = set()
    for path in FILES:
        scene = sr.load(path)
        parts_of([scene, scene.integrator, scene.camera], seen)
    for name in re.findall(r"`sightray render ([\w-]+)", PAGE):
        if name in scenes.names():
            scene = sr.load(name)
            parts_of([scene, scene.integrator, scene.camera], seen)
    ours = {name for name, member in members(family).items() if member.__module__.startswith("sightray.")}
    assert ours - seen == set()
