"""From YAML nodes to members: classes and fields by the names that they have in Python.

Every error says line and place: ``cornell.yaml:14: materials.floor: unknown field 'albdo' for Lambert; did you mean
'albedo'? Fields: albedo, emission``.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from sightray.errors import FormatError, SceneError, did_you_mean, unknown
from sightray.fields import REQUIRED, Child, Field, Other
from sightray.formats.base import TEXTURES, Limits, asset, formats, reading
from sightray.formats.yaml_nodes import Node
from sightray.formats.yaml_transform import parse_motion, parse_transform
from sightray.images import load_image
from sightray.media.grid_files import SUFFIXES as DENSITIES
from sightray.registry import Member, members
from sightray.scene.instance import Group
from sightray.scene.scene import Scene
from sightray.shapes.mesh import Mesh

# Sections of named members, and the families whose members stand in them.
SECTIONS: dict[str, tuple[str, ...]] = {
    "materials": ("materials",), "textures": ("textures",), "shapes": ("shapes", "scene"),
}  # fmt: skip
OBJECTS = ("shapes", "lights", "scene")
FROM_FILE = ("vertices", "faces", "normals", "uvs")  # what a mesh's file states


def classes(families: Iterable[str]) -> dict[str, type[Member]]:
    """Members of some families by name, without the scene itself."""
    return {name: cls for family in families for name, cls in members(family).items() if cls is not Scene}


class Builder:
    """Builds one file's scene; named members once, however often they are referred to."""

    def __init__(self, root: Node, path: Path, limits: Limits):
        self.root, self.path, self.limits = root, path, limits
        self.built: dict[tuple[str, str], Any] = {}
        self.building: list[str] = []
        self.files: dict[Path, list[Any]] = {}
        self.triangles = 0
        self.weight = 0  # members built so far, each name counted as all that it stands for
        self.weights: dict[tuple[str, str], int] = {}

    def error(self, message: str, line: int) -> FormatError:
        return FormatError(message, self.path, line)

    def scene(self) -> Scene:
        if not isinstance(self.root.value, dict):
            raise self.error("expected a mapping with keys such as camera and objects", self.root.line)
        fields = Scene.given
        for key, line in self.root.keys.items():
            if key not in fields and key not in SECTIONS:
                raise self.error(unknown("key", key[:60], [*fields, *SECTIONS]), line)
        for section in SECTIONS:
            node = self.root.value.get(section, Node({}, 1))
            if not isinstance(node.value, dict):
                raise self.error(f"{section}: expected a mapping from names to members", node.line)
            for name in node.value:
                self.named(section, name, node.keys[name])
                self.weight = 0  # stated, not yet shown
        given = {key: node for key, node in self.root.value.items() if key in fields}
        values = {key: self.value(node, fields[key], Scene, key) for key, node in given.items()}
        return self.construct(Scene, values, self.root, "scene")

    def named(self, section: str, name: str, line: int) -> Any:
        """The member of that name, built when it is first asked for."""
        node = self.root.value.get(section, Node({}, 1))
        where = f"{section}.{name}"
        if not isinstance(node.value, dict) or name not in node.value:
            names = node.value if isinstance(node.value, dict) else {}
            known = f" Names: {', '.join(sorted(names))}" if names else f" There is no section '{section}'"
            raise self.error(f"no '{name[:60]}' in {section}{did_you_mean(name, names) or '.'}{known}", line)
        if (section, name) not in self.built:
            if where in self.building:
                raise self.error(f"cyclic reference {' -> '.join([*self.building, where])}", line)
            if len(self.building) >= self.limits.max_nesting:
                raise self.error(f"{where}: referred to through more than {self.limits.max_nesting} names", line)
            self.building.append(where)
            before, self.weight = self.weight, 0
            self.built[section, name] = self.member(node.value[name], SECTIONS[section], where)
            self.weights[section, name], self.weight = self.weight, before
            self.building.pop()
        # Groups of groups double with every level, so thirty lines could stand for a billion spheres.
        self.weight += self.weights[section, name]
        if self.weight > self.limits.max_nodes:
            raise self.error(f"{where}: more than {self.limits.max_nodes} members, counting names as all that they "
                             "stand for; raise max_nodes if the file is to be trusted", line)  # fmt: skip
        return self.built[section, name]

    def member(self, node: Node, families: tuple[str, ...], where: str) -> Any:
        """A member that is stated here, or the one whose name stands here."""
        known = classes(families)
        if isinstance(node.value, str):
            section = next((name for name, found in SECTIONS.items() if set(found) & set(families)), None)
            if section is not None:
                return self.named(section, node.value, node.line)
            node = Node({"type": node}, node.line, keys={"type": node.line})  # the class alone, with its defaults
        if not isinstance(node.value, dict) or "type" not in node.value:
            raise self.error(f"{where}: expected a mapping with 'type', one of {', '.join(sorted(known))}", node.line)
        kind = node.value["type"]
        if not isinstance(kind.value, str) or kind.value not in known:
            raise self.error(f"{where}: {unknown('type', str(kind.value)[:60], known)}", kind.line)
        cls = known[kind.value]
        if cls is Mesh and "file" in node.value:
            return self.mesh(node, where)
        return self.construct(cls, self.values(node, cls, where), node, where)

    def values(self, node: Node, cls: type[Member], where: str, but: tuple[str, ...] = ()) -> dict[str, Any]:
        """Field values of a mapping, without some keys."""
        fields = cls.given
        values = {}
        for key, part in node.value.items():
            if key == "type" or key in but:
                continue
            if key not in fields:
                near = did_you_mean(key, fields) or ";"
                what = f"unknown field '{key[:60]}' for {cls.__name__}{near} Fields: {', '.join(fields)}"
                raise self.error(f"{where}: {what}", node.keys[key])
            values[key] = self.value(part, fields[key], cls, f"{where}.{key}")
        return values

    def construct(self, cls: type[Member], values: dict[str, Any], node: Node, where: str) -> Any:
        """Call the class; its complaint gets the line of the field that it names."""
        self.weight += 1
        try:
            return cls(**values)
        except SceneError as error:
            named = str(error).removeprefix(f"{cls.__name__}.").split(":", 1)[0]
            line = node.value[named].line if named in node.value else node.line
            raise self.error(f"{where}: {error}", line) from None

    def value(self, node: Node, field: Field, cls: type[Member], where: str) -> Any:
        """What a field is to be made from: members in place of mappings and names, else plain numbers and strings."""
        if field.name == "transform":
            return parse_transform(node, self.path, where)
        if field.name == "motion":
            return parse_motion(node, self.path, where)
        if field.name == "image":
            return self.image(node, where)
        if field.name == "density" and isinstance(node.value, str):
            return asset(self.path, node.value, DENSITIES, node.line)
        if isinstance(field, Child):
            stated = isinstance(node.value, dict | str)
            return self.member(node, (field.family,), where) if stated else node.plain()
        if field.name == "objects" and not isinstance(node.value, list):
            raise self.error(f"{where}: expected a list of objects", node.line)
        if isinstance(field, Other):
            return self.other(node, cls, where)
        return node.plain()

    def other(self, node: Node, cls: type[Member], where: str) -> Any:
        """Fields with a check of their own may hold members, at any depth; those of a scene may name shapes."""
        if isinstance(node.value, list):
            return [self.other(part, cls, f"{where}[{i}]") for i, part in enumerate(node.value)]
        if cls.family == "scene" and node.value is not None:
            return self.member(node, OBJECTS if cls is Scene else SECTIONS["shapes"], where)
        if isinstance(node.value, dict) and "type" in node.value:
            return self.member(node, (*OBJECTS, "materials", "textures"), where)
        return node.plain()

    def image(self, node: Node, where: str) -> Any:
        """A picture's path relative to this file; ``file:`` takes its pixels, as if they stood here."""
        if isinstance(node.value, str):
            return str(asset(self.path, node.value, TEXTURES, node.line))
        if isinstance(node.value, dict):
            name = node.value.get("file")
            if name is None or len(node.value) != 1 or not isinstance(name.value, str):
                raise self.error(f"{where}: expected a path, numbers, or 'file: path'", node.line)
            with reading(self.path, node.line):
                return load_image(asset(self.path, name.value, TEXTURES, node.line)).pixels
        return node.plain()

    def mesh(self, node: Node, where: str) -> Any:
        """A mesh from a file, or a group of them where the file holds several."""
        file = node.value["file"]
        for key in FROM_FILE:
            if key in node.value:
                raise self.error(f"{where}: '{key}' beside 'file'; allowed: one of them", node.keys[key])
        if not isinstance(file.value, str):
            raise self.error(f"{where}.file: expected a path", file.line)
        known = {suffix: one for suffix, one in formats().items() if one.objects is not None}
        path = asset(self.path, file.value, tuple(known), file.line)
        if path not in self.files:
            read = known[path.suffix.lower()].objects
            assert read is not None
            with reading(path):
                self.files[path] = read(path, self.limits)
        found = self.files[path]
        if not found:
            raise self.error(f"{where}.file: {path.name} holds no triangles", file.line)
        self.triangles += sum(len(mesh.faces) for mesh in found)
        self.limits.check_triangles(self.triangles, self.path, file.line)
        values = self.values(node, Mesh, where, but=("file",))
        try:
            if len(found) == 1:
                return found[0].replace(**values)
            placed = {key: values.pop(key) for key in ("transform", "name") if key in values}
            return Group(objects=tuple(mesh.replace(**values) for mesh in found), **placed)
        except SceneError as error:
            raise self.error(f"{where}: {error}", node.line) from None


def is_default(field: Field, value: Any) -> bool:
    """Whether a value is what the field has anyway."""
    if field.default is REQUIRED:
        return False
    plain = field.plain(value)
    if field.default is None or plain is None:
        return plain is None and field.default is None
    return bool(field.plain(field.convert(field.default)) == plain)
