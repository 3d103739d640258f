"""A glass and a mirror sphere over a checkered floor, in the spirit of Turner Whitted's picture of 1980."""

from __future__ import annotations

import sightray as sr


def build() -> sr.Scene:
    floor = sr.Phong(
        diffuse=sr.Checker(even=(0.9, 0.75, 0.08), odd=(0.75, 0.08, 0.05), scale=1.0, mode="solid"),
        ambient=(1, 0.6, 0.1),
        specular=0,
    )
    mirror = sr.Phong(diffuse=0.12, specular=0.5, shininess=120, mirror=0.75, ambient=0.3)
    return sr.Scene(
        sr.Sphere(center=(-0.55, 2.25, 2.4), radius=1.0, material=sr.Glass(ior=1.5), name="glass"),
        sr.Sphere(center=(0.95, 1.25, 0.2), radius=1.0, material=mirror, name="mirror"),
        sr.Rectangle(corner=(-5, 0, 6), edge_u=(9, 0, 0), edge_v=(0, 0, -22), material=floor, name="floor"),
        sr.PointLight(position=(-4, 9, 7), intensity=120),
        camera=sr.PerspectiveCamera(eye=(0, 2.4, 8.0), target=(0, 1.7, 0), vfov=40, width=640, height=480),
        integrator=sr.Whitted(max_depth=8, transparent_shadows=True),
        background=(0.27, 0.53, 0.86), ambient=0.15, samples=9, name="whitted",
    )  # fmt: skip
