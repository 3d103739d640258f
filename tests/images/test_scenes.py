"""The built-in scenes: all of them render, and show what they promise."""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import sightray as sr
from sightray import registry, scenes
from sightray.scenes.primitives import specimens
from sightray.scenes.teapot import patches, teapot_grid


@pytest.mark.parametrize("name", scenes.names())
def test_scene_renders_and_is_not_dull(name):
    scene = sr.load(name)
    small = scene.replace(camera=scene.camera.resized(64, 48))
    image = np.asarray(sr.render(small, samples=1))
    assert np.isfinite(image).all()
    assert image.std() > 0.05
    assert 0.02 < np.clip(image, 0, 1).mean() < 0.9
    assert (image > 1).all(-1).mean() < 0.3  # not burnt out


def test_primitives_shows_every_shape():
    own = {name for name, cls in registry.members("shapes").items() if cls.__module__.startswith("sightray.")}
    assert set(specimens()) | {"Plane"} == own


def test_teapot_is_newells():
    """Area and extent of the tessellated pot, and patch midpoints, as tabulated."""
    assert len(patches()) == 32
    grid = teapot_grid(64)
    a, b, c = (grid.vertices[grid.faces[:, k]] for k in range(3))
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(52.87782944, rel=1e-8)
    np.testing.assert_allclose(grid.vertices.min(0), [-3, -2, 0], atol=1e-9)
    np.testing.assert_allclose(grid.vertices.max(0), [3.4340644836, 2, 3.15], atol=1e-9)
    outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), grid.normals[grid.faces].sum(axis=1))
    assert (outward > 0).mean() > 0.999


def test_sphereflake_has_its_spheres():
    from sightray.scene.compile import flatten

    assert sum(isinstance(item.shape, sr.Sphere) for item in flatten(sr.load("sphereflake"))) == 7381


def test_lecture_strip(tmp_path):
    sys.path.insert(0, str(Path(__file__).parents[2] / "examples"))
    import lecture_stages

    scene = sr.load("stage5-refractions")
    picture = np.asarray(lecture_stages.strip(scene.replace(camera=scene.camera.resized(60, 45), samples=1))).astype(
        int
    )
    assert picture.shape == (45 + 32, 300, 3)
    stages = [picture[:45, 60 * k : 60 * k + 60] for k in range(5)]
    for before, after in pairwise(stages):
        assert (np.abs(before - after).max(axis=-1) > 20).mean() > 0.01
    # Shadows only darken; mirrored rays add light.
    assert stages[2].sum() < stages[1].sum()
    assert stages[3].sum() > stages[2].sum()
