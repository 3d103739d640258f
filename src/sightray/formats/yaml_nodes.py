"""YAML text as a tree of nodes that know their lines.

A strict subset of YAML 1.2, because scene files come from others and mistakes should show: no tags (they would name
types), no duplicate keys, keys are strings, nesting and size are limited, and an alias counts as all that it repeats,
so that ten lines cannot stand for a billion. Scalars follow the 1.2 core schema: ``yes`` and ``on`` are strings,
``1e3`` is a number.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from sightray.errors import FormatError
from sightray.formats.base import Limits

INTEGER = re.compile(r"[-+]?[0-9]+")
REAL = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
WORDS: dict[str, Any] = {"": None, "~": None, "null": None, "Null": None, "NULL": None, "true": True, "True": True,
                         "TRUE": True, "false": False, "False": False, "FALSE": False}  # fmt: skip
SPECIAL = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")


@dataclass
class Node:
    """A value, the line where it begins, and how many values it stands for."""

    value: Any  # scalar, list[Node], or dict[str, Node]
    line: int
    size: int = 1
    keys: dict[str, int] = field(default_factory=dict)  # line of each key of a mapping

    def plain(self) -> Any:
        """The value without lines."""
        if isinstance(self.value, dict):
            return {key: node.plain() for key, node in self.value.items()}
        if isinstance(self.value, list):
            return [node.plain() for node in self.value]
        return self.value


def parse(text: str, path: Path, limits: Limits) -> Node:
    """The one document of a file as a tree of nodes; an empty file is an empty mapping."""
    try:
        reader = _Reader(path, limits, yaml.parse(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader)))
        return reader.document()
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        problem = getattr(error, "problem", None) or getattr(error, "reason", None) or str(error)
        raise FormatError(f"not YAML: {problem}", path, None if mark is None else mark.line + 1) from None


class _Reader:
    """Turns the parser's events into nodes, one at a time, so that a limit stops it where it is crossed."""

    def __init__(self, path: Path, limits: Limits, events: Iterator[Any]):
        self.path, self.limits, self.events = path, limits, events
        self.anchors: dict[str, Node] = {}
        self.depth = 0
        self.count = 0  # nodes that stand in the file itself

    def error(self, message: str, line: int) -> FormatError:
        return FormatError(message, self.path, line)

    def document(self) -> Node:
        next(self.events)  # the stream starts
        if isinstance(next(self.events), yaml.StreamEndEvent):
            return Node({}, 1)
        root = self.node(next(self.events))
        next(self.events)  # the document ends
        more = next(self.events)
        if not isinstance(more, yaml.StreamEndEvent):
            raise self.error("a second document; allowed: one per file", more.start_mark.line + 1)
        return root

    def node(self, event: Any) -> Node:
        line = event.start_mark.line + 1
        if isinstance(event, yaml.AliasEvent):
            # An anchor is known once its node is complete, so an alias within its own anchor is unknown.
            if event.anchor not in self.anchors:
                raise self.error(f"alias '*{event.anchor}'; expected an anchor '&{event.anchor}' before it", line)
            target = self.anchors[event.anchor]
            return Node(target.value, line, self.sized(target.size, line), target.keys)
        if event.tag is not None and event.tag != "!":
            raise self.error(f"tag '{event.tag}'; tags are not allowed", line)
        self.count = self.sized(self.count + 1, line)
        if isinstance(event, yaml.ScalarEvent):
            node = Node(self.scalar(event, line) if event.implicit[0] else event.value, line)
        else:
            self.depth += 1
            if self.depth > self.limits.max_nesting:
                raise self.error(f"nested deeper than max_nesting={self.limits.max_nesting} levels", line)
            node = self.sequence(line) if isinstance(event, yaml.SequenceStartEvent) else self.mapping(line)
            self.depth -= 1
        if event.anchor is not None:
            self.anchors[event.anchor] = node
        return node

    def sized(self, size: int, line: int) -> int:
        if size > self.limits.max_nodes:
            raise self.error(f"more than {self.limits.max_nodes} values, counting aliases as what they repeat; "
                             "raise max_nodes if the file is to be trusted", line)  # fmt: skip
        return size

    def sequence(self, line: int) -> Node:
        parts: list[Node] = []
        size = 1
        while not isinstance(event := next(self.events), yaml.SequenceEndEvent):
            parts.append(self.node(event))
            size = self.sized(size + parts[-1].size, line)
        return Node(parts, line, size)

    def mapping(self, line: int) -> Node:
        result = Node({}, line)
        while not isinstance(event := next(self.events), yaml.MappingEndEvent):
            at = event.start_mark.line + 1
            key = self.node(event).value
            if not isinstance(key, str):
                shown = "a list or mapping" if isinstance(key, list | dict) else repr(key)
                raise self.error(f"the key {shown} is not a string", at)
            if key in result.value:
                raise self.error(f"key '{key[:60]}' a second time; first in line {result.keys[key]}", at)
            result.keys[key] = at
            result.value[key] = value = self.node(next(self.events))
            result.size = self.sized(result.size + value.size, at)
        return result

    def scalar(self, event: Any, line: int) -> Any:
        text = event.value
        if text in WORDS:
            return WORDS[text]
        if SPECIAL.fullmatch(text):
            return float(text.lower().replace(".", ""))
        if not REAL.fullmatch(text):
            return text
        return int(text) if INTEGER.fullmatch(text) and len(text) < 18 else float(text)
