"""Lights whose spectrum is stated, in spectral mode: what they fall on has the colour that its spectrum integrates to."""

from __future__ import annotations

import numpy as np
import pytest

import sightray as sr
from sightray import spectra

FIELDS = spectra.colorchecker()
SEEDS = range(12)
LAMPS = ["D65", "A", "FL2", 3000.0, 12000.0]


def white_of(spectrum):
    return spectra.illuminant(spectrum) if isinstance(spectrum, str) else spectra.blackbody(spectrum)


def seen(material, *lamps, samples=64, **options):
    """Mean colour of a wall at z = 0 that faces the viewer, (3,), and its standard error."""
    wall = sr.Rectangle(corner=(-1, -1, 0), edge_u=(2, 0, 0), edge_v=(0, 2, 0), material=material)
    camera = sr.PerspectiveCamera(eye=(0, 0, 3), target=(0, 0, 0), vfov=10, width=8, height=8)
    scene = sr.Scene(wall, *lamps, camera=camera, **options)
    tracer = sr.PathTracer(max_depth=2, spectral=True)
    means = [np.asarray(sr.render(scene, tracer, samples=samples, seed=k), float).mean((0, 1)) for k in SEEDS]
    return np.mean(means, axis=0), np.std(means, axis=0, ddof=1) / np.sqrt(len(SEEDS))


@pytest.mark.parametrize("spectrum", LAMPS)
def test_a_grey_card_has_the_colour_of_the_light_and_can_be_balanced(spectrum):
    card = sr.SpectralColor(wavelengths=[400, 700], reflectances=[0.18, 0.18])
    mean, error = seen(sr.Lambert(albedo=card), sr.EnvironmentLight(radiance=2, spectrum=spectrum))
    white = white_of(spectrum).normalised().rgb()
    assert (np.abs(mean - 2 * 0.18 * white) < 4.5 * error + 1e-3).all()
    np.testing.assert_allclose(mean / (2 * white), 0.18, rtol=0.03)


@pytest.mark.parametrize("name", ["red", "cyan", "foliage", "blue"])
@pytest.mark.parametrize("spectrum", ["A", "FL2"])
def test_measured_colours_under_measured_light(name, spectrum):
    """The spectra's product, which RGB does not know: colours that are the same under daylight part here."""
    sky = sr.EnvironmentLight(spectrum=spectrum)
    mean, error = seen(sr.Lambert(albedo=sr.SpectralColor.of(FIELDS[name])), sky)
    assert (np.abs(mean - FIELDS[name].rgb(spectrum)) < 4.5 * error + 1e-3).all()


def test_up_sampled_light_of_the_same_colour_shows_other_colours():
    warm = spectra.illuminant("A").normalised().rgb()
    mean, error = seen(
        sr.Lambert(albedo=sr.SpectralColor.of(FIELDS["cyan"])), sr.EnvironmentLight(radiance=tuple(warm))
    )
    assert np.abs(mean - FIELDS["cyan"].rgb("A")).max() > 10 * error.max()


LIGHTS = {
    "point": sr.PointLight(position=(0, 0, 2), intensity=4, spectrum=2500),
    "spot": sr.SpotLight(position=(0, 0, 2), target=(0, 0, 0), angle=90, intensity=4, spectrum=2500),
    "directional": sr.DirectionalLight(direction=(0, 0, -1), irradiance=3, spectrum=2500),
    "rectangle": sr.RectangleLight(corner=(2, -1, 1), edge_u=(0, 0, 2), edge_v=(0, 2, 0), radiance=3, two_sided=True,
                                   spectrum=2500),
    "disk": sr.DiskLight(center=(2, 0, 2), normal=(-1, 0, -1), radius=1, radiance=3, spectrum=2500),
    "sphere": sr.SphereLight(center=(2, 0, 2), radius=0.7, radiance=3, spectrum=2500),
    "mesh": sr.Mesh(vertices=[[2, -1, 1], [2, 1, 1], [2, 0, 3]], faces=[[0, 1, 2]],
                    material=sr.Emitter(radiance=3, two_sided=True, spectrum=2500)),
    "ball": sr.Sphere(center=(2, 0, 2), radius=0.7, material=sr.Emitter(radiance=3, spectrum=2500)),
}  # fmt: skip


@pytest.mark.parametrize("light", LIGHTS.values(), ids=LIGHTS)
def test_every_light_keeps_its_spectrum(light):
    """Red, green and blue of a field are in the ratio that they have under that light."""
    mean, error = seen(sr.Lambert(albedo=sr.SpectralColor.of(FIELDS["orange"])), light, samples=128)
    expected = FIELDS["orange"].rgb(spectra.blackbody(2500))
    k = mean[1] / expected[1]
    assert mean.sum() > 0.01
    assert (np.abs(mean - k * expected) < 4.5 * (error + error[1] * expected / expected[1]) + 2e-3 * k).all()


PANEL = {"corner": (-9, -9, 4), "edge_u": (0, 18, 0), "edge_v": (18, 0, 0)}  # behind the viewer


@pytest.mark.parametrize("lamp", [
    sr.RectangleLight(radiance=2, spectrum="A", **PANEL),
    sr.Rectangle(material=sr.Emitter(radiance=2, spectrum="A"), **PANEL),
    sr.EnvironmentLight(radiance=2, spectrum="A"),
], ids=["light", "emitter", "sky"])  # fmt: skip
def test_lamps_that_are_seen_in_a_mirror_have_their_spectrum(lamp):
    """A coloured mirror, so that light of the same colour and another spectrum would show."""
    mean, error = seen(sr.Mirror(reflectance=sr.SpectralColor.of(FIELDS["cyan"])), lamp)
    assert (np.abs(mean - 2 * FIELDS["cyan"].rgb("A")) < 4.5 * error + 1e-3).all()
    assert error.max() < 0.01


@pytest.mark.parametrize("spectrum", ["A", 3000.0])
def test_rgb_mode_sees_the_colour_of_the_light(spectrum):
    white = white_of(spectrum).normalised().rgb()
    sun = sr.DirectionalLight(direction=(0, 0, -1), spectrum=spectrum)
    camera = sr.PerspectiveCamera(eye=(0, 0, 4), target=(0, 0, 0), vfov=1, width=2, height=2)
    scene = sr.Scene(sr.Sphere(material=sr.Lambert(albedo=0.5)), sun, camera=camera)
    picture = np.asarray(sr.render(scene, sr.DirectLighting(), samples=4), float)
    np.testing.assert_allclose(picture[0, 0] / picture[0, 0, 1], white / white[1], rtol=1e-5)
