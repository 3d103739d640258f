"""Which materials a scene's items have, sorted by class: how eight paths at once ask them (`integrators.eightpaths`).

Eight paths that have met eight surfaces ask one class of materials after the other, each for its own lanes. A class tells
them apart by where their rows are. What does not answer light but bends normals or cuts holes, such as a `NormalMap`, has
done so when a surface is known; so it is what is beneath, the `bare` material, that is asked. Its textures have been looked
up by then: the row that it finds is a copy in which they are constant (`settle`). Classes without forms for eight paths are
asked lane by lane, as they always are.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from sightray._jit import METHOD_SLOTS, kernel
from sightray.accelerators.item import CLEAR
from sightray.fields import Child
from sightray.materials.base import Material, sample_eight
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, advance, i64_at, i64_put, is_null, link, table_at, table_put, vec3_put
from sightray.scene.world import KINDS
from sightray.textures.base import Where, value_at
from sightray.textures.constant import COLOR

# Words of the head: a material's row of each class, how many classes there are, and whether one of them asks for `choice`;
# of each item the number of its material's class and the row; of each class the words of a row, and its textures.
ROWS, COUNT, CHOOSES, KIND_OF, MATERIAL_OF, LENGTHS, TEXTURES, HEAD_WORDS = 0, 1, 2, 3, 4, 5, 6, 8
GLOWING, ALONE = 1 << 16, 1 << 17  # are added to the number of what glows, and of what has no forms
NUMBER = GLOWING - 1
MOST_WORDS, MOST_TEXTURES = 64, 15  # of a row that can be settled
LINE = MOST_TEXTURES + 1  # words for each class in TEXTURES: how many there are, and their words in a row
ROOM = MOST_WORDS + 4 * MOST_TEXTURES + COLOR  # words that a settled row takes


def texture_words(kind: type[Material]) -> list[int]:
    """Where in a material's row textures are named."""
    children = [name for name, field in kind.fields.items() if isinstance(field, Child) and field.family == "textures"]
    return [word for name, word in kind._layout() if name in children]


def has_kind(material: Any) -> bool:
    """Whether a material, or what is beneath, has forms for eight paths."""
    bare = type(material.bare)
    fits = bare.row_words() <= MOST_WORDS and len(texture_words(bare)) <= MOST_TEXTURES
    return fits and sample_eight in bare.kernels


def are_for_eight(items: Sequence[Any], flags: Sequence[int]) -> bool:
    """Whether paths through a scene of these items can be followed eight at once: nothing is filled.

    Nor is it worth while where no material has the forms.
    """
    materials = {id(item.material): item.material for item in items}.values()
    if any(flag & CLEAR for flag in flags) or any(material.filled and not material.thin for material in materials):
        return False
    return any(has_kind(material) for material in materials)


def pack_kinds(tables: Any, materials: Sequence[Any]) -> Table:
    """The head for items of these materials."""
    kinds: dict[type[Material], Table] = {}
    known: dict[int, tuple[int, int]] = {}  # number of the class and address of the row
    of_items = np.zeros((2, len(materials)), np.int64)
    for index, material in enumerate(materials):
        if id(material) not in known:
            if has_kind(material):
                row = tables.row_of(material.bare)
                kinds.setdefault(type(material.bare), row)
                number = list(kinds).index(type(material.bare))
            else:
                row, number = tables.row_of(material), ALONE
            known[id(material)] = number + GLOWING * (material.glow > 0.0), row.address
        of_items[:, index] = known[id(material)]
    textures = np.zeros((len(kinds), LINE), np.int64)
    for line, kind in zip(textures, kinds, strict=True):
        words = texture_words(kind)
        line[: len(words) + 1] = len(words), *words
    head = tables.space.row(HEAD_WORDS)
    counts = head.view(np.int64)
    counts[COUNT], counts[CHOOSES] = len(kinds), any(kind.chooses for kind in kinds) or bool((of_items[0] & ALONE).any())
    rows, lengths = [row.address for row in kinds.values()], [kind.row_words() for kind in kinds]
    for word, values in ((ROWS, rows), (KIND_OF, of_items[0]), (MATERIAL_OF, of_items[1]), (LENGTHS, lengths),
                         (TEXTURES, textures)):  # fmt: skip
        link(head, word, tables.space.array(np.array(values, np.int64)))
    return head


@kernel
def kinds_of(world: Table) -> Table:
    """The head; reaching for it makes a scene pack it."""
    return table_at(world, KINDS)


@kernel
def settle(kinds: Table, kind: i64, material: Table, where: Where, room: Table) -> None:
    """Copy a material's row into `room`, its textures as they are at a place, constant."""
    for word in range(METHOD_SLOTS, i64_at(table_at(kinds, LENGTHS), kind)):
        i64_put(room, word, i64_at(material, word))
    textures = advance(table_at(kinds, TEXTURES), kind * LINE)
    for k in range(i64_at(textures, 0)):
        word = i64_at(textures, k + 1)
        texture = table_at(material, word)
        if not is_null(texture):
            constant = advance(room, MOST_WORDS + 4 * k)
            vec3_put(constant, COLOR, value_at(texture, where))
            table_put(room, word, constant)
