"""What the docs show is what the program does: their code is run, their pictures and commands exist."""

from __future__ import annotations

import re
import sys
import types
from pathlib import Path

import numpy as np
import pytest

import sightray as sr
from sightray import registry, scenes

ROOT = Path(__file__).parents[2]
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md")])


def code_blocks(page: Path, language: str = "python") -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)


@pytest.fixture
def forget_bowl():
    yield
    registry._members["shapes"].pop("Bowl", None)
    sys.modules.pop("bowl", None)


def test_a_new_shape_in_one_file(tmp_path, forget_bowl):
    shape, use = code_blocks(ROOT / "docs" / "extending.md")
    path = tmp_path / "bowl.py"
    path.write_text(shape, encoding="utf-8")
    module = types.ModuleType("bowl")
    sys.modules["bowl"] = module
    exec(compile(shape, path, "exec"), module.__dict__)
    scope = {"Bowl": module.Bowl}
    exec(compile(use, "use.py", "exec"), scope)
    image = np.asarray(scope["image"])
    assert image.max() > 0.1
    assert "meets Bowl of Lambert" in str(sr.explain(scope["scene"], pixel=(80, 60)))
    yaml = tmp_path / "bowl.yaml"
    sr.save(scope["scene"], yaml)
    assert (np.asarray(sr.render(sr.load(yaml))) == image).all()


def test_readme_code_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sr.Scene.fields["samples"], "default", 1)
    (tmp_path / "bunny.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    scope: dict[str, object] = {"sr": sr}
    blocks = code_blocks(ROOT / "README.md")
    assert blocks
    for block in blocks:
        exec(compile(block.replace("samples=64", "samples=1"), "README.md", "exec"), scope)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_links_and_pictures_exist(page):
    for target in re.findall(r"\]\(([^)#]+?)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
        if not target.startswith("http"):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_commands_name_scenes_that_exist(page):
    text = page.read_text(encoding="utf-8")
    for name in re.findall(r"sightray (?:render|explain) ([\w-]+)(?![\w./-])", text):
        assert name == "SCENE" or name in scenes.names() or f"{name}." in text, name
    for path in re.findall(r"sightray (?:render|explain) (examples/[\w./-]+)", text):
        assert (ROOT / path).exists(), path
