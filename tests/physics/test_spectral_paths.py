"""Paths that follow wavelengths: grey stays grey, one reflection is the RGB colour, and white light is white."""

from __future__ import annotations

import numpy as np
import pytest

import sightray as sr

TINY = {"width": 8, "height": 8}
TRACER = sr.PathTracer(max_depth=100, spectral=True)


def mean_and_error(scene, integrator, samples):
    """Mean colour of the picture, (3,), and its standard error from 16 independent renders."""
    means = [np.asarray(sr.render(scene, integrator, samples=samples, seed=k)).mean((0, 1)) for k in range(16)]
    return np.mean(means, axis=0), np.std(means, axis=0, ddof=1) / 4


def looking_at(*objects, **options):
    camera = sr.PerspectiveCamera(eye=(0, 0, 4), target=(0, 0, 0), vfov=20, **TINY)
    return sr.Scene(*objects, camera=camera, **options)


@pytest.mark.parametrize("background", [(1.0, 1.0, 1.0), (0.2, 0.7, 0.4), (3.0, 0.1, 0.0)])
def test_light_keeps_its_colour(background):
    """The up-sampled spectrum of a light has the colour that it came from."""
    scene = looking_at(sr.Sphere(center=(0, 50, 0)), background=background)
    mean, error = mean_and_error(scene, TRACER, 64)
    assert (np.abs(mean - background) < 4.5 * error + 1e-6).all()


def test_a_path_sees_four_wavelengths():
    """White light varies from path to path by 0.24 in all three channels (spectra/sampling.py); one alone by 14.5."""
    scene = looking_at(sr.Sphere(center=(0, 50, 0)), background=1.0)
    picture = np.asarray(sr.render(scene, TRACER, samples=64, sampler=sr.IndependentSampler()), float)
    assert 0.5 * 0.24 < 64 * picture.var(axis=(0, 1)).sum() < 2 * 0.24


@pytest.mark.parametrize("albedo", [(0.5, 0.5, 0.5), (0.9, 0.2, 0.1), (0.1, 0.3, 0.8)])
def test_one_reflection_is_the_rgb_colour(albedo):
    """A convex body in white light sends every colour back as it was stated: D65 times the reflectance."""
    scene = looking_at(sr.Sphere(radius=3, material=sr.Lambert(albedo=albedo)), background=1.0)
    mean, error = mean_and_error(scene, TRACER, 64)
    assert (np.abs(mean - albedo) < 4.5 * error + 1e-6).all()


def test_spectral_is_rgb_on_grey_scenes():
    box = sr.Box(lower=(-1, -1, -1), upper=(1, 1, 1), material=sr.Lambert(albedo=0.6))
    lamp = sr.RectangleLight(corner=(-0.5, 0.99, -0.5), edge_u=(1, 0, 0), edge_v=(0, 0, 1), radiance=3)
    camera = sr.PerspectiveCamera(eye=(0, 0, 0.9), target=(0, 0, -1), vfov=60, **TINY)
    scene = sr.Scene(box, lamp, camera=camera)
    rgb, rgb_error = mean_and_error(scene, sr.PathTracer(max_depth=6), 64)
    lanes, error = mean_and_error(scene, sr.PathTracer(max_depth=6, spectral=True), 64)
    assert (np.abs(rgb - lanes) < 4.5 * np.hypot(error, rgb_error)).all()


def test_closed_furnace_by_wavelength():
    """Emission 1 and reflectance 1/2 everywhere: radiance 2 in every channel."""
    camera = sr.PerspectiveCamera(eye=(0.3, -0.2, 0.1), target=(0, 1, 0.5), up=(0, 0, 1), vfov=70, **TINY)
    scene = sr.Scene(sr.Sphere(material=sr.Lambert(albedo=0.5, emission=1)), camera=camera)
    mean, error = mean_and_error(scene, TRACER, 64)
    assert (np.abs(mean - 2) < 4.5 * error).all()


def test_absorption_by_wavelength():
    """What stained glass leaves of white light is, for a thin layer, as stated in RGB."""
    scene = looking_at(
        sr.Sphere(radius=9, material=sr.Lambert(albedo=0, emission=1)),
        background=0, medium=sr.HomogeneousMedium(absorption=(1e-3, 2e-3, 3e-3)),
    )  # fmt: skip
    mean, error = mean_and_error(scene, TRACER, 256)
    expected = np.exp(-np.array([1e-3, 2e-3, 3e-3]) * 13)  # from z = 4 to z = -9
    assert (np.abs(mean - expected) < 4.5 * error + 1e-3).all()
