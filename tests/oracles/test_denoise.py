"""Denoising: what the denoiser is given, what comes back, and what is said where it is not installed."""

from __future__ import annotations

import sys
import types

import numpy as np
import pytest

import sightray as sr
from sightray.engine.denoise import guides
from sightray.scene.compile import compile_scene
from sightray.scenes import build


def balls():
    camera = sr.OrthographicCamera(eye=(0, 0, 5), target=(0, 0, 0), view_height=4, width=40, height=40)
    return sr.Scene(
        sr.Sphere(radius=1.5, material=sr.Lambert(albedo=(0.2, 0.4, 0.6))), sr.PointLight(position=(3, 3, 5), intensity=40),
        camera=camera, background=(0.1, 2.0, 0.3),
    )  # fmt: skip


def test_guides_are_first_colours_and_normals():
    """On a sphere seen along z the normal is (x, y, z) / r; behind it there is the background, at most white."""
    albedo, normal = guides(compile_scene(balls()), sr.SobolSampler(), sr.BoxFilter(), seed=0, threads=None)
    np.testing.assert_allclose(albedo.pixels[20, 20], (0.2, 0.4, 0.6), rtol=1e-6)
    np.testing.assert_allclose(albedo.pixels[0, 0], (0.1, 1.0, 0.3), rtol=1e-6)
    assert (normal.pixels[0, 0] == 0).all()
    x, y = (np.arange(40) + 0.5) / 10 - 2, 2 - (np.arange(40) + 0.5) / 10
    for row, column in ((20, 20), (12, 25), (28, 14)):
        n = np.array([x[column], y[row], np.sqrt(2.25 - x[column] ** 2 - y[row] ** 2)]) / 1.5
        np.testing.assert_allclose(normal.pixels[row, column], n, atol=0.01)


@pytest.fixture
def fake(monkeypatch):
    """A stand-in for the denoiser that notes what it was given, and halves the picture."""
    calls = []

    def denoise(color, **options):
        calls.append((color, options))
        return color * np.float32(0.5)

    monkeypatch.setitem(sys.modules, "pyoidn", types.SimpleNamespace(denoise=denoise))
    return calls


def test_rendering_gives_picture_and_guides_to_the_denoiser(fake):
    plain = sr.render(balls(), samples=4)
    image = sr.render(balls(), samples=4, denoise=True)
    ((color, options),) = fake
    assert (color == np.asarray(plain)).all()
    assert options.pop("hdr") is True
    assert sorted(options) == ["albedo", "normal"]
    assert all(guide.shape == (40, 40, 3) and guide.dtype == np.float32 for guide in options.values())
    assert (np.asarray(image) == np.asarray(plain) * 0.5).all()
    assert image.info["denoised"]
    assert (image.info["sample_count"] == 4).all()


def test_alone_and_with_guides(fake):
    image = sr.Image(np.full((3, 4, 4), 0.5, np.float32), transfer="floor")
    found = sr.denoise(image, albedo=np.ones((3, 4)))
    assert found.transfer == "floor"
    assert found.channels == 3
    assert fake[0][1]["albedo"].shape == (3, 4, 3)
    assert "normal" not in fake[0][1]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"albedo": np.ones((3, 5, 3))}, "albedo: got 5x3 pixels; allowed: 4x3"),
        ({"normal": np.ones((3, 4, 3))}, "albedo: missing"),
        ({"albedo": np.full((3, 4, 3), np.nan)}, "albedo: got values that are not finite"),
    ],
)
def test_bad_guides(options, message, fake):
    with pytest.raises(sr.SceneError, match=message):
        sr.denoise(sr.Image(np.ones((3, 4, 3))), **options)


def test_without_the_package_it_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    with pytest.raises(sr.UnsupportedError, match=r"pip install sightray\[denoise\]"):
        sr.render(balls(), samples=1 << 20, denoise=True)  # said before rendering


@pytest.mark.peers
def test_noise_goes_and_the_picture_stays():
    """With the real denoiser: the error against a converged picture falls by more than a third; the rest is at edges."""
    scene = build("cornell")
    scene = scene.replace(camera=scene.camera.resized(96, 96))
    exact = np.asarray(sr.render(scene, sr.PathTracer(), samples=1024))
    noisy = sr.render(scene, sr.PathTracer(), samples=8)
    clean = sr.render(scene, sr.PathTracer(), samples=8, denoise=True)
    before, after = (np.abs(np.asarray(image) - exact).mean() for image in (noisy, clean))
    assert after < 0.65 * before
