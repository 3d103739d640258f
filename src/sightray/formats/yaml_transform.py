"""Transforms as YAML states them."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from sightray.errors import FormatError, SceneError, unknown
from sightray.fields import Number, Vector
from sightray.formats.yaml_nodes import Node
from sightray.mathlib.transform import Transform

STEPS = ("translate", "rotate", "scale", "matrix")
_vector, _number = Vector("three numbers"), Number("a number")


def parse_transform(node: Node, path: Path, where: str) -> Transform | None:
    """A 4x4 matrix as a list of rows, or steps in the order in which they happen.

    Steps are ``translate: [x, y, z]``, ``rotate: {axis: [x, y, z], degrees: angle}``, ``scale: factor`` or
    ``scale: [x, y, z]``, and ``matrix: rows``.
    """
    if node.value is None:
        return None
    parts = [node] if isinstance(node.value, dict) else node.value
    if not isinstance(parts, list):
        raise FormatError(f"{where}: expected a 4x4 matrix, or a list of {', '.join(STEPS)}", path, node.line)
    if not any(isinstance(part.value, dict) for part in parts) and parts:
        return _placed(partial(Transform, node.plain()), path, node.line, where)
    result = Transform()
    for part in parts:
        if not isinstance(part.value, dict) or len(part.value) != 1:
            raise FormatError(f"{where}: expected one of {', '.join(STEPS)} for each step", path, part.line)
        ((name, argument),) = part.value.items()
        if name not in STEPS:
            raise FormatError(f"{where}: {unknown('step', name[:60], STEPS)}", path, part.line)
        step = _placed(partial(_step, name, argument.plain()), path, part.line, f"{where}.{name}")
        result = _placed(partial(step.__matmul__, result), path, part.line, where)
    return result


def parse_motion(node: Node, path: Path, where: str) -> list[list[Any]] | None:
    """Keyframes: a list of ``{time: seconds, transform: ...}``, or of pairs ``[seconds, ...]``."""
    if node.value is None:
        return None
    if not isinstance(node.value, list):
        raise FormatError(f"{where}: expected a list of keyframes 'time: seconds, transform: ...'", path, node.line)
    keyframes = []
    for k, part in enumerate(node.value):
        found = part.value
        if isinstance(found, dict) and set(found) == {"time", "transform"}:
            found = [found["time"], found["transform"]]
        if not isinstance(found, list) or len(found) != 2:
            raise FormatError(f"{where}[{k}]: expected 'time: seconds, transform: ...'", path, part.line)
        keyframes.append([found[0].plain(), parse_transform(found[1], path, f"{where}[{k}].transform")])
    return keyframes


def _step(name: str, argument: Any) -> Transform:
    if name == "translate":
        return Transform.translate(*_vector.convert(argument))
    if name == "scale":
        alike = isinstance(argument, int | float)
        return Transform.scale(*[_number.convert(argument)] * 3 if alike else _vector.convert(argument))
    if name == "matrix":
        return Transform(argument)
    if not isinstance(argument, dict) or set(argument) != {"axis", "degrees"}:
        raise SceneError("expected {axis: [x, y, z], degrees: angle}")
    degrees = _number.convert(argument["degrees"])
    assert degrees is not None
    return Transform.rotate(_vector.convert(argument["axis"]), degrees)


def _placed(make: Any, path: Path, line: int, where: str) -> Transform:
    try:
        return make()
    except SceneError as error:
        raise FormatError(f"{where}: {error}", path, line) from None
