"""The scenes and pictures of docs/labels.md: ``python examples/labels.py [docs/images/labels]``.

Writes examples/room.yaml, the room a moment later (room_next.yaml) and seen by a right eye (room_right.yaml), then the
picture of every layer. Each can be made alone by the command that the page shows beside it.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

import sightray as sr
from sightray.vision.label import known_layers

HERE = Path(__file__).parent
KEYPOINTS = {"crate": [(x, y, z) for x in (0.0, 0.7) for y in (0.0, 0.7) for z in (0.0, 0.7)]}


def crate(t: float) -> sr.Mesh:
    """A box of triangles that turns."""
    corners = [(x, y, z) for x in (0, 0.7) for y in (0, 0.7) for z in (0, 0.7)]
    faces = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4),
             (1, 5, 7), (1, 7, 3)]  # fmt: skip
    place = sr.Transform.translate(0.75 - 0.08 * t, 0, 1.1) @ sr.Transform.rotate((0, 1, 0), 25 + 9 * t)
    return sr.Mesh(vertices=corners, faces=faces, transform=place, name="crate",
                   material=sr.Lambert(albedo=(0.75, 0.55, 0.3)))  # fmt: skip


def pebble() -> sr.Group:
    """Two parts that move as one: a coarse ball of triangles with smooth normals, and a small sphere on it."""
    rings, sides = 6, 10
    angles = [(math.pi * i / rings, 2 * math.pi * k / sides) for i in range(rings + 1) for k in range(sides)]
    normals = [(math.sin(a) * math.cos(b), math.cos(a), math.sin(a) * math.sin(b)) for a, b in angles]
    quads = [(i * sides + k, i * sides + (k + 1) % sides) for i in range(rings) for k in range(sides)]
    faces = [f for a, b in quads for f in ((a, b, b + sides), (a, b + sides, a + sides)) if not _flat(f, sides, rings)]
    ball = sr.Mesh(vertices=0.3 * np.array(normals), faces=faces, normals=normals, material=sr.Lambert(albedo=0.6))
    top = sr.Sphere(center=(0, 0.38, 0), radius=0.13, material=sr.Lambert(albedo=(0.5, 0.1, 0.4)))
    place = sr.Transform.translate(0.0, 0.3, 1.7)
    return sr.Group(objects=(ball, top), transform=place, name="pebble")


def _flat(face: tuple[int, int, int], sides: int, rings: int) -> bool:
    """Whether two corners of a face are the same pole."""
    poles = [c // sides for c in face if c // sides in (0, rings)]
    return len(poles) > 1


def room(t: float = 0.0, step: float = 0.0) -> sr.Scene:
    """The room at time t, seen from `step` metres further to the right."""
    checker = sr.Checker(even=(0.75, 0.72, 0.65), odd=(0.3, 0.34, 0.4), scale=2.0, mode="solid")
    eye, target = (0.2 + 0.1 * t, 1.7, 5.2), (0.1 + 0.06 * t, 0.75, 0.0)
    camera = sr.PerspectiveCamera(eye=eye, target=target, vfov=38, width=320, height=240)
    right = camera.world_from_camera()[:3, 0] * step
    camera = camera.replace(eye=tuple(eye + right), target=tuple(target + right))
    return sr.Scene(
        sr.Rectangle(corner=(-2.6, 0, 2.6), edge_u=(5.2, 0, 0), edge_v=(0, 0, -5.2), name="floor",
                     material=sr.Phong(diffuse=checker, specular=0.0, ambient=0.4, mirror=0.0)),
        sr.Rectangle(corner=(-2.0, 0.1, -1.6), edge_u=(4.0, 0, 0.25 * t), edge_v=(0, 2.1, -0.2), name="mirror",
                     material=sr.Mirror(reflectance=0.9)),
        sr.Sphere(center=(-0.55 + 0.12 * t, 0.55, -0.2 - 0.1 * t), radius=0.55, name="ball",
                  material=sr.Phong(diffuse=(0.7, 0.15, 0.1), specular=0.6, ambient=0.2, shininess=60)),
        sr.Sphere(center=(-1.15, 0.5, 1.0), radius=0.5, name="glass", material=sr.Glass(ior=1.5)),
        sr.Torus(center=(1.45, 0.62, -0.5), axis=(0.5, 0.4, 1), major_radius=0.45, minor_radius=0.16, name="ring",
                 material=sr.Lambert(albedo=(0.2, 0.45, 0.75)), transform=sr.Transform.translate(0, 0.06 * t, 0)),
        crate(t),
        pebble(),
        sr.RectangleLight(corner=(-0.5, 2.25, -0.6), edge_u=(0.8, 0, 0), edge_v=(0, 0, 0.8), radiance=14, grid=3),
        sr.PointLight(position=(2.6, 3.4, 3.0), intensity=22),
        camera=camera, background=(0.25, 0.42, 0.7), ambient=0.25, name="room",
    )  # fmt: skip


def conventions() -> Image.Image:
    """A drawing of pixel coordinates, the camera's frame, and disparity."""
    canvas = Image.new("RGB", (720, 260), "white")
    draw, font = ImageDraw.Draw(canvas), ImageFont.load_default(13)

    def arrow(a: tuple[float, float], b: tuple[float, float], color: str, text: str) -> None:
        draw.line([a, b], color, 2)
        d = np.subtract(b, a) / np.linalg.norm(np.subtract(b, a))
        side = np.array([-d[1], d[0]])
        draw.polygon([tuple(np.add(b, 9 * d)), tuple(np.add(b, 4 * side)), tuple(np.subtract(b, 4 * side))], color)
        draw.text(tuple(np.add(b, 16 * d)), text, color, font, anchor="mm")

    # Pixels: corners at whole numbers, centres at halves.
    x0, y0, size = 40, 50, 48
    for row in range(3):
        for column in range(4):
            left, top = x0 + column * size, y0 + row * size
            draw.rectangle([left, top, left + size, top + size], "#eef2f7", "#8899aa")
            draw.ellipse([left + 22, top + 22, left + 26, top + 26], "#8899aa")
    draw.text((x0 - 4, y0 - 12), "(0, 0)", "black", font, anchor="mm")
    draw.text((x0 + 4 * size, y0 + 3 * size + 14), "(4, 3) = (width, height)", "black", font, anchor="rm")
    draw.text((x0 + 24, y0 + 36), "(0.5, 0.5)", "#c03020", font, anchor="mm")
    draw.ellipse([x0 + 21, y0 + 21, x0 + 27, y0 + 27], "#c03020")
    draw.text((x0 + 96, 236), "pixel coordinates: centres at halves", "black", font, anchor="mm")

    # The camera's frame.
    eye = (330, 120)
    draw.polygon([(eye[0], eye[1]), (410, 70), (410, 150), (380, 180), (380, 100)], "#f4efe2", "#b0a080")
    arrow(eye, (445, 112), "#2050c0", "z")
    arrow(eye, (330, 190), "#208030", "y")
    arrow(eye, (372, 146), "#c03020", "x")
    draw.text((375, 236), "camera: x right, y down, z forward", "black", font, anchor="mm")

    # A rectified pair.
    for k, (left, at) in enumerate(((500, 72), (615, 44))):
        draw.rectangle([left, 60, left + 95, 140], "#eef2f7", "#8899aa")
        draw.ellipse([left + at - 5, 95, left + at + 5, 105], "#c03020")
        draw.line([left, 118, left + at, 118], "#2050c0", 2)
        draw.text((left + at / 2, 128), ("x left", "x right")[k], "#2050c0", font, anchor="mm")
        draw.text((left + 48, 48), ("left", "right")[k], "black", font, anchor="mm")
    draw.text((605, 165), "disparity = x left - x right = f B / z", "black", font, anchor="mm")
    draw.text((605, 236), "a rectified pair", "black", font, anchor="mm")
    return canvas


