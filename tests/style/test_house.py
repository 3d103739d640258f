"""The rules of the house: layers, sizes, what an import costs, names that do not collide."""

from __future__ import annotations

import subprocess
import sys
from collections import Counter
from pathlib import Path
from statistics import median

import pytest

import sightray as sr
from sightray.registry import FAMILIES, members

ROOT = Path(__file__).parents[2]
SOURCES = sorted((ROOT / "src").rglob("*.py"))


def test_imports_go_only_downward():
    lint = subprocess.run(
        [sys.executable, "-c", "from importlinter.cli import lint_imports_command; lint_imports_command()"],
        cwd=ROOT, capture_output=True, text=True,
    )  # fmt: skip
    assert lint.returncode == 0, lint.stdout


def test_files_are_short():
    lines = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in SOURCES}
    assert median(lines.values()) <= 150
    assert {path: n for path, n in lines.items() if n > 600} == {}


@pytest.mark.parametrize("heavy", ["numba", "llvmlite", "trimesh", "PIL", "OpenEXR", "yaml", "typer", "rich"])
def test_import_is_light(heavy):
    code = f"import sys, sightray as sr; sr.Sphere(); sr.Mesh; sr.render; sys.exit({heavy!r} in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_class_names_are_unique_over_all_families():
    names = Counter(name for family in FAMILIES for name in members(family))
    assert [name for name, count in names.items() if count > 1] == []


def test_every_member_is_found_by_name_and_documented():
    for family in FAMILIES:
        for name, cls in members(family).items():
            if cls.__module__.startswith("sightray."):
                assert getattr(sr, name) is cls
                assert len(cls.__doc__ or "") > 20, name
                for field in cls.fields.values():
                    assert field.doc, (name, field.name)


def test_unknown_name_offers_the_nearest():
    with pytest.raises(AttributeError, match="did you mean 'Sphere'"):
        sr.Shpere  # noqa: B018
