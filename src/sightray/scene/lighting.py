"""The lights of a scene as kernels see them: those that it states, and its surfaces that glow.

The latter are packed when a kernel is prepared that asks for all lights. Labels, queries and Whitted's model never do,
and a mesh of a million triangles whose material could glow costs them nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from sightray.accelerators import item as item_row
from sightray.mathlib.table import Table, aligned, link
from sightray.scene import emitters
from sightray.scene import world as world_row
from sightray.scene.emitters import Glowing, lights_of
from sightray.scene.light_tree import pack_chooser


def pack_lamps(world: Table, tables: Any, lamps: Sequence[Any]) -> None:
    """The lights that the scene states."""
    space = tables.space
    skies = np.array([k for k, light in enumerate(lamps) if light.infinite], np.int64)
    link(world, world_row.SKIES, space.array(skies) if len(skies) else None)
    words = world.view(np.int64)
    words[world_row.LAMP_COUNT], words[world_row.SKY_COUNT] = len(lamps), len(skies)
    _list(world, space, [tables.row_of(light) for light in lamps])


def pack_glow(
    world: Table, tables: Any, lamps: Sequence[Any], items: Table, things: Sequence[Any], own: set[int]
) -> None:
    """All lights, and what they are chosen by.

    `things` are the scene's items, `items` their rows; those of the objects numbered in `own` belong to lamps.
    """
    rows = [tables.row_of(light) for light in lamps]
    bounds = [(k, None if light.infinite else light.bounds()) for k, light in enumerate(lamps)]  # skies stand apart
    for index, thing in enumerate(things):
        known = thing.object in own or thing.placement is not None  # what moves is found by chance alone
        glowing = None if known else lights_of(thing)
        if glowing is not None:
            start = index * item_row.ITEM_WORDS
            words = items.view(np.int64)[start : start + item_row.ITEM_WORDS]
            words[item_row.LIGHT], words[item_row.LIGHT_STEP] = len(rows), len(glowing.rows) > 1
            bounds.append((len(rows), glowing.bounds))
            rows += _rows_of(glowing, tables, words)
    _list(world, tables.space, rows)
    known_bounds = [(first, found) for first, found in bounds if found is not None]
    link(world, world_row.CHOOSER, pack_chooser(tables.space, known_bounds, len(rows)))


def _list(world: Table, space: Any, rows: Sequence[Table]) -> None:
    """Note where the lights' rows stand, and how many there are."""
    addresses = np.array([row.address for row in rows] or [0], np.int64)
    link(world, world_row.LIGHTS, space.array(addresses))
    world.view(np.int64)[world_row.LIGHT_COUNT] = len(rows)


def _rows_of(glowing: Glowing, tables: Any, item: np.ndarray) -> list[Table]:
    """Rows of the lights that one item is."""
    values = aligned(glowing.rows.shape, np.float64)
    values[:] = glowing.rows
    values.view(np.int64)[:, emitters.ITEM] = tables.space.array(item).address
    return tables.add_alike(glowing.kind(), values)
