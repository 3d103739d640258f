"""Scenes and cameras for the tests of labels, and closed forms for what they show."""

from __future__ import annotations

import numpy as np

import sightray as sr
from sightray.cameras.base import look_at
from sightray.registry import members

EYE, TARGET = (0.4, 1.6, 5.0), (0.1, 0.3, 0.0)
POSE = look_at(EYE, TARGET, (0, 1, 0), "test")
SIZE = {"width": 41, "height": 30}


def every_camera() -> dict[str, sr.PerspectiveCamera]:
    """One camera of each registered kind, all in the same place."""
    found = {}
    for name, kind in members("cameras").items():
        if not kind.__module__.startswith("sightray."):
            continue
        values = dict(SIZE)
        if "eye" in kind.given:
            values |= {"eye": EYE, "target": TARGET}
        if "pose" in kind.given:
            values |= {"pose": POSE}
        if "fx" in kind.given:
            values |= {"fx": 38.0}
        if "k1" in kind.given:
            values |= {"k1": -0.05}
        if "view_height" in kind.given:
            values |= {"view_height": 4.0}
        if "lens_radius" in kind.given:
            values |= {"lens_radius": 0.1}
        if "fov" in kind.given:
            values |= {"fov": 60.0}
        if "hfov" in kind.given:
            values |= {"hfov": 60.0, "vfov": 45.0}
        if "camera" in kind.given:
            values = {"camera": sr.PerspectiveCamera(**SIZE), "poses": [(0.0, POSE)]}
        found[name] = kind(**values)
    return found


def centres(camera) -> np.ndarray:
    """Pixel coordinates of all pixel centres, (h, w, 2)."""
    x, y = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    return np.stack([x, y], axis=-1)


BALL = sr.Sphere(center=(0.2, 0.6, 0.3), radius=0.8, name="ball")
FLOOR = sr.Plane(point=(0, -0.4, 0), normal=(0, 1, 0), name="floor")
RING = sr.Torus(center=(-1.3, 0.3, 0.2), axis=(0.3, 1, 0.2), major_radius=0.5, minor_radius=0.2, name="ring")
EGG = sr.Sphere(
    transform=sr.Transform.translate(1.6, 0.3, -0.5)
    @ sr.Transform.rotate((1, 2, 0), 40)
    @ sr.Transform.scale(0.4, 0.7, 0.4),
    name="egg",
)  # fmt: skip
CRATE = sr.Mesh(
    vertices=[(x, y, z) for x in (0, 0.5) for y in (0, 0.5) for z in (0, 0.5)],
    faces=[(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4),
           (1, 5, 7), (1, 7, 3)],
    transform=sr.Transform.translate(-0.6, -0.2, 1.8) @ sr.Transform.rotate((0, 1, 0), 30), name="crate",
)  # fmt: skip
OBJECTS = (BALL, FLOOR, RING, EGG, CRATE)


def scene(camera, *objects, **options) -> sr.Scene:
    """The objects, by default all of them, seen by a camera."""
    return sr.Scene(*(objects or OBJECTS), camera=camera, **options)


def moved(camera, t: float = 1.0) -> sr.Scene:
    """The same objects a moment later: each in another way of moving, but for the floor."""
    turn = sr.Transform.translate(0.1 * t, 0.05 * t, -0.1 * t) @ sr.Transform.rotate((0, 1, 0.2), 12 * t)
    return scene(
        camera, BALL.replace(center=(0.2 + 0.1 * t, 0.6, 0.3 - 0.2 * t)), FLOOR,
        RING.replace(transform=sr.Transform.translate(0, 0.1 * t, 0)), EGG.replace(transform=turn @ EGG.transform),
        CRATE.replace(transform=turn @ CRATE.transform),
    )  # fmt: skip


def residuals(points: np.ndarray, instance: np.ndarray) -> np.ndarray:
    """How far points are from the surfaces of `OBJECTS`, metres, to first order, by their equations alone."""
    found = np.full(instance.shape, np.nan)
    on = instance == 0
    found[on] = np.linalg.norm(points[on] - BALL.center, axis=-1) - BALL.radius
    found[instance == 1] = points[instance == 1][:, 1] + 0.4
    on = instance == 2
    axis = np.array(RING.axis) / np.linalg.norm(RING.axis)
    q = points[on] - RING.center
    height = q @ axis
    found[on] = np.hypot(np.linalg.norm(q - height[:, None] * axis, axis=-1) - 0.5, height) - 0.2
    on = instance == 3
    found[on] = (
        np.linalg.norm(EGG.transform.inverse[:3, :3] @ (points[on] - EGG.transform.matrix[:3, 3]).T, axis=0) - 1
    ) * 0.4
    on = instance == 4
    q = (CRATE.transform.inverse[:3, :3] @ (points[on] - CRATE.transform.matrix[:3, 3]).T).T
    found[on] = np.abs(q - 0.25).max(axis=-1) - 0.25
    return found


def sphere_distance(o: np.ndarray, d: np.ndarray, center, radius: float) -> np.ndarray:
    """Distance to a sphere along unit rays by the quadratic formula in extended precision; infinite for a miss."""
    o, d = np.asarray(o, np.longdouble) - np.asarray(center, np.longdouble), np.asarray(d, np.longdouble)
    dd, od = (d * d).sum(-1), (o * d).sum(-1)
    root = od * od - dd * ((o * o).sum(-1) - np.longdouble(radius) ** 2)
    with np.errstate(invalid="ignore", divide="ignore"):
        t = (-od - np.sqrt(root)) / dd
        return np.where((root > 0) & (t > 0), t, np.inf).astype(float)