def more_conventions() -> Image.Image:
    """A drawing of the world and normals, texture coordinates, poses, flow and boxes, and the times of rows."""
    canvas = Image.new("RGB", (980, 240), "white")
    draw, font = ImageDraw.Draw(canvas), ImageFont.load_default(13)
    red, green, blue, grey, pale = "#c03020", "#208030", "#2050c0", "#8899aa", "#eef2f7"

    def arrow(
        a: tuple[float, float], b: tuple[float, float], color: str, text: str = "", beside: tuple = (0, 0)
    ) -> None:
        draw.line([a, b], color, 2)
        d = np.subtract(b, a) / np.linalg.norm(np.subtract(b, a))
        side = 4 * np.array([-d[1], d[0]])
        draw.polygon([tuple(b + 8 * d), tuple(b + side), tuple(b - side)], color)
        draw.text(tuple(b + 15 * d + beside), text, color, font, anchor="mm")

    def caption(x: float, text: str) -> None:
        draw.text((x, 220), text, "black", font, anchor="mm")

    # The world, and the outer side of a triangle.
    arrow((40, 150), (40, 80), green, "y")
    arrow((40, 150), (100, 150), red, "x")
    arrow((40, 150), (18, 182), blue, "z")
    draw.polygon([(80, 110), (150, 120), (118, 60)], pale, grey)
    for (x, y), name in (((74, 118), "0"), ((158, 124), "1"), ((118, 50), "2")):
        draw.text((x, y), name, grey, font, anchor="mm")
    arrow((116, 98), (138, 84), "black", "n")
    caption(96, "corners seen from outside")

    # Texture coordinates.
    draw.rectangle([215, 70, 315, 150], pale, grey)
    draw.text((270, 82), "bitmap row 0", grey, font, anchor="mm")
    arrow((215, 150), (300, 150), red, "u")
    arrow((215, 150), (215, 80), blue, "v")
    caption(265, "v runs upward")

    # Poses.
    for x, y, name in ((390, 150, "world"), (470, 60, "camera"), (550, 150, "object")):
        draw.ellipse([x - 4, y - 4, x + 4, y + 4], "black")
        draw.text((x, y + (15 if y > 100 else -15)), name, "black", font, anchor="mm")
    arrow((466, 66), (400, 139), blue)
    draw.text((428, 100), "world_from_camera", blue, font, anchor="rm")
    arrow((543, 142), (480, 71), red)
    draw.text((515, 100), "camera_from_object", red, font, anchor="lm")
    caption(470, "a_from_b @ point in b")

    # Flow, and a box around one pixel.
    for column in range(5):
        for row in range(3):
            draw.rectangle([680 + 24 * column, 70 + 24 * row, 704 + 24 * column, 94 + 24 * row], pale, grey)
    draw.rectangle([752, 94, 776, 118], None, red, 2)
    draw.text((764, 58), "3   4", red, font, anchor="mm")
    arrow((692, 82), (726, 120), blue, "x1 - x0", (14, 10))
    caption(740, "a box; flow")

    # The rows of a rolling shutter.
    for row in range(5):
        x, y = 860 + 12 * row, 70 + 18 * row
        draw.rectangle([x, y, x + 40, y + 12], pale, grey)
        draw.line([x + 20, y, x + 20, y + 12], red, 2)
    arrow((856, 172), (945, 172), "black", "t")
    caption(905, "rows and times")
    return canvas


def main(folder: Path) -> None:
    now, after, right = room(), room(1.0), room(step=0.15)
    for name, scene in (("room", now), ("room_next", after), ("room_right", right)):
        sr.save(scene, HERE / f"{name}.yaml")
    labels = sr.label(now, *known_layers(), next=after, previous=room(-1.0), stereo=right, keypoints=KEYPOINTS)
    folder.mkdir(parents=True, exist_ok=True)
    for name in labels.layers:
        if labels.about(name).picture:
            labels.picture(name).save(folder / f"{name}.png", compression=9)
    conventions().save(folder / "conventions.png", optimize=True)
    more_conventions().save(folder / "more_conventions.png", optimize=True)
    print(folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE.parent / "docs" / "images" / "labels")
