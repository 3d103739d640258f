"""Sightray: a fast, readable ray tracer for Python.

>>> import sightray as sr
>>> scene = sr.Scene(
...     sr.Sphere(center=(0, 1, 0), radius=1, material=sr.Glass(ior=1.5)),
...     sr.Plane(point=(0, 0, 0), normal=(0, 1, 0), material=sr.Lambert(albedo=0.7)),
...     sr.PointLight(position=(4, 6, 4), intensity=80),
...     camera=sr.PerspectiveCamera(eye=(0, 2, 6), target=(0, 1, 0), vfov=40, width=64, height=48),
... )
>>> sr.render(scene, samples=4)
<Image width=64 height=48 ...>

Nouns are classes, verbs are functions: `load`, `render`, `label`, `explain`. Every class of every family (shapes, materials,
textures, lights, cameras, integrators, filters, label layers) is found here by its name.
"""

from __future__ import annotations

from typing import Any

_VERBS = ("load", "render", "label", "explain", "save", "denoise")
_NOUNS = {
    "Image": "sightray.images",
    "load_image": "sightray.images",
    "Transform": "sightray.mathlib.transform",
    "Scene": "sightray.scene.scene",
    "Group": "sightray.scene.instance",
    "Instance": "sightray.scene.instance",
    "Progress": "sightray.engine.progress",
    "Labels": "sightray.vision.labels",
    "Spectrum": "sightray.spectra",
    "RefractiveIndex": "sightray.spectra",
    "ComplexIndex": "sightray.spectra",
    "SightrayError": "sightray.errors",
    "SceneError": "sightray.errors",
    "FormatError": "sightray.errors",
    "UnsupportedError": "sightray.errors",
}
_PUBLIC_FAMILIES = (
    "shapes",
    "materials",
    "textures",
    "lights",
    "cameras",
    "integrators",
    "filters",
    "samplers",
    "media",
    "accelerators",
    "vision.layers",
    "vision.writers",
    "vision.depth_sensors",
)


def __getattr__(name: str) -> Any:
    """Find a verb, a class of any family, or say what was meant; modules are imported when first asked for."""
    import importlib

    if name in _VERBS:
        value = getattr(importlib.import_module("sightray.api"), name)
    elif name in _NOUNS:
        value = getattr(importlib.import_module(_NOUNS[name]), name)
    elif name in ("spectra", "vision"):
        value = importlib.import_module(f"sightray.{name}")
    elif name[0].isupper():
        value = _member(name)
    else:
        raise AttributeError(f"module 'sightray' has no attribute '{name}'")
    globals()[name] = value
    return value


def _member(name: str) -> Any:
    from sightray.errors import did_you_mean
    from sightray.registry import members

    for family in _PUBLIC_FAMILIES:
        found = members(family).get(name)
        if found is not None:
            return found
    raise AttributeError(f"module 'sightray' has no attribute '{name}'{did_you_mean(name, __dir__())}")


def __dir__() -> list[str]:
    from sightray.registry import members

    named = {name for family in _PUBLIC_FAMILIES for name in members(family)}
    return sorted({*_VERBS, *_NOUNS, "spectra", "vision", *named})
