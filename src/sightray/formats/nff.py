"""NFF, the Neutral File Format of the Standard Procedural Databases (E. Haines, "A proposal for standard graphics
environments", IEEE CG&A 7(11), 1987; format 3.9).

Where the format leaves a choice to the program:

- ``angle`` spans the *centres* of the outer pixel rows, so the field of view is one pixel wider. ``hither`` is unused.
- Lights without a colour have intensity 1/sqrt(number of lights) at any distance, as the database's programs do it.
- ``Kd`` and ``Ks`` multiply the fill colour; ``Ks`` is highlight and mirror at once. There is no ambient light.
- Surfaces with T > 0 are `Glass` that lets T through at each passage; their Kd and Ks are not used.
- One-sided surfaces are seen from both sides, so negative radii mean the same as positive ones.
- Consecutive polygons of one fill colour become one mesh.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from sightray.cameras.perspective import PerspectiveCamera
from sightray.errors import FormatError, unknown
from sightray.formats.base import Format, Limits, number, read_text, reading
from sightray.formats.polygons import split_polygons
from sightray.formats.solid import solid_mesh
from sightray.integrators.whitted import Whitted
from sightray.lights.point import PointLight
from sightray.materials.glass import Glass
from sightray.materials.phong import Phong
from sightray.scene.scene import Scene
from sightray.shapes.cone import Cone
from sightray.shapes.cylinder import Cylinder
from sightray.shapes.sphere import Sphere

ENTITIES = ("v", "b", "l", "f", "c", "s", "p", "pp")
VIEW = {"from": 3, "at": 3, "up": 3, "angle": 1, "hither": 1, "resolution": 2}
MAX_POLYGON = 100_000  # corners


class Reader:
    """The words of a file, and what they have stated so far."""

    def __init__(self, path: Path, limits: Limits):
        self.path, self.limits = path, limits
        lines = enumerate(read_text(path, limits).splitlines(), 1)
        self.tokens = [(token, line) for line, content in lines for token in content.split("#", 1)[0].split()]
        self.at = 0
        self.view: dict[str, Any] = {}
        self.background = (0.0, 0.0, 0.0)
        self.lights: list[Any] = []
        self.objects: list[Any] = []
        self.material: Any = None
        self.polygons: list[np.ndarray] = []  # of one material, all with or all without normals
        self.triangles = 0

    def read(self) -> Scene:
        while self.at < len(self.tokens):
            word, line = self.tokens[self.at]
            self.at += 1
            if word not in ENTITIES:
                raise FormatError(unknown("entity", word[:40], ENTITIES), self.path, line)
            if word not in ("p", "pp"):
                self.flush()
            with reading(self.path, line):
                getattr(self, f"read_{word}")(line)
        self.flush()
        if not self.view:
            raise FormatError("no viewpoint; expected an entity 'v'", self.path)
        equal: Any = 1 / math.sqrt(max(1, len(self.lights)))
        lights = [PointLight(position=x[:3], intensity=x[3:] or equal, attenuation=(1, 0, 0)) for x in self.lights]
        return Scene(
            *self.objects, *lights, camera=self.camera(), background=self.background, integrator=Whitted(),
            name=self.path.stem,
        )  # fmt: skip

    def numbers(self, count: int, what: str, line: int) -> Any:
        """The next words as numbers."""
        if self.at + count > len(self.tokens):
            raise FormatError(f"{what}: the file ends; expected {count} numbers", self.path, line)
        words = self.tokens[self.at : self.at + count]
        self.at += count
        return [number(token, what, self.path, where) for token, where in words]

    def read_v(self, line: int) -> None:
        while self.at < len(self.tokens) and self.tokens[self.at][0] in VIEW:
            name, where = self.tokens[self.at]
            self.at += 1
            self.view[name] = self.numbers(VIEW[name], name, where)
        for name in VIEW:
            if name not in self.view and name != "hither":
                raise FormatError(f"viewpoint without '{name}'; expected {', '.join(VIEW)}", self.path, line)
        self.camera()

    def camera(self) -> PerspectiveCamera:
        width, height = self.view["resolution"]
        half = math.tan(math.radians(self.view["angle"][0]) / 2)
        vfov = math.degrees(2 * math.atan(half * height / max(1.0, height - 1)))
        return PerspectiveCamera(eye=self.view["from"], target=self.view["at"], up=self.view["up"], vfov=vfov,
                                 width=width, height=height)  # fmt: skip

    def read_b(self, line: int) -> None:
        r, g, b = self.numbers(3, "background", line)
        self.background = (r, g, b)

    def read_l(self, line: int) -> None:
        light: Any = self.numbers(3, "light", line)
        if self.at < len(self.tokens) and self.tokens[self.at][0] not in ENTITIES:
            light += self.numbers(3, "colour of the light", line)
        PointLight(position=light[:3], intensity=light[3:] or (1.0, 1.0, 1.0))  # complain here, where the line is known
        self.lights.append(light)

    def read_f(self, line: int) -> None:
        *fill, kd, ks, shine, through, ior = self.numbers(8, "fill colour", line)
        specular = [ks * part for part in fill]
        if through > 0:
            tint: Any = min(1.0, through)
            self.material = Glass(ior=ior if ior > 0 else 1.0, tint=tint)
        else:
            self.material = Phong(diffuse=[kd * part for part in fill], ambient=0.0, specular=specular,
                                  shininess=shine, mirror=specular)  # fmt: skip

    def read_s(self, line: int) -> None:
        x, y, z, radius = self.numbers(4, "sphere", line)
        self.objects.append(Sphere(center=(x, y, z), radius=abs(radius), material=self.material))

    def read_c(self, line: int) -> None:
        values = self.numbers(8, "cone or cylinder", line)
        base, base_radius, apex, apex_radius = values[:3], values[3], values[4:7], values[7]
        if abs(base_radius) == abs(apex_radius):
            tube: Any = Cylinder(base=base, top=apex, radius=abs(base_radius), capped=False, material=self.material)
        else:
            tube = Cone(base=base, top=apex, base_radius=abs(base_radius), top_radius=abs(apex_radius), capped=False,
                        material=self.material)  # fmt: skip
        self.objects.append(tube)

    def read_p(self, line: int) -> None:
        self.polygon(3, line)

    def read_pp(self, line: int) -> None:
        self.polygon(6, line)

    def polygon(self, columns: int, line: int) -> None:
        (count,) = self.numbers(1, "number of vertices", line)
        if not 3 <= count <= MAX_POLYGON or count != int(count):
            raise FormatError(f"a polygon of {count:g} vertices; allowed: 3 to {MAX_POLYGON}", self.path, line)
        self.triangles += int(count) - 2
        self.limits.check_triangles(self.triangles, self.path, line)
        rows = np.array(self.numbers(columns * int(count), "polygon", line)).reshape(-1, columns)
        if self.polygons and self.polygons[0].shape[1] != columns:
            self.flush()
        self.polygons.append(rows)

    def flush(self) -> None:
        """Make a mesh of the polygons that wait."""
        if not self.polygons:
            return
        rows = np.concatenate(self.polygons)
        counts = np.array([len(polygon) for polygon in self.polygons])
        # Corners of equal place (and normal) are one vertex.
        rows, corners = np.unique(rows, axis=0, return_inverse=True)
        faces = corners.ravel()[split_polygons(rows[:, :3], counts, corners.ravel())]
        self.polygons = []
        normals = rows[:, 3:] if rows.shape[1] == 6 else None
        mesh = solid_mesh(rows[:, :3], faces, normals, material=self.material)
        self.objects += [] if mesh is None else [mesh]


def load(path: Path, limits: Limits) -> Scene:
    """Read."""
    return Reader(path, limits).read()


FORMATS = (Format("NFF", (".nff",), load),)
