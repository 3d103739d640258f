"""Notes that kernels take while they run as plain Python, for `explain`; in machine code they cost nothing.

An integrator states every ray it shoots and every term it adds; `recording` collects them.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from contextvars import ContextVar
from typing import Any, NamedTuple

from sightray._jit import primitive
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.vec import Vec3

SIGHT, MIRRORED, REFRACTED, SHADOW = 0, 1, 2, 3  # kinds of rays
EMISSION, AMBIENT, DIRECT, BACKGROUND, FLAT, ABSORPTION = 0, 1, 2, 3, 4, 5  # kinds of terms


class RayNote(NamedTuple):
    """A ray was shot."""

    ray: int
    parent: int
    kind: int
    o: Vec3
    d: Vec3
    weight: Vec3  # what its light is multiplied by before it reaches the pixel


class HitNote(NamedTuple):
    """A ray met an item."""

    ray: int
    item: int
    t: float
    p: Vec3
    normal: Vec3


class TermNote(NamedTuple):
    """A term was added to a ray's light, before the ray's weight."""

    ray: int
    kind: int
    value: Vec3


class LightNote(NamedTuple):
    """A light was asked: what would arrive, and the share of it that does."""

    ray: int
    light: int
    visible: float
    value: Vec3


_notes: ContextVar[list[Any] | None] = ContextVar("notes", default=None)


@contextlib.contextmanager
def recording() -> Iterator[list[Any]]:
    """Collect the notes of kernels that run as plain Python inside the block."""
    notes: list[Any] = []
    token = _notes.set(notes)
    try:
        yield notes
    finally:
        _notes.reset(token)


def _add(note: Any) -> None:
    notes = _notes.get()
    if notes is not None:
        notes.append(note)


@primitive
def note_ray(ray: i64, parent: i64, kind: i64, o: Vec3, d: Vec3, weight: Vec3) -> None:
    """A ray was shot."""
    _add(RayNote(ray, parent, kind, o, d, weight))


@primitive
def note_hit(ray: i64, item: i64, t: f64, p: Vec3, normal: Vec3) -> None:
    """A ray met an item."""
    _add(HitNote(ray, item, t, p, normal))


@primitive
def note_term(ray: i64, kind: i64, value: Vec3) -> None:
    """A term was added to a ray's light."""
    _add(TermNote(ray, kind, value))


@primitive
def note_light(ray: i64, light: i64, visible: f64, value: Vec3) -> None:
    """A light's term and its visible share."""
    _add(LightNote(ray, light, visible, value))
