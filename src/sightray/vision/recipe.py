"""Recipes: scenes that are drawn at random, as YAML.

::

    seed: 7
    samples: 64
    ground: {height: 0, area: [[-0.6, -0.6], [0.6, 0.6]]}        # [x, z] from, to
    place:
      - {shape: {type: Mesh, file: bunny.ply}, name: bunny, count: {integers: [1, 3]}, size: 0.3, turn: upright,
         material: {type: Lambert, albedo: {hsv: [[0, 360], [0.3, 0.9], [0.4, 0.9]]}}}
    view: {target: [0, 0.1, 0], distance: {uniform: [1, 2]}, azimuth: {uniform: [0, 360]}, elevation: {uniform: [10, 60]}}
    scene:                                                       # the native scene format
      camera: {type: PerspectiveCamera, vfov: 40, width: 640, height: 480}
      integrator: {type: PathTracer, max_depth: 5}
      background: {uniform: [0.1, 0.6]}
      objects:
        - {type: Plane, point: [0, 0, 0], normal: [0, 1, 0], name: floor}
        - {type: PointLight, position: {around: {distance: [2, 3], azimuth: [0, 360], elevation: [40, 80]}},
           intensity: {log_uniform: [5, 40]}}

Any value may be random: `vision.draws` lists how. docs/datasets.md explains all keys.
"""

from __future__ import annotations

import hashlib
from functools import cached_property
from pathlib import Path
from typing import Any

from sightray.errors import FormatError, unknown
from sightray.formats.base import Limits, read_bytes, read_text
from sightray.formats.yaml_build import Builder
from sightray.formats.yaml_nodes import Node, parse
from sightray.vision.dice import Dice
from sightray.vision.draws import Drawer
from sightray.vision.recipe_stage import Stage
from sightray.vision.recipe_values import Values
from sightray.vision.take import Take
from sightray.vision.writers.base import Writer, as_writer

KEYS = (
    "seed",
    "frames",
    "samples",
    "formats",
    "sequence",
    "exposure",
    "readout",
    "sensor",
    "depth_sensors",
    "scene",
    "ground",
    "place",
    "view",
    "path",
    "rig",
)
DEFAULT_FORMATS = ("coco", "exr")


class Recipe:
    """A recipe that was read: `take` gives the scenes of any frame, by its number alone.

    Parameters
    ----------
    path : the YAML file; files that it names are relative to it.
    seed, samples : instead of those that it states.

    Attributes
    ----------
    seed : int, names the random numbers.
    frames, samples : int, as the recipe says.
    formats : tuple of Writer, as the recipe says, else coco and exr.
    length, rate : frames in a sequence, and in a second.
    exposure : seconds for which the shutter is open; 0 for pictures of an instant.
    readout : seconds from the top row's exposure to the bottom row's, a rolling shutter; 0 for all rows at once.

    Raises
    ------
    FormatError
        With file, line, what was found and what is allowed.
    """

    def __init__(self, path: str | Path, *, seed: int | None = None, samples: int | None = None):
        self.path, self.limits = Path(path), Limits()
        self.root = parse(read_text(self.path, self.limits), self.path, self.limits)
        self.values = Values(self.path)
        self.drawer = Drawer(self.path)
        top = self.values.mapping(self.root, "recipe", KEYS)
        if "scene" not in top:
            raise FormatError("scene: missing; a recipe needs one", self.path, 1)
        self.seed = self.values.whole(top, "seed", 0, 0, 2**63 - 1) if seed is None else seed
        self.frames = self.values.whole(top, "frames", 100, 1, 10**9)
        self.samples = self.values.whole(top, "samples", 64, 1, 1 << 20) if samples is None else samples
        sequence = self.values.mapping(top.get("sequence", Node({}, 1)), "sequence", ("length", "rate"))
        self.length = self.values.whole(sequence, "length", 1, 1, 10**9)
        self.rate = self.values.number(sequence, "rate", 10.0, above=0.0)
        self.exposure = self.values.number(top, "exposure", 0.0, at_least=0.0)
        self.readout = self.values.number(top, "readout", 0.0, at_least=0.0)
        self._stages: dict[int, Stage] = {}
        self.shared: dict[Any, Any] = {}  # what stays the same from frame to frame: models, files
        if "view" in top and "path" in top:
            raise FormatError("view beside path; allowed: one of them", self.path, self.root.keys["path"])

    @cached_property
    def formats(self) -> tuple[Writer, ...]:
        """The formats that the recipe names."""
        node = self.root.value.get("formats")
        if node is None:
            return tuple(as_writer(name) for name in DEFAULT_FORMATS)
        if not isinstance(node.value, list) or not node.value:
            raise FormatError("formats: expected a list of names", self.path, node.line)
        builder = Builder(Node({}, 1), self.path, self.limits)
        return tuple(
            self.values.located(as_writer, part.value, line=part.line) if isinstance(part.value, str)
            else builder.member(part, ("vision.writers",), f"formats[{k}]")
            for k, part in enumerate(node.value)
        )  # fmt: skip

    @cached_property
    def files(self) -> dict[str, str]:
        """SHA-256 of the recipe and of each file that it names, by its name there."""
        found = {self.path.name: hashlib.sha256(read_bytes(self.path, self.limits)).hexdigest()}
        pending = [(self.path, self.root)]
        while pending:
            owner, node = pending.pop()
            for name in _strings(node):
                file = owner.parent / name
                if "\0" not in name and len(name) < 200 and name not in found and Path(name).suffix and file.is_file():
                    found[name] = hashlib.sha256(file.read_bytes()).hexdigest()
                    if file.suffix.lower() in (".yaml", ".yml"):
                        pending.append((file, parse(read_text(file, self.limits), file, self.limits)))
        return dict(sorted(found.items()))

    @property
    def sensed(self) -> bool:
        """Whether it names sensors."""
        return "sensor" in self.root.value or "depth_sensors" in self.root.value

    def random_sizes(self) -> list[str]:
        """Names of the entries of `place` whose size differs from picture to picture."""
        place = self.root.value.get("place", Node([], 1))
        parts = place.value if isinstance(place.value, list) else []
        return [
            str(part.value["name"].value) if "name" in part.value else f"place[{k}]"
            for k, part in enumerate(parts)
            if isinstance(part.value, dict) and any(
                key in part.value and self.drawer.is_random(part.value[key]) for key in ("size", "scale", "shape"))
        ]  # fmt: skip

    def take(self, frame: int) -> Take:
        """The scenes of a frame, with all that belongs to it."""
        sequence, step = divmod(frame, self.length)
        stage = self.stage(sequence)
        return stage.take(frame, step, self.length, self.rate)

    def stage(self, sequence: int) -> Stage:
        """What is there in a sequence; the last one is kept."""
        if sequence not in self._stages:
            self._stages = {sequence: Stage(self, Dice(self.seed, sequence), sequence)}
        return self._stages[sequence]


def load_recipe(path: str | Path, **options: Any) -> Recipe:
    """Read a recipe; see `Recipe`."""
    if Path(path).suffix.lower() not in (".yaml", ".yml"):
        raise FormatError(unknown("recipe suffix", Path(path).suffix, (".yaml", ".yml")), path)
    return Recipe(path, **options)


def _strings(node: Node) -> list[str]:
    if isinstance(node.value, dict):
        return [name for part in node.value.values() for name in _strings(part)]
    if isinstance(node.value, list):
        return [name for part in node.value for name in _strings(part)]
    return [node.value] if isinstance(node.value, str) else []
