"""The ColorChecker under D65, rendered by wavelength, against the colours that its spectra integrate to."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

import sightray as sr

ROOT = Path(__file__).parents[2]
CELL = 10  # pixels along a field


@pytest.fixture(scope="module")
def expected():
    """Linear colours and bytes of the fields under D65, (24, 3) each, as computed elsewhere."""
    with open(ROOT / "tests" / "spectra" / "colorchecker_expected.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    channels = ("red", "green", "blue")
    return (
        np.array([[float(row[c]) for c in channels] for row in rows]),
        np.array([[float(row[f"byte {c}"]) for c in channels] for row in rows]),
    )


@pytest.fixture(scope="module")
def scene():
    scene = sr.load(ROOT / "examples" / "gallery" / "colorchecker.yaml")
    return scene.replace(camera=scene.camera.replace(width=6 * CELL, height=4 * CELL, view_height=4))


def fields_of(picture):
    """Pixels of each field without its rim, (24, n, 3): row by row from the top left."""
    cells = np.asarray(picture, float).reshape(4, CELL, 6, CELL, 3).swapaxes(1, 2)
    return cells[:, :, 2:-2, 2:-2].reshape(24, -1, 3)


def encoded(linear):
    linear = np.clip(linear, 0.0, 1.0)
    return 255 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def test_every_field_has_its_expected_colour(scene, expected):
    """Within the noise of 16 renders in linear light, cyan's negative red included; and to one step of a byte."""
    found = np.array([fields_of(sr.render(scene, samples=64, seed=seed)).mean(axis=1) for seed in range(16)])
    mean, error = found.mean(axis=0), found.std(axis=0, ddof=1) / 4
    linear, bytes_ = expected
    assert error.max() < 1e-3
    assert (np.abs(mean - linear) < 4.5 * error + 1e-4).all()
    assert np.abs(encoded(mean) - bytes_).max() < 1.0


def test_rgb_mode_shows_the_same_colours_within_the_gamut(scene, expected):
    """Noise is the same in all three channels there, so the proportions are exact."""
    found = fields_of(sr.render(scene, scene.integrator.replace(spectral=False), samples=64)).mean(axis=1)
    linear = np.maximum(expected[0], 0.0)
    np.testing.assert_allclose(found, linear, rtol=0.02, atol=1e-6)
    np.testing.assert_allclose(
        found / found.sum(axis=1, keepdims=True), linear / linear.sum(axis=1, keepdims=True), atol=2e-4
    )
