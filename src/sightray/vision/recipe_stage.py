"""What one sequence of a recipe shows: the scene that was drawn, the objects put on its ground, and how all of it moves."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sightray.errors import SceneError
from sightray.formats.base import asset, load_scene
from sightray.formats.yaml_build import Builder
from sightray.formats.yaml_nodes import Node
from sightray.lights.base import Light
from sightray.mathlib.transform import Transform
from sightray.scene.compile import flatten
from sightray.scene.instance import Instance
from sightray.scene.scene import Scene
from sightray.vision.animation import Animation
from sightray.vision.dice import Dice
from sightray.vision.placing import TURNS, Ground, Model, Placed, place
from sightray.vision.recipe_motion import motion_of, rig_of, view_of
from sightray.vision.recipe_sensors import depth_sensors_of, sensor_of
from sightray.vision.take import Take
from sightray.vision.trajectory import Around, Trajectory

if TYPE_CHECKING:
    from sightray.vision.recipe import Recipe

ENTRY = ("shape", "name", "category", "count", "size", "scale", "turn", "material", "motion")
MOST = 10_000  # copies of one entry


class Stage:
    """The scene of one sequence."""

    def __init__(self, recipe: Recipe, dice: Dice, sequence: int):
        self.recipe, self.dice, self.sequence = recipe, dice, sequence
        self.values, self.top = recipe.values, recipe.root.value
        self.builder, base = self._base()
        self.placed: list[Placed] = self._standing(base)
        self.objects: list[Any] = list(base.objects)
        self.targets: list[int] = []
        self.classes: dict[str, str] = {}
        self.motions: dict[str, Trajectory] = {}
        self.left_out = 0
        self._scenes: dict[int, Scene] = {}
        self.sensor, self.depth_sensors = sensor_of(self), depth_sensors_of(self)
        entries = self._entries()
        for category in dict.fromkeys(category for _, _, category in entries):
            self.classes[f"category {category}"] = category  # numbers the classes alike in all frames
        for k, (entry, name, category) in enumerate(entries):
            self._put(entry, name, category, dice.at("place").at(k))
        scene = base.replace(objects=tuple(self.objects))
        if scene.camera is None:
            raise self.values.error("scene: camera: missing; pictures need one", recipe.root.keys["scene"])
        self.animation = self._located(
            lambda: Animation(scene, camera=view_of(self), objects=self.motions, rig=rig_of(self, scene.camera)),
            "scene",
        )

    def _located(self, make: Any, key: str) -> Any:
        return self.values.located(make, line=self.recipe.root.keys.get(key, 1))

    def drawn(self, key: str) -> Node | None:
        """An entry of the recipe with its random values drawn."""
        return self.recipe.drawer.draw(self.top[key], self.dice.at(key)) if key in self.top else None

    # ------------------------------------------------------------------------------------------------------- what is there

    def _base(self) -> tuple[Builder, Scene]:
        """The scene that the recipe states, or names a file of; built once where nothing in it is random."""
        stated, shared = self.top["scene"], self.recipe.shared
        if "base" in shared:
            return shared["base"]
        node = self.drawn("scene")
        assert node is not None
        if isinstance(node.value, str):
            file = asset(self.recipe.path, node.value, (".yaml", ".yml"), node.line)
            found = Builder(Node({}, 1), file, self.recipe.limits), load_scene(file)
        else:
            builder = self._builder(node)
            found = builder, builder.scene()
        if not self.recipe.drawer.is_random(stated):
            shared["base"] = found
        return found

    def _builder(self, node: Node) -> Builder:
        builder = Builder(node, self.recipe.path, self.recipe.limits)
        builder.files = self.recipe.shared.setdefault("files", {})
        return builder

    def _standing(self, base: Scene) -> list[Placed]:
        """The scene's own objects that have an end and reach above the ground."""
        shared: dict[int, tuple[Any, Model]] = self.recipe.shared.setdefault("solids", {})
        found: list[Placed] = []
        for thing in base.objects:
            if isinstance(thing, Light) or not _ends(thing):
                continue
            if id(thing) not in shared:
                shared[id(thing)] = (thing, Model(thing))
            model = shared[id(thing)][1]
            if model.solid.upper[1] > self._ground().height + 1e-9:
                found.append(Placed(model, 1.0, np.eye(4)))
        if self.recipe.drawer.is_random(self.top["scene"]):
            shared.clear()
        return found

    def _ground(self) -> Ground:
        node = self.drawn("ground")
        if node is None:
            return Ground()
        entries = self.values.mapping(node, "ground", ("height", "area"))
        area = entries.get("area")
        if area is None:
            return Ground(self.values.number(entries, "height", 0.0))
        if not isinstance(area.value, list) or len(area.value) != 2:
            raise self.values.error("ground: area: expected [[x, z], [x, z]], the least and the greatest", area.line)
        low, high = (self.values.numbers({"area": part}, "area", (), 2) for part in area.value)
        if low[0] > high[0] or low[1] > high[1]:
            raise self.values.error("ground: area: the least is above the greatest", area.line)
        return Ground(self.values.number(entries, "height", 0.0), (low[0], low[1]), (high[0], high[1]))

    # --------------------------------------------------------------------------------------------------------- what is put

    def _entries(self) -> list[tuple[dict[str, Node], str, str]]:
        """The entries of `place`, each with the name and the category of its objects."""
        node = self.top.get("place", Node([], 1))
        if not isinstance(node.value, list):
            raise self.values.error("place: expected a list", node.line)
        found: list[tuple[dict[str, Node], str, str]] = []
        for k, part in enumerate(node.value):
            entry = self.values.mapping(part, f"place[{k}]", ENTRY, ("shape",))
            name = self.values.word(entry, "name", _default_name(entry["shape"], k))
            if name in [known for _, known, _ in found]:
                raise self.values.error(f"place[{k}]: name '{name}' a second time; give one of them another", part.line)
            found.append((entry, name, self.values.word(entry, "category", name)))
        return found

    def _put(self, entry: dict[str, Node], name: str, category: str, dice: Dice) -> None:
        """Put the objects of an entry on the ground."""
        count = self._drawn(entry, "count", dice, Node(1, 1))
        many = self.values.whole({"count": count}, "count", 1, 0, MOST)
        turn = self.values.word(entry, "turn", "upright", TURNS)
        for copy in range(many):
            own, label = dice.at(copy), f"{name}-{copy}"
            model = self._model(entry, name, own)
            placed = place(model, self._factor(entry, model, own), turn, self._ground(), self.placed, own.at("where"))
            if placed is None:
                self.left_out += 1
                continue
            material = None
            if "material" in entry:
                node = self._drawn(entry, "material", own, entry["material"])
                material = self.builder.member(node, ("materials",), f"{name}.material")
            self.placed.append(placed)
            self.targets.append(len(self.objects))
            self.classes[label] = category
            body = model.scaled(placed.factor)
            self.objects.append(Instance(of=body, transform=Transform(placed.pose), material=material, name=label))
            if "motion" in entry:
                motion = motion_of(self, self._drawn(entry, "motion", own, entry["motion"]))
                self.motions[label] = Around(motion, placed.matrix[:3, :3] @ model.center + placed.matrix[:3, 3])

    def _drawn(self, entry: dict[str, Node], key: str, dice: Dice, default: Node) -> Node:
        return self.recipe.drawer.draw(entry.get(key, default), dice.at(key))

    def _model(self, entry: dict[str, Node], name: str, dice: Dice) -> Model:
        """The shape that an entry shows; built once where it is not random."""
        models = self.recipe.shared.setdefault("models", {})
        if name in models:
            return models[name]
        node = self._drawn(entry, "shape", dice, entry["shape"])
        thing = self.builder.member(node, ("shapes", "scene"), f"{name}.shape")
        if not _ends(thing):
            raise self.values.error(f"{name}: a shape without end cannot be put down", entry["shape"].line)
        model = Model(thing)
        if not self.recipe.drawer.is_random(entry["shape"]):
            models[name] = model
        return model

    def _factor(self, entry: dict[str, Node], model: Model, dice: Dice) -> float:
        """By how much the shape is enlarged."""
        if "size" in entry and "scale" in entry:
            raise self.values.error("size beside scale; allowed: one of them", entry["scale"].line)
        if "size" in entry:
            size = {"size": self._drawn(entry, "size", dice, entry["size"])}
            return self.values.number(size, "size", 1.0, above=0.0) / model.longest
        scale = {"scale": self._drawn(entry, "scale", dice, Node(1.0, 1))}
        return self.values.number(scale, "scale", 1.0, above=0.0)

    # --------------------------------------------------------------------------------------------------------------- takes

    def take(self, frame: int, step: int, length: int, rate: float) -> Take:
        """One frame."""
        time, rig = step / rate, self.animation.rig
        exposure, readout = self.recipe.exposure, self.recipe.readout
        scene, cameras = self._moment(step, rate)
        following, later = self._moment(step + 1, rate) if length > 1 else (None, None)
        blurred, shutters = None, {}
        if exposure or readout:
            blurred, shutters = (scene, cameras) if readout else self.animation.blurred(time, exposure)
        seeds = Dice(self.recipe.seed, frame, "picture")
        return Take(
            frame=frame, scene=scene, cameras=cameras, following=following, later=later, classes=self.classes,
            sequence=self.sequence if length > 1 else 0, step=step if length > 1 else frame,
            time=time if length > 1 else frame / rate, stereo=rig is not None and rig.rectified,
            blurred=blurred, shutters=shutters, targets=tuple(self.targets) if "place" in self.top else None,
            seeds=tuple(seeds.at(k).whole() for k in range(len(cameras))), note={"left_out": self.left_out},
            sensor=self.sensor, depth_sensors=self.depth_sensors,
            trajectory=self.animation.camera if length > 1 else None,
            next_time=(step + 1) / rate if step + 1 < length else None,
        )  # fmt: skip

    def _moment(self, step: int, rate: float) -> tuple[Scene, dict[str, Any]]:
        """What labels of a step belong to: an instant; under a rolling shutter all that moves while rows are read."""
        if self.recipe.readout:
            return self.animation.blurred(step / rate, self.recipe.exposure, self.recipe.readout)
        return self._at(step, rate), self.animation.cameras_at(step / rate)

    def _at(self, step: int, rate: float) -> Scene:
        """The scene of a step; kept, for the next frame needs it too. Where nothing but the camera moves, there is one."""
        step = step if self.motions else 0
        if step not in self._scenes:
            time = step / rate
            camera = next(iter(self.animation.cameras_at(time).values()))
            scene = self.animation.scene.replace(objects=self.animation.objects_at(time), camera=camera)
            self._scenes = {**{k: v for k, v in self._scenes.items() if k == step - 1}, step: scene}
        return self._scenes[step]


def _ends(thing: Any) -> bool:
    """Whether a shape, group or instance has an end."""
    try:
        return all(np.isfinite(item.shape.bounds()).all() for item in flatten(Scene(thing)))
    except SceneError:
        return False


def _default_name(shape: Node, k: int) -> str:
    """A name for what an entry shows: its file's, or its type's."""
    value = shape.value if isinstance(shape.value, dict) else {}
    if "file" in value and isinstance(value["file"].value, str):
        return Path(value["file"].value).stem
    kind = value["type"].value if "type" in value else shape.value
    return kind.lower() if isinstance(kind, str) else f"object{k}"
