"""`explain`: the tree of rays behind one pixel, as numbers.

The picture's own kernels run once more, as plain Python, and take notes; nothing is computed a second way.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from sightray.cameras.base import sight_ray
from sightray.engine.pixels import look, render_tile
from sightray.errors import SceneError
from sightray.images.transfer import encode_bytes
from sightray.integrators.notes import (
    ABSORPTION,
    AMBIENT,
    BACKGROUND,
    DIRECT,
    EMISSION,
    FLAT,
    HitNote,
    LightNote,
    RayNote,
    TermNote,
    recording,
)  # fmt: skip
from sightray.mathlib.table import table_at
from sightray.mathlib.vec import Vec3
from sightray.samplers.base import begin, default_sampler, nested
from sightray.scene.compile import Compiled, require_camera
from sightray.scene.world import CAMERA

_KINDS = ("ray of sight", "mirrored ray", "refracted ray")
_TERMS = {
    EMISSION: "emission", AMBIENT: "ambient", DIRECT: "lights together", BACKGROUND: "background", FLAT: "plain colour",
    ABSORPTION: "glass on the way leaves, as a factor of all that follows,",
}  # fmt: skip


class Explanation(NamedTuple):
    """What `explain` found: print it."""

    text: str
    color: tuple[float, float, float]  # linear, of the ray through the pixel's centre
    rays: int

    def __str__(self) -> str:
        return self.text


def explain_pixel(compiled: Compiled, integrator: Any, column: int, row: int, seed: int) -> Explanation:
    """Trace the ray of sight through the centre of a pixel and tell all of it."""
    camera = require_camera(compiled.scene)
    if not (0 <= column < camera.width and 0 <= row < camera.height):
        raise SceneError(
            f"explain: pixel: got ({column}, {row}); allowed: columns 0 to {camera.width - 1}, rows 0 to {camera.height - 1}"
        )
    tables = compiled.tables
    integrator_row = tables.row_of(integrator)
    sampler_row = tables.row_of(default_sampler())
    tables.prepare(render_tile, compiled=False)
    ray = sight_ray(table_at(compiled.world, CAMERA), column + 0.5, row + 0.5, 0.5, 0.5, 0.5)
    draws = nested(begin(sampler_row, column, row, seed, 0, 1), 0)
    with recording() as notes:
        found = look(integrator_row, compiled.world, ray, draws)
    color = (found.color.x, found.color.y, found.color.z)
    lines = [f"pixel ({column}, {row}) of {camera.width}x{camera.height}: the ray through its centre"]
    lines += _Tree(compiled, notes).lines()
    encoded = encode_bytes(np.array([[color]], np.float32), compiled.scene.transfer)[0, 0].tolist()
    lines.append(f"sum of all rays {_numbers(color)}  bytes {tuple(encoded)}  rays shot {found.rays}")
    return Explanation("\n".join(lines), color, found.rays)


class _Tree:
    """The notes of a pixel, put in order by ray."""

    def __init__(self, compiled: Compiled, notes: list[Any]):
        self.compiled = compiled
        self.rays = [n for n in notes if isinstance(n, RayNote)]
        self.about: dict[int, list[Any]] = {n.ray: [] for n in self.rays}
        for note in notes:
            if not isinstance(note, RayNote):
                self.about[note.ray].append(note)

    def lines(self) -> list[str]:
        return self._branch(-1, "")

    def _branch(self, parent: int, indent: str) -> list[str]:
        lines = []
        for note in (n for n in self.rays if n.parent == parent):
            head = f"{indent}{_KINDS[note.kind]} {note.ray}: from {_numbers(note.o)} towards {_numbers(note.d)}"
            lines.append(head + f", weight {_numbers(note.weight)}")
            lines += [f"{indent}  {self._tell(about)}" for about in self.about[note.ray]]
            lines += self._branch(note.ray, indent + "    ")
        return lines

    def _tell(self, note: Any) -> str:
        if isinstance(note, HitNote):
            item = self.compiled.items[note.item]
            name = f" '{item.name}'" if item.name else ""
            what = f"{type(item.shape).__name__}{name} of {type(item.material).__name__}"
            return f"meets {what} after {note.t:.6g} at {_numbers(note.p)}, normal {_numbers(note.normal)}"
        if isinstance(note, LightNote):
            light = type(self.compiled.scene.lights[note.light]).__name__
            return f"  light {note.light} ({light}): {100 * note.visible:.3g} % visible, gives {_numbers(note.value)}"
        assert isinstance(note, TermNote)
        met = "meets nothing: " if note.kind == BACKGROUND else ""
        return f"{met}{_TERMS[note.kind]} {_numbers(note.value)}"


def _numbers(values: Vec3 | tuple[float, ...]) -> str:
    return "(" + ", ".join(f"{v:.5g}" for v in values) + ")"
