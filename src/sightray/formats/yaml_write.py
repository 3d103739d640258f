"""From a `Scene` to YAML: what `yaml_build` reads back to equal fields.

Fields that have their default are left out. Materials, textures and shapes that stand in several places get a name, so
that they stay shared. Large meshes and textures go to files of their own beside the scene's, exact to the last bit.
"""

from __future__ import annotations

import os
import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from sightray.errors import SceneError
from sightray.formats.ply_write import write_ply
from sightray.formats.yaml_build import FROM_FILE, SECTIONS, is_default
from sightray.formats.yaml_nodes import REAL, SPECIAL, WORDS
from sightray.images import Image, writing
from sightray.registry import Member
from sightray.scene.scene import Scene
from sightray.shapes.mesh import Mesh

INLINE = 64  # vertices, or values of a texture, that are written into the scene's own file
PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_./ -]*(?<! )")


class Writer:
    """Writes one scene."""

    def __init__(self, scene: Scene, path: Path):
        self.scene, self.path = scene, path
        self.uses: Counter[int] = Counter()
        self.names: dict[int, str] = {}
        self.sections: dict[str, dict[str, Any]] = {section: {} for section in SECTIONS}
        self.files: Counter[str] = Counter()

    def write(self) -> None:
        self.count(self.scene)
        body = self.state(self.scene, "scene")
        body.pop("type")
        objects = {"objects": body.pop("objects")} if "objects" in body else {}
        sections = {section: named for section, named in self.sections.items() if named}
        text = yaml.dump({**body, **sections, **objects}, Dumper=_Dumper, sort_keys=False, default_flow_style=None,
                         width=120, allow_unicode=True)  # fmt: skip
        with writing(self.path) as aside:
            aside.write_text(text, encoding="utf-8")

    def count(self, member: Member) -> None:
        """Count in how many places each member stands."""
        self.uses[id(member)] += 1
        if self.uses[id(member)] == 1:
            for value in member.values().values():
                for part in value if isinstance(value, tuple | list) else (value,):
                    if isinstance(part, Member):
                        self.count(part)

    def reference(self, member: Member, where: str) -> Any:
        """A member's name if it stands in several places, else all it states."""
        section = next((name for name, families in SECTIONS.items() if member.family in families), None)
        if self.uses[id(member)] < 2 or section is None:
            return self.state(member, where)
        if id(member) not in self.names:
            wanted = getattr(member, "name", "") or type(member).__name__.lower()
            name, number = wanted, 1
            while name in self.sections[section]:
                number += 1
                name = f"{wanted}-{number}"
            self.sections[section][name] = None  # keeps its place before what refers to it
            self.names[id(member)] = name
            self.sections[section][name] = self.state(member, f"{section}.{name}")
        return self.names[id(member)]

    def state(self, member: Member, where: str) -> dict[str, Any]:
        """A member as a mapping."""
        result: dict[str, Any] = {"type": type(member).__name__}
        beside = isinstance(member, Mesh) and len(member.vertices) > INLINE
        if beside:
            result["file"] = self.beside(getattr(member, "name", "") or "mesh", ".ply")
            write_ply(self.path.parent / result["file"], member)
        for name, field in type(member).given.items():
            value = getattr(member, name)
            if name == "image" and value is not None:
                result[name] = self.image(value)
            elif name == "density" and value.size > INLINE:
                result[name] = self.beside("density", ".npy")
                np.save(self.path.parent / result[name], value)
            elif not (beside and name in FROM_FILE) and not is_default(field, value):
                result[name] = self.plain(field.plain(value), f"{where}.{name}")
        return result

    def plain(self, value: Any, where: str) -> Any:
        """Members stated, arrays as lists, and a complaint about what YAML has no word for."""
        if isinstance(value, Member):
            return self.reference(value, where)
        if isinstance(value, np.ndarray | np.generic):
            return value.tolist()
        if isinstance(value, tuple | list):
            return [self.plain(part, f"{where}[{i}]") for i, part in enumerate(value)]
        if isinstance(value, dict):
            return {str(key): self.plain(part, f"{where}.{key}") for key, part in value.items()}
        if isinstance(value, Path):
            return str(value)
        if value is None or isinstance(value, bool | int | float | str):
            return value
        raise SceneError(f"save: {where}: {value!r} cannot be written to a file; allowed: numbers, strings and members")

    def image(self, value: Any) -> Any:
        if isinstance(value, Path):
            try:
                return Path(os.path.relpath(value, self.path.parent)).as_posix()
            except ValueError as error:  # on another drive of Windows
                raise SceneError(f"save: texture {value}: {error}") from None
        if value.size <= INLINE:
            return value.tolist()
        name = self.beside("texture", ".npy")
        Image(value).save(self.path.parent / name)
        return {"file": name}

    def beside(self, what: str, suffix: str) -> str:
        """Name for a file beside the scene's."""
        base = re.sub(r"[^\w.-]+", "_", f"{self.path.stem}.{what}")
        self.files[base] += 1
        return f"{base}-{self.files[base]}{suffix}"


class _Dumper(yaml.SafeDumper):
    """Strings that could be read as something else are quoted; nothing is aliased, since names do that."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _string(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    safe = PLAIN.fullmatch(text) and text not in WORDS and not REAL.fullmatch(text) and not SPECIAL.fullmatch(text)
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=None if safe else '"')


_Dumper.add_representer(str, _string)
