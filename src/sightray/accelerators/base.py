"""The contract of accelerators: structures that find which items a ray meets without asking each one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from sightray._jit import method
from sightray.accelerators.item import ItemHit
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Space, Table
from sightray.mathlib.vec import Vec3
from sightray.registry import Member, find, members


class Accelerator(Member, family="accelerators"):
    """Base of all accelerators over the items of a scene."""

    merges_meshes: ClassVar[bool] = False  # whether small meshes are put together for it (see `scene.merge`)
    steps_aside: ClassVar[bool] = False  # whether paths may do without it where all pieces are met (see `scene.pieces`)

    def build(self, space: Space, items: Table, lower: np.ndarray, upper: np.ndarray) -> Any:
        """Row of the structure over items with these world bounds, each (n, 3) float64.

        Unbounded items have infinite bounds; items whose lower bounds exceed their upper ones are left out.
        """
        raise NotImplementedError

    def build_scene(
        self, space: Space, items: Table, lower: np.ndarray, upper: np.ndarray, things: Sequence[Any]
    ) -> Any:
        """What the scene compiler calls: `build`, for structures that need no more than boxes.

        Structures that look inside meshes override this one: `things` are the items as objects, in the same order,
        with ``shape`` and ``transform``.
        """
        return self.build(space, items, lower, upper)


def accelerator_named(value: Any) -> Any:
    """The accelerator of a name, in any spelling of its case, with its default options; what is no name, as it is."""
    if not isinstance(value, str):
        return value
    spelled = {known.lower(): known for known in members("accelerators")}
    return find("accelerators", spelled.get(value.lower().replace("-", ""), value))()


@method(0)
def closest(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> ItemHit:
    """Nearest hit of the ray o + t d with any item, t_min < t < t_max."""
    raise NotImplementedError


@method(1)
def blocked(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> bool:
    """Whether any item stands between t_min and t_max."""
    raise NotImplementedError
