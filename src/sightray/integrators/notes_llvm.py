"""The lowering of integrators/notes.py: nothing at all."""

from __future__ import annotations

from typing import Any

from sightray._jit import lower
from sightray.integrators import notes


def _nothing(builder: Any, *values: Any) -> None:
    return None


for _note in (notes.note_ray, notes.note_hit, notes.note_term, notes.note_light):
    lower(_note)(_nothing)
