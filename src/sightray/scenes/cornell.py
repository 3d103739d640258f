"""The Cornell box, as measured: coloured walls, two blocks, one square light.

C. Goral, K. Torrance, D. Greenberg, B. Battaile, "Modeling the interaction of light between diffuse surfaces"
(SIGGRAPH 1984); geometry and reflectances as measured by the Program of Computer Graphics, Cornell University.
"""

from __future__ import annotations

from typing import Any

import sightray as sr

WHITE, GREEN, RED = (0.885809, 0.698859, 0.666422), (0.105421, 0.37798, 0.076425), (0.570068, 0.0430135, 0.0443706)
LIGHT = (18.387, 13.9873, 6.75357)  # W/(m² sr)

# Corners of the faces in millimetres, counter-clockwise seen from where they are seen; the box opens towards -z.
WALLS: dict[str, tuple[tuple[float, float, float], list[Any]]] = {
    "floor": (WHITE, [(552.8, 0, 0), (0, 0, 0), (0, 0, 559.2), (549.6, 0, 559.2)]),
    "ceiling": (WHITE, [(556, 548.8, 0), (556, 548.8, 559.2), (0, 548.8, 559.2), (0, 548.8, 0)]),
    "back wall": (WHITE, [(549.6, 0, 559.2), (0, 0, 559.2), (0, 548.8, 559.2), (556, 548.8, 559.2)]),
    "right wall": (GREEN, [(0, 0, 559.2), (0, 0, 0), (0, 548.8, 0), (0, 548.8, 559.2)]),
    "left wall": (RED, [(552.8, 0, 0), (549.6, 0, 559.2), (556, 548.8, 559.2), (556, 548.8, 0)]),
}
BLOCKS: dict[str, list[list[Any]]] = {
    "short block": [
        [(130, 165, 65), (82, 165, 225), (240, 165, 272), (290, 165, 114)],
        [(290, 0, 114), (290, 165, 114), (240, 165, 272), (240, 0, 272)],
        [(130, 0, 65), (130, 165, 65), (290, 165, 114), (290, 0, 114)],
        [(82, 0, 225), (82, 165, 225), (130, 165, 65), (130, 0, 65)],
        [(240, 0, 272), (240, 165, 272), (82, 165, 225), (82, 0, 225)],
    ],
    "tall block": [
        [(423, 330, 247), (265, 330, 296), (314, 330, 456), (472, 330, 406)],
        [(423, 0, 247), (423, 330, 247), (472, 330, 406), (472, 0, 406)],
        [(472, 0, 406), (472, 330, 406), (314, 330, 456), (314, 0, 456)],
        [(314, 0, 456), (314, 330, 456), (265, 330, 296), (265, 0, 296)],
        [(265, 0, 296), (265, 330, 296), (423, 330, 247), (423, 0, 247)],
    ],
}
MM = 1e-3


def faces(quads: list[list[Any]], color: tuple[float, float, float], name: str) -> sr.Mesh:
    """Four-cornered faces as one mesh, in metres."""
    vertices = [tuple(MM * c for c in corner) for quad in quads for corner in quad]
    triangles = [t for k in range(0, len(vertices), 4) for t in ((k, k + 1, k + 2), (k, k + 2, k + 3))]
    return sr.Mesh(vertices=vertices, faces=triangles, material=sr.Lambert(albedo=color), name=name)


def build() -> sr.Scene:
    walls = [faces([quad], color, name) for name, (color, quad) in WALLS.items()]
    blocks = [faces(quads, WHITE, name) for name, quads in BLOCKS.items()]
    lamp = sr.RectangleLight(
        corner=(0.213, 0.5487, 0.227), edge_u=(0.13, 0, 0), edge_v=(0, 0, 0.105), radiance=LIGHT, grid=2
    )
    return sr.Scene(
        *walls, *blocks, lamp,
        camera=sr.PerspectiveCamera(
            eye=(0.278, 0.273, -0.8), target=(0.278, 0.273, 0), vfov=39.3077, width=512, height=512
        ),
        ambient=(0.25, 0.2, 0.15), samples=4, name="cornell",
    )  # fmt: skip
