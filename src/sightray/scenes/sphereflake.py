"""Eric Haines' sphereflake: 7381 mirror spheres, each level nine copies of a smaller one."""

from __future__ import annotations

import sightray as sr

LEVELS = 4


def flake(level: int, material: object) -> sr.Group:
    """A unit sphere with nine flakes of a third of its size around it; copies are instances."""
    ball = sr.Sphere(radius=1.0, material=material)
    if level == 0:
        return sr.Group(objects=[ball])
    smaller = flake(level - 1, material)
    around = [(90.0, 60.0 * k) for k in range(6)] + [(35.0, 120.0 * k + 30.0) for k in range(3)]
    place = [
        sr.Transform.rotate((0, 1, 0), turn) @ sr.Transform.rotate((0, 0, 1), -tilt)
        @ sr.Transform.translate(0, 4 / 3, 0) @ sr.Transform.scale(1 / 3)
        for tilt, turn in around
    ]  # fmt: skip
    return sr.Group(objects=[ball, *(sr.Instance(of=smaller, transform=t) for t in place)])


def build() -> sr.Scene:
    shiny = sr.Phong(diffuse=(0.55, 0.42, 0.2), specular=0.5, shininess=50, mirror=0.45, ambient=(0.5, 0.4, 0.2))
    floor = sr.Phong(diffuse=0.55, ambient=0.5, mirror=0.1, specular=0)
    return sr.Scene(
        sr.Group(objects=[flake(LEVELS, shiny)], transform=sr.Transform.rotate((1, 0, 0), 12), name="sphereflake"),
        sr.Plane(point=(0, -1.75, 0), normal=(0, 1, 0), material=floor, name="floor"),
        sr.PointLight(position=(6, 8, 7), intensity=130),
        sr.PointLight(position=(-7, 5, 3), intensity=40),
        camera=sr.PerspectiveCamera(
            eye=(2.1, 2.6, 4.7), target=(0, -0.1, 0), vfov=40, width=640, height=480
        ),
        background=(0.1, 0.14, 0.22), ambient=0.25, samples=9, name="sphereflake",
    )  # fmt: skip
