"""Random values in recipes: what may stand in place of any value, and how it is drawn.

=====================================  ==================================================================================
``{uniform: [low, high]}``             evenly between two numbers, or in the box between two lists of numbers
``{log_uniform: [low, high]}``         evenly in the logarithm, between two numbers above 0
``{normal: [mean, sd]}``               of a mean and a standard deviation
``{integers: [low, high]}``            a whole number from low to high, both included
``{choice: [a, b, ...]}``              one of several values, of any kind; ``weights: [...]`` may stand beside
``{hsv: [[h, h], [s, s], [v, v]]}``    a colour: hue in degrees, saturation and value between two numbers each; the RGB that
                                       they name is taken as linear
``{around: {...}}``                    a point: ``center``, and from it ``distance``, ``azimuth`` (degrees, 0 is +z, 90 is
                                       +x) and ``elevation`` (degrees), each a number or two
``{repeat: n, of: value}`` in a list   n values, each drawn for itself; n may be random
=====================================  ==================================================================================
"""

from __future__ import annotations

import colorsys
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from sightray.errors import FormatError
from sightray.formats.yaml_nodes import Node
from sightray.vision.dice import Dice

MAX_REPEATS = 100_000


class Drawer:
    """Draws the random values of a tree of nodes; `path` is the recipe, for messages."""

    def __init__(self, path: Path):
        self.path = path
        self.kinds: dict[str, Callable[[Node, Dice, Node], Any]] = {
            "uniform": self.uniform, "log_uniform": self.log_uniform, "normal": self.normal, "integers": self.integers,
            "choice": self.choice, "hsv": self.hsv, "around": self.around,
        }  # fmt: skip

    def error(self, message: str, line: int) -> FormatError:
        return FormatError(message, self.path, line)

    def kind_of(self, node: Node) -> str | None:
        """Name of the distribution that a node states; None if it is a plain value."""
        if not isinstance(node.value, dict):
            return None
        found = [key for key in node.value if key in self.kinds]
        if not found or "type" in node.value:
            return None
        others = set(node.value) - {found[0]} - ({"weights"} if found[0] == "choice" else set())
        if others:
            raise self.error(f"'{min(others)[:60]}' beside '{found[0]}'; allowed: '{found[0]}' alone", node.line)
        return found[0]

    def is_random(self, node: Node) -> bool:
        """Whether anything in the tree is drawn."""
        if isinstance(node.value, list):
            return any(self.is_random(part) for part in node.value)
        if isinstance(node.value, dict):
            return self.kind_of(node) is not None or any(self.is_random(part) for part in node.value.values())
        return False

    def draw(self, node: Node, dice: Dice) -> Node:
        """The tree with values in place of distributions."""
        if isinstance(node.value, list):
            parts: list[Node] = []
            for k, part in enumerate(node.value):
                parts += self.repeated(part, dice.at(k))
            return Node(parts, node.line, node.size)
        if not isinstance(node.value, dict):
            return node
        kind = self.kind_of(node)
        if kind is None:
            values = {key: self.draw(part, dice.at(key)) for key, part in node.value.items()}
            return Node(values, node.line, node.size, node.keys)
        found = self.kinds[kind](node.value[kind], dice, node)
        return found if isinstance(found, Node) else as_node(found, node.line)

    def repeated(self, node: Node, dice: Dice) -> list[Node]:
        """One entry of a list, or as many as ``repeat`` says."""
        if not isinstance(node.value, dict) or "repeat" not in node.value:
            return [self.draw(node, dice)]
        if set(node.value) != {"repeat", "of"}:
            raise self.error("'repeat' needs 'of' beside it, and nothing else", node.line)
        count = self.draw(node.value["repeat"], dice.at("repeat")).value
        if isinstance(count, bool) or not isinstance(count, int) or not 0 <= count <= MAX_REPEATS:
            raise self.error(f"repeat: got {count!r}; allowed: a whole number from 0 to {MAX_REPEATS}", node.line)
        return [self.draw(node.value["of"], dice.at(k)) for k in range(count)]

    # ---------------------------------------------------------------------------------------------------- distributions

    def pair(self, node: Node, what: str) -> tuple[float, float]:
        """Two numbers in order."""
        low, high = (self.number(part, what) for part in self.two(node, what))
        if low > high:
            raise self.error(f"{what}: {low:g} is above {high:g}; allowed: [low, high]", node.line)
        return low, high

    def two(self, node: Node, what: str) -> list[Node]:
        if not isinstance(node.value, list) or len(node.value) != 2:
            raise self.error(f"{what}: expected [a, b]", node.line)
        return node.value

    def number(self, node: Node, what: str) -> float:
        if isinstance(node.value, bool) or not isinstance(node.value, int | float) or not math.isfinite(node.value):
            raise self.error(f"{what}: got {str(node.plain())[:60]!r}; expected a finite number", node.line)
        return float(node.value)

    def uniform(self, node: Node, dice: Dice, whole: Node) -> Any:
        low, high = self.two(node, "uniform")
        if isinstance(low.value, list) or isinstance(high.value, list):
            if not (isinstance(low.value, list) and isinstance(high.value, list) and len(low.value) == len(high.value)):
                raise self.error("uniform: expected two lists of one length", node.line)
            ends = [self.pair(Node([a, b], a.line), "uniform") for a, b in zip(low.value, high.value, strict=True)]
            return [dice.between(*pair) for pair in ends]
        return dice.between(*self.pair(node, "uniform"))

    def log_uniform(self, node: Node, dice: Dice, whole: Node) -> float:
        low, high = self.pair(node, "log_uniform")
        if low <= 0:
            raise self.error(f"log_uniform: got {low:g}; allowed: numbers above 0", node.line)
        return math.exp(dice.between(math.log(low), math.log(high)))

    def normal(self, node: Node, dice: Dice, whole: Node) -> float:
        mean, spread = (self.number(part, "normal") for part in self.two(node, "normal"))
        return mean + spread * dice.normal()

    def integers(self, node: Node, dice: Dice, whole: Node) -> int:
        low, high = self.pair(node, "integers")
        if low != int(low) or high != int(high):
            raise self.error(f"integers: got {low:g}, {high:g}; allowed: whole numbers", node.line)
        return dice.integer(int(low), int(high))

    def choice(self, node: Node, dice: Dice, whole: Node) -> Node:
        options, weights = node.value, whole.value.get("weights")
        if not isinstance(options, list) or not options:
            raise self.error("choice: expected a list of values", node.line)
        shares = [1.0] * len(options)
        if weights is not None:
            if not isinstance(weights.value, list) or len(weights.value) != len(options):
                raise self.error(f"weights: expected a list of {len(options)} numbers", weights.line)
            shares = [self.number(part, "weights") for part in weights.value]
            if min(shares) < 0 or sum(shares) <= 0:
                raise self.error("weights: allowed: numbers of at least 0, not all 0", weights.line)
        k = dice.choice(shares)
        return self.draw(options[k], dice.at(k))

    def hsv(self, node: Node, dice: Dice, whole: Node) -> list[float]:
        if not isinstance(node.value, list) or len(node.value) != 3:
            raise self.error("hsv: expected [[hue, hue], [saturation, saturation], [value, value]]", node.line)
        h, s, v = (dice.between(*self.pair(part, "hsv")) for part in node.value)
        if not (0 <= s <= 1 and 0 <= v <= 1):
            raise self.error("hsv: allowed: hue in degrees, saturation and value from 0 to 1", node.line)
        return list(colorsys.hsv_to_rgb(h / 360 % 1, s, v))

    def around(self, node: Node, dice: Dice, whole: Node) -> list[float]:
        allowed = ("center", "distance", "azimuth", "elevation")
        if not isinstance(node.value, dict) or set(node.value) - set(allowed) or "distance" not in node.value:
            raise self.error(f"around: expected {', '.join(allowed)}; distance must be there", node.line)
        found = {}
        for name in allowed[1:]:
            part = node.value.get(name, Node(0, node.line))
            found[name] = dice.at(name).between(*self.pair(part, name)) if isinstance(part.value, list) else (
                self.number(part, name))  # fmt: skip
        center = node.value.get("center", as_node([0, 0, 0], node.line))
        if not isinstance(center.value, list) or len(center.value) != 3:
            raise self.error("around: center: expected three numbers", center.line)
        middle = [self.number(part, "center") for part in center.value]
        return point_around(middle, found["distance"], found["azimuth"], found["elevation"])


def point_around(center: list[float], distance: float, azimuth: float, elevation: float) -> list[float]:
    """The point in a direction from `center`: degrees, azimuth 0 is +z and 90 is +x."""
    a, e = math.radians(azimuth), math.radians(elevation)
    away = (math.sin(a) * math.cos(e), math.sin(e), math.cos(a) * math.cos(e))
    return [c + distance * d for c, d in zip(center, away, strict=True)]


def as_node(value: Any, line: int) -> Node:
    """A plain value as nodes."""
    if isinstance(value, list):
        return Node([as_node(part, line) for part in value], line, 1 + len(value))
    return Node(value, line)
