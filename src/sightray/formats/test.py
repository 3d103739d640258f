"""The course format, ``.test``, of the assignments that grew out of the lecture on the nuts and bolts of ray tracing.

One command per line; ``#`` begins a comment; every mistake is a `FormatError` that names its line.

========================================  ==========================================================================
image                                     ``size width height``, ``output name``, ``maxdepth bounces``, ``spp samples``
camera                                    ``camera from(3) at(3) up(3) fovy``; the last one wins
geometry                                  ``vertex x y z``, ``tri a b c``, ``vertexnormal x y z nx ny nz``,
                                          ``trinormal a b c``, ``sphere x y z r``
transforms                                ``translate x y z``, ``rotate ax ay az degrees``, ``scale x y z``,
                                          ``pushTransform``, ``popTransform``
lights, in the world                      ``directional x y z r g b`` (towards the light), ``point x y z r g b``,
                                          ``attenuation c l q``, ``quadLight a(3) ab(3) ac(3) r g b``
materials                                 ``ambient diffuse specular emission r g b``, ``shininess s``
========================================  ==========================================================================

A primitive takes the material and the matrix, a point light the attenuation, that hold where it stands. Triangles are
moved into the world there, in double precision; consecutive ones of one material become one mesh. ``maxverts`` and
``maxvertnorms`` are hints that real files exceed. Bytes are ``floor(255 c)``, without gamma. ``output`` names the
scene. For the commands of the later assignments see `formats.test_continuation`.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from sightray.cameras.perspective import PerspectiveCamera
from sightray.errors import FormatError, unknown
from sightray.formats.base import Format, Limits, number, read_text, reading, whole
from sightray.formats.solid import solid_mesh
from sightray.formats.test_continuation import AMOUNTS, CHOICES, Settings
from sightray.lights.directional import DirectionalLight
from sightray.lights.point import PointLight
from sightray.mathlib.transform import Transform
from sightray.scene.scene import Scene
from sightray.shapes.sphere import Sphere

BLACK = (0.0, 0.0, 0.0)


class Reader:
    """What the commands so far have stated. A method named like a command carries it out, with that many numbers."""

    def __init__(self, path: Path, limits: Limits):
        self.path, self.limits, self.line = path, limits, 0
        self.width, self.height, self.depth, self.samples, self.name = 640, 480, 5, 1, ""
        self.settings = Settings(path)
        self.camera_at = self.depth_at = 0  # lines of the camera and of maxdepth
        self.camera: Any = None
        self.vertices: list[list[float]] = []
        self.shaded_vertices: list[list[float]] = []  # place and normal: a pile of its own
        self.matrix, self.stack = np.eye(4), []  # type: np.ndarray, list[np.ndarray]
        self.attenuation = (1.0, 0.0, 0.0)
        self.colors: dict[str, Any] = {"ambient": (0.2,) * 3, "diffuse": BLACK, "specular": BLACK, "emission": BLACK,
                                       "shininess": 0.0}  # fmt: skip
        self.materials: dict[tuple[Any, ...], Any] = {}
        self.objects: list[Any] = []
        self.quads: list[tuple[int, int, list[float]]] = []  # line, place among the objects, numbers
        self.run: tuple[Any, ...] = ()  # material and kind of the triangles that wait
        self.triangles: list[np.ndarray] = []  # (3, 3) or, with normals, (3, 6) rows in the world
        self.total = 0

    def read(self) -> Scene:
        lines = [content.split("#", 1)[0].split() for content in read_text(self.path, self.limits).splitlines()]
        for self.line, tokens in enumerate(lines, 1):
            if tokens[:1] == ["integrator"]:  # materials depend on it, wherever it stands
                self.settings.command(tokens[0], tokens[1:], self.line)
        for self.line, tokens in enumerate(lines, 1):
            if tokens:
                with reading(self.path, self.line):
                    self.command(tokens[0], tokens[1:])
        self.flush()
        for line, place, values in self.quads:
            with reading(self.path, line):
                self.objects[place] = self.settings.quad_light(values)
        if self.camera is None:
            raise FormatError("no camera; expected a line 'camera from(3) at(3) up(3) fovy'", self.path)
        with reading(self.path, self.camera_at):
            camera = PerspectiveCamera(eye=self.camera[:3], target=self.camera[3:6], up=self.camera[6:9],
                                       vfov=self.camera[9], width=self.width, height=self.height)  # fmt: skip
        return Scene(
            *self.objects, camera=camera, ambient=1.0, samples=self.samples, name=self.name,
            transfer=self.settings.transfer, integrator=self.settings.integrator(self.depth, self.depth_at),
        )  # fmt: skip

    def command(self, name: str, words: list[str]) -> None:
        if name in CHOICES or name in AMOUNTS:
            return self.settings.command(name, words, self.line) if name != "integrator" else None
        if name == "output" and words:
            self.name = " ".join(words)
            return None
        if name == "output":
            raise self.error("output: expected a file name")
        if name not in COMMANDS:
            raise self.error(unknown("command", name[:40], [*COMMANDS, *CHOICES, *AMOUNTS, "output"]))
        count, action = COMMANDS[name]
        if len(words) < count:
            raise self.error(f"{name}: got {len(words)} number{'s' * (len(words) != 1)}; expected {count}")
        # What follows the numbers is ignored, as by the readers that course scenes were written for.
        return action(self, name, [number(word, name, self.path, self.line) for word in words[:count]])

    def error(self, message: str) -> FormatError:
        return FormatError(message, self.path, self.line)

    def integer(self, name: str, value: float, least: int) -> int:
        if whole(repr(value), name, self.path, self.line) < least:
            raise self.error(f"{name}: got {value:g}; expected at least {least}")
        return int(value)

    def size(self, name: str, values: Any) -> None:
        self.width, self.height = (self.integer(name, value, 1) for value in values)

    def maxdepth(self, name: str, values: Any) -> None:
        self.depth, self.depth_at = self.integer(name, values[0], -1), self.line

    def spp(self, name: str, values: Any) -> None:
        self.samples = self.integer(name, values[0], 1)

    def see(self, name: str, values: Any) -> None:
        self.camera, self.camera_at = values, self.line

    def hint(self, name: str, values: Any) -> None:
        self.integer(name, values[0], 0)

    def vertexnormal(self, name: str, values: Any) -> None:
        if not any(values[3:]):
            raise self.error("vertexnormal: the normal is 0 0 0; expected a direction")
        self.shaded_vertices.append(values)

    def tri(self, name: str, values: Any) -> None:
        self.triangle(name, np.array(self.pick(name, values, self.vertices)))

    def trinormal(self, name: str, values: Any) -> None:
        self.triangle(name, np.array(self.pick(name, values, self.shaded_vertices)))

    def pick(self, name: str, values: list[float], pile: list[list[float]]) -> list[list[float]]:
        indices = [self.integer(name, value, 0) for value in values]
        for index in indices:
            if index >= len(pile):
                what = "vertices" if name == "tri" else "vertexnormals"
                allowed = f"expected 0 to {len(pile) - 1}; " if pile else ""
                raise self.error(f"{name}: index {index}; {allowed}there are {len(pile)} {what} so far")
        return [pile[index] for index in indices]

    def triangle(self, name: str, corners: np.ndarray) -> None:
        """Move a triangle into the world, and let it wait for others of its kind."""
        self.total += 1
        self.limits.check_triangles(self.total, self.path, self.line)
        axes, origin = self.matrix[:3, :3], self.matrix[:3, 3]
        with np.errstate(over="ignore", invalid="ignore"):
            corners[:, :3] = corners[:, :3] @ axes.T + origin
            if name == "trinormal":
                normals = Transform(self.matrix).normal(corners[:, 3:])
                corners[:, 3:] = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        if not np.isfinite(corners).all():
            raise self.error(f"{name}: the transform moves it to infinity")
        run = (name, *self.colors.values(), self.settings.surface)
        if run != self.run:
            self.flush()
            self.run = run
        self.triangles.append(corners)

    def flush(self) -> None:
        """Make a mesh of the triangles that wait; corners of equal place (and normal) are one vertex."""
        if not self.triangles:
            return
        rows, faces = np.unique(np.concatenate(self.triangles), axis=0, return_inverse=True)
        self.triangles = []
        normals = rows[:, 3:] if rows.shape[1] == 6 else None
        mesh = solid_mesh(rows[:, :3], faces.reshape(-1, 3), normals, material=self.material(self.run[1:]))
        self.objects += [] if mesh is None else [mesh]

    def material(self, values: tuple[Any, ...]) -> Any:
        """One material for equal values, shared by all that have them."""
        if values not in self.materials:
            named = dict(zip(self.colors, values[:-1], strict=True))
            self.materials[values] = self.settings.material(named, values[-1])
        return self.materials[values]

    def sphere(self, name: str, values: Any) -> None:
        self.objects.append(Sphere(center=values[:3], radius=values[3], transform=Transform(self.matrix),
                                   material=self.material((*self.colors.values(), self.settings.surface))))  # fmt: skip

    def color(self, name: str, values: Any) -> None:
        if min(values) < 0:
            raise self.error(f"{name}: got {' '.join(f'{value:g}' for value in values)}; expected numbers >= 0")
        self.colors[name] = tuple(values) if len(values) == 3 else values[0]

    def attenuate(self, name: str, values: Any) -> None:
        c, l, q = values  # noqa: E741 - the textbook's letters
        PointLight(position=BLACK, attenuation=(c, l, q))  # complain here
        self.attenuation = (c, l, q)

    def point(self, name: str, values: Any) -> None:
        self.objects.append(PointLight(position=values[:3], intensity=values[3:], attenuation=self.attenuation))

    def directional(self, name: str, values: Any) -> None:
        towards: Any = [-value for value in values[:3]]
        self.objects.append(DirectionalLight(direction=towards, irradiance=values[3:]))

    def quad_light(self, name: str, values: Any) -> None:
        self.quads.append((self.line, len(self.objects), values))
        self.objects.append(None)  # until it is known in how many cells the light is looked at

    def multiply(self, name: str, values: Any) -> None:
        """Right-multiply: the command that stands next to a primitive moves it first."""
        step = np.eye(4)
        if name == "translate":
            step[:3, 3] = values
        elif name == "scale":
            step[[0, 1, 2], [0, 1, 2]] = values  # not a `Transform`: triangles may be flattened
        else:
            step = Transform.rotate(values[:3], values[3]).matrix
        with np.errstate(over="ignore", invalid="ignore"):
            self.matrix = self.matrix @ step
        if not np.isfinite(self.matrix).all():
            raise self.error(f"{name}: the matrix is no longer finite")

    def push(self, name: str, values: Any) -> None:
        if len(self.stack) >= 16 * self.limits.max_nesting:  # cheap, and generated files go deep
            raise self.error(f"pushTransform: {len(self.stack)} levels deep; raise max_nesting if it is to be")
        self.stack.append(self.matrix)

    def pop(self, name: str, values: Any) -> None:
        if not self.stack:
            raise self.error("popTransform without pushTransform")
        self.matrix = self.stack.pop()


COMMANDS: dict[str, tuple[int, Callable[[Reader, str, Any], None]]] = {
    "size": (2, Reader.size), "maxdepth": (1, Reader.maxdepth), "spp": (1, Reader.spp), "camera": (10, Reader.see),
    "maxverts": (1, Reader.hint), "maxvertnorms": (1, Reader.hint), "vertex": (3, lambda r, _, p: r.vertices.append(p)),
    "vertexnormal": (6, Reader.vertexnormal), "tri": (3, Reader.tri), "trinormal": (3, Reader.trinormal),
    "sphere": (4, Reader.sphere), "translate": (3, Reader.multiply), "rotate": (4, Reader.multiply),
    "scale": (3, Reader.multiply), "pushTransform": (0, Reader.push), "popTransform": (0, Reader.pop),
    "directional": (6, Reader.directional), "point": (6, Reader.point), "attenuation": (3, Reader.attenuate),
    "quadLight": (12, Reader.quad_light), "ambient": (3, Reader.color), "diffuse": (3, Reader.color),
    "specular": (3, Reader.color), "emission": (3, Reader.color), "shininess": (1, Reader.color),
}  # fmt: skip


def load(path: Path, limits: Limits) -> Scene:
    """Read."""
    return Reader(path, limits).read()


FORMATS = (Format("Course", (".test",), load),)
