"""Built-in scenes: one file each, whose `build` makes the scene and whose docstring's first line describes it."""

from __future__ import annotations

import functools
import importlib
import pkgutil
from types import ModuleType
from typing import Any


@functools.cache
def names() -> tuple[str, ...]:
    """Names of all built-in scenes: the modules of this folder."""
    return tuple(sorted(m.name.replace("_", "-") for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_")))


def _module(name: str) -> ModuleType:
    return importlib.import_module(f"sightray.scenes.{name.replace('-', '_')}")


def summary(name: str) -> str:
    """One line about a built-in scene."""
    return (_module(name).__doc__ or "").strip().splitlines()[0]


def build(name: str) -> Any:
    """Make a built-in scene."""
    return _module(name).build()
