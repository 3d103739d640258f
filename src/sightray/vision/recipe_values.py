"""Values of recipes, checked: each complaint has the file and the line."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from sightray.errors import FormatError, SceneError, unknown
from sightray.formats.yaml_nodes import Node


class Values:
    """Reads values from the nodes of one file."""

    def __init__(self, path: Path):
        self.path = path

    def error(self, message: str, line: int) -> FormatError:
        return FormatError(message, self.path, line)

    def mapping(self, node: Node, what: str, keys: tuple[str, ...], needed: tuple[str, ...] = ()) -> dict[str, Node]:
        """The entries of a mapping that has no other keys than these."""
        if not isinstance(node.value, dict):
            raise self.error(f"{what}: expected a mapping with {', '.join(keys)}", node.line)
        for key, line in node.keys.items():
            if key not in keys:
                raise self.error(f"{what}: {unknown('key', key[:60], keys)}", line)
        for key in needed:
            if key not in node.value:
                raise self.error(f"{what}: '{key}' is missing", node.line)
        return node.value

    def whole(self, entries: dict[str, Node], key: str, default: int, low: int, high: int) -> int:
        """A whole number."""
        if key not in entries:
            return default
        value = entries[key].value
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            got = str(entries[key].plain())[:60]
            raise self.error(f"{key}: got {got}; allowed: a whole number from {low} to {high}", entries[key].line)
        return value

    def number(self, entries: dict[str, Node], key: str, default: float, above: float = -math.inf,
               at_least: float = -math.inf) -> float:  # fmt: skip
        """A finite number."""
        if key not in entries:
            return default
        value = entries[key].value
        finite = not isinstance(value, bool) and isinstance(value, int | float) and math.isfinite(value)
        if not finite or value <= above or value < at_least:
            limit = f" > {above:g}" if above > -math.inf else f" >= {at_least:g}" if at_least > -math.inf else ""
            got = str(entries[key].plain())[:60]
            raise self.error(f"{key}: got {got}; allowed: a finite number{limit}", entries[key].line)
        return float(value)

    def numbers(self, entries: dict[str, Node], key: str, default: Any, count: int) -> list[float]:
        """A list of so many numbers."""
        if key not in entries:
            return list(default)
        node = entries[key]
        if not isinstance(node.value, list) or len(node.value) != count:
            raise self.error(f"{key}: expected {count} numbers", node.line)
        return [self.number({key: part}, key, 0.0) for part in node.value]

    def word(self, entries: dict[str, Node], key: str, default: str, allowed: tuple[str, ...] = ()) -> str:
        """A string, one of some."""
        if key not in entries:
            return default
        value = entries[key].value
        if not isinstance(value, str) or not value:
            raise self.error(f"{key}: got {str(entries[key].plain())[:60]}; allowed: a string", entries[key].line)
        if allowed and value not in allowed:
            raise self.error(f"{key}: {unknown('choice', value, allowed)}", entries[key].line)
        return value

    def located(self, make: Callable, *arguments: Any, line: int) -> Any:
        """What a function makes; its complaint gets the file and the line."""
        try:
            return make(*arguments)
        except SceneError as error:
            raise self.error(str(error), line) from None
