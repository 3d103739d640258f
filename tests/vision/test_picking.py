"""Picking items for tiles changes how soon labels are there, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

import sightray as sr
from sightray.mathlib.vec import Vec3
from sightray.vision import frame
from sightray.vision.picking import IntervalRay, may_meet

LAYERS = ("depth", "position", "normal", "uv", "instance", "primitive", "item")


def bundle(rng: np.random.Generator, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rays that go about the same way, past a target; every fourth bundle along an axis, where speeds are 0."""
    origin = rng.normal(size=3) * 3
    direction = target + rng.normal(size=3) - origin
    if rng.random() < 0.25:
        axis = rng.integers(3)
        direction = np.eye(3)[axis] * rng.choice([-1, 1])
        origin = np.where(np.arange(3) == axis, origin, target + rng.normal(size=3))
    origins = origin + rng.normal(size=(8, 3)) * rng.choice([0.0, 0.1])
    return origins, direction + rng.normal(size=(8, 3)) * rng.choice([0.0, 0.02, 0.3])


def meets(origin: np.ndarray, direction: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> bool:
    """Whether a ray meets a box, by slabs."""
    with np.errstate(all="ignore"):
        a, b = (lower - origin) / direction, (upper - origin) / direction
    still = direction == 0
    if (still & ((origin < lower) | (origin > upper))).any():
        return False
    near, far = np.minimum(a, b)[~still], np.maximum(a, b)[~still]
    return max(near.max(), 0.0) <= far.min()


def test_whatever_a_ray_meets_is_picked_and_most_else_is_not():
    rng = np.random.default_rng(1)
    met = missed = wrongly = 0
    for _ in range(3000):
        center, half = rng.normal(size=3) * 3, rng.uniform(0, 1, 3)
        origins, directions = bundle(rng, center)
        lower, upper = center - half, center + half
        edges = [f(part, axis=0) for part in (origins, directions) for f in (np.min, np.max)]
        picked = may_meet(IntervalRay(*(Vec3(*edge) for edge in edges)), Vec3(*lower), Vec3(*upper))
        if any(meets(o, d, lower, upper) for o, d in zip(origins, directions, strict=True)):
            met += 1
            assert picked
        else:
            missed += 1
            wrongly += picked
    assert min(met, missed) > 500
    assert wrongly < 0.12 * missed  # between the rays of wide bundles there is room


def scenes() -> dict[str, sr.Scene]:
    """Few items and many; items at the same place, of which the first counts; a plane without end."""
    wall = {"corner": (-1, -1, 0), "edge_u": (2, 0, 0), "edge_v": (0, 2, 0)}
    twice = sr.Mesh(vertices=[(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], faces=[(0, 1, 2), (0, 2, 3)])
    eye = sr.PerspectiveCamera(eye=(0.3, 0.2, 4), target=(0, 0, 0), width=45, height=37)
    rng = np.random.default_rng(2)
    balls = [sr.Sphere(center=c, radius=0.2) for c in rng.uniform(-1, 1, (40, 3))]
    return {
        "coincident": sr.Scene(sr.Rectangle(**wall), twice, sr.Rectangle(**wall), camera=eye),
        "mesh first": sr.Scene(twice, sr.Rectangle(**wall), sr.Plane(point=(0, -1, 0)), camera=eye),
        "balls": sr.Scene(*balls, sr.Plane(point=(0, -1, 0)), camera=eye),
        "crowd": sr.Scene(*(sr.Sphere(center=(0, 0, -k), radius=1 + k) for k in range(20)), camera=eye),
        "whitted": sr.load("whitted").replace(camera=sr.load("whitted").camera.resized(61, 43)),
        "cornell": sr.load("cornell").replace(camera=sr.load("cornell").camera.resized(61, 43)),
    }


@pytest.mark.parametrize("name", scenes())
def test_labels_are_those_of_rays_through_the_tree(name, monkeypatch):
    scene = scenes()[name]
    views = [scene.camera, sr.FisheyeCamera(eye=(0.3, 0.2, 2), target=(0, 0, 0), fov=200, width=40, height=30),
             sr.OrthographicCamera(eye=(0.3, 0.2, 4), target=(0, 0, 0), width=40, height=30)]  # fmt: skip
    picked = [sr.label(scene, *LAYERS, camera=camera) for camera in views]
    monkeypatch.setattr(frame, "MOST_CASTS", 0)
    for labels, camera in zip(picked, views, strict=True):
        alone = sr.label(scene, *LAYERS, camera=camera)
        for layer in LAYERS:
            np.testing.assert_array_equal(labels[layer], alone[layer], err_msg=f"{layer}, {type(camera).__name__}")
        assert (labels.item >= 0).any()
