"""One scene, rendered in the five stages in which ray tracing is taught."""

from __future__ import annotations

import sightray as sr

STAGES = {
    "ray casting": sr.Whitted(illumination=False, shadows=False, reflections=False, refractions=False),
    "+ local illumination": sr.Whitted(shadows=False, reflections=False, refractions=False),
    "+ shadows": sr.Whitted(reflections=False, refractions=False),
    "+ reflections": sr.Whitted(refractions=False),
    "+ refractions": sr.Whitted(),
}


def stage(number: int) -> sr.Scene:
    """The scene with the integrator of stage 1 to 5."""
    integrator = list(STAGES.values())[number - 1]
    floor = sr.Phong(
        diffuse=sr.Checker(even=0.6, odd=(0.14, 0.25, 0.21), scale=1.0, mode="solid"),
        ambient=0.6,
        mirror=0.15,
        specular=0,
    )
    red = sr.Phong(diffuse=(0.8, 0.12, 0.08), ambient=(0.8, 0.12, 0.08), specular=0.6, shininess=60, mirror=0.1)
    chrome = sr.Phong(diffuse=(0.15, 0.17, 0.2), ambient=(0.15, 0.17, 0.2), specular=0.8, shininess=150, mirror=0.7)
    return sr.Scene(
        sr.Plane(point=(0, 0, 0), normal=(0, 1, 0), material=floor, name="floor"),
        sr.Sphere(center=(-1.9, 1, -0.8), radius=1, material=red, name="plastic"),
        sr.Sphere(center=(0.35, 1, -1.6), radius=1, material=chrome, name="chrome"),
        sr.Sphere(center=(1.3, 0.75, 0.9), radius=0.75, material=sr.Glass(ior=1.5), name="glass"),
        sr.Box(lower=(-0.95, 0, 0.55), upper=(-0.15, 0.8, 1.35), name="block",
               material=sr.Phong(diffuse=(0.15, 0.3, 0.75), ambient=(0.15, 0.3, 0.75), specular=0.1)),
        sr.PointLight(position=(-4, 7, 5), intensity=62),
        sr.PointLight(position=(5, 5, 3), intensity=18),
        camera=sr.PerspectiveCamera(eye=(0.3, 2.6, 7), target=(0, 0.75, 0), vfov=36, width=480, height=360),
        integrator=integrator, background=(0.45, 0.62, 0.85), ambient=0.15, samples=9, name=f"stage{number}",
    )  # fmt: skip
