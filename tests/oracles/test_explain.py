"""`explain`: its numbers are the picture's."""

from __future__ import annotations

import re

import numpy as np
import pytest

import sightray as sr
from sightray.scenes import build


@pytest.fixture(scope="module")
def scene():
    scene = build("whitted")
    return scene.replace(camera=scene.camera.resized(64, 48))


def test_sum_is_the_pixel(scene):
    image = np.asarray(sr.render(scene, samples=1))
    rng = np.random.default_rng(3)
    for column, row in rng.integers((0, 0), (64, 48), (25, 2)).tolist():
        told = sr.explain(scene, pixel=(column, row))
        np.testing.assert_allclose(told.color, image[row, column], rtol=1e-5, atol=1e-7)


def _numbers(text):
    return np.array([float(part) for part in text.split(",")])


def test_terms_add_up_to_the_sum(scene):
    """Read the printed text as a person would: weight times terms, ray by ray."""
    told = sr.explain(scene, pixel=(24, 20))
    assert told.text.count("refracted ray") >= 2
    assert told.text.count("mirrored ray") >= 1
    total, weight = np.zeros(3), np.ones(3)
    for line in told.text.splitlines():
        if found := re.search(r"weight \((.*)\)", line):
            weight = _numbers(found[1])
        elif found := re.match(r"\s*(?:meets nothing: )?(emission|ambient|lights together|background) \((.*)\)", line):
            total += weight * _numbers(found[2])
    np.testing.assert_allclose(total, told.color, rtol=2e-3, atol=1e-4)


def test_pixels_outside_are_refused(scene):
    with pytest.raises(sr.SceneError, match=r"pixel: got \(64, 0\); allowed: columns 0 to 63, rows 0 to 47"):
        sr.explain(scene, pixel=(64, 0))
    with pytest.raises(sr.SceneError, match="two whole numbers"):
        sr.explain(scene, pixel="middle")
