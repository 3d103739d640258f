"""Spectra of lights: how they are stated, what RGB mode sees of them, and what kernels read by wavelength."""

from __future__ import annotations

import numpy as np
import pytest

import sightray as sr
from sightray import spectra
from sightray._jit import kernel, native
from sightray.errors import SceneError
from sightray.lights.base import illuminate, light_in
from sightray.lights.daylight import daylight_rows
from sightray.materials.base import emitted, glow_in
from sightray.mathlib.bands import BANDS_WORDS, BLUE, GREEN, RED, WAVELENGTHS, WHITE
from sightray.mathlib.table import Table, vec3_put
from sightray.mathlib.vec import Vec3
from sightray.scene.compile import Tables
from sightray.spectra.lighting import light_rows, shown_colour, white_of
from sightray.textures.base import anywhere

NM = np.array([431.0, 500.0, 555.0, 647.0])
WAYS = {"name": "A", "kelvin": 3200.0, "spectrum": spectra.Spectrum([400, 500, 700], [0.2, 3, 1]), "none": None}
STATED = [pytest.param(way, id=name) for name, way in WAYS.items()]


def bands():
    """What a path carries that sees `NM`."""
    out, rows = np.zeros(BANDS_WORDS), spectra.band_table()[(NM - 360).astype(int)]
    out[WAVELENGTHS : WAVELENGTHS + 4] = NM
    for word, column in ((RED, 0), (GREEN, 1), (BLUE, 2), (WHITE, 3)):
        out[word : word + 4] = rows[:, column]
    return out


@kernel
def ask_light(light: Table, bands: Table, out: Table) -> None:
    sample = illuminate(light, Vec3(0.0, 0.0, 0.0), 0, 0.5, 0.5)
    vec3_put(out, 0, sample.irradiance)
    vec3_put(out, 4, light_in(bands, light, sample.irradiance))


@kernel
def ask_material(material: Table, bands: Table, out: Table) -> None:
    glow = emitted(material, anywhere(0.5, 0.5, Vec3(0.0, 0.0, 0.0)), 1.0)
    vec3_put(out, 0, glow)
    vec3_put(out, 4, glow_in(bands, material, glow))


def answers(ask, member):
    """What arrives in RGB, (3,), and at `NM`, (4,)."""
    tables, out = Tables(), np.zeros(8)
    row = tables.row_of(member)
    tables.prepare(ask)
    native(ask)(row, Table(bands()), Table(out))
    return out[:3], out[4:]


@pytest.mark.parametrize("stated", STATED)
@pytest.mark.parametrize("colour", [(1, 1, 1), (0.9, 0.3, 0.1)])
def test_lights_arrive_in_their_colour_and_at_their_wavelengths(stated, colour):
    """Two metres away, a quarter: of the spectrum at luminance 1, behind the colour as a filter."""
    expected = spectra.reflectance(colour) * white_of(stated) / 4
    rgb, lanes = answers(ask_light, sr.PointLight(position=(0, 0, 2), intensity=colour, spectrum=stated))
    np.testing.assert_allclose(rgb, np.maximum(expected.rgb(), 0), atol=1e-9)
    np.testing.assert_allclose(lanes, expected.at(NM), rtol=1e-9)


@pytest.mark.parametrize("stated", STATED)
def test_surfaces_glow_in_their_colour_and_at_their_wavelengths(stated):
    expected = white_of(stated) * 3
    lamp, paint = sr.Emitter(radiance=3, spectrum=stated), sr.Lambert(albedo=0.5)
    brighter = lamp.replace(radiance=6)
    for material in (lamp, sr.NormalMap(material=lamp, map=0.5), sr.Mix(a=brighter, b=paint), sr.Mix(a=paint, b=brighter),
                     sr.TwoSided(material=lamp), sr.TwoSided(material=lamp, back=paint), sr.Emitter(
                         radiance=sr.Checker(even=3, odd=0), spectrum=stated)):  # fmt: skip
        rgb, lanes = answers(ask_material, material)
        np.testing.assert_allclose(rgb, np.maximum(expected.rgb(), 0), atol=1e-9)
        np.testing.assert_allclose(lanes, expected.at(NM), rtol=1e-9)


def test_two_lamps_in_one_surface_keep_their_colour():
    """There is no telling their light apart, so it is up-sampled: what is seen of it in RGB is right."""
    cold, warm = sr.Emitter(radiance=(1, 2, 3)), sr.Emitter(radiance=3, spectrum=2500)
    for material in (sr.Mix(a=cold, b=warm), sr.TwoSided(material=cold, back=warm)):
        rgb, lanes = answers(ask_material, material)
        np.testing.assert_allclose(lanes, spectra.emission(rgb).at(NM), rtol=1e-9)


@pytest.mark.parametrize("stated", STATED)
def test_a_projector_throws_its_own_spectrum(stated):
    """A filter before the lamp; of a coloured picture its luminance counts where a spectrum is stated."""
    light = sr.ProjectorLight(image=np.full((2, 2, 3), (0.2, 0.4, 0.6)), eye=(0, 0, 2), intensity=(3, 2, 1), spectrum=stated)
    pixel = (0.2, 0.4, 0.6) if stated is None else [0.2 * 0.2126 + 0.4 * 0.7152 + 0.6 * 0.0722] * 3
    shown = shown_colour((3, 2, 1), stated)
    rgb, lanes = answers(ask_light, light)
    np.testing.assert_allclose(rgb, shown * pixel / 4, rtol=1e-6)
    if stated is None:
        expected = spectra.emission(rgb)
    else:
        expected = spectra.reflectance((3, 2, 1)) * white_of(stated) * (pixel[0] / 4)
    np.testing.assert_allclose(lanes, expected.at(NM), rtol=1e-6)


@pytest.mark.parametrize("kelvin", [5000, 6504, 12000])
def test_sun_and_sky_are_phases_of_daylight(kelvin):
    """Light of the colour of a phase of daylight has the spectrum of that phase."""
    phase = spectra.daylight(kelvin).normalised()
    np.testing.assert_allclose(daylight_rows() @ phase.rgb(), phase.at(spectra.WAVELENGTHS), atol=2e-4)


@pytest.mark.parametrize("elevation", [5, 40, 80])
def test_sky_by_wavelength_has_the_colour_that_rgb_mode_sees(elevation):
    """A mean over wavelengths, of sun and sky."""
    e = np.radians(elevation)
    light = sr.SunSky(direction=(np.cos(e), np.sin(e), 0), turbidity=3)
    tables, out = Tables(), np.zeros(8)
    row = tables.row_of(light)
    tables.prepare(ask_light)
    found = np.zeros(3)
    for nm in np.arange(362, 830, 4):
        path = bands()
        path[WAVELENGTHS : WAVELENGTHS + 4] = nm - 1.5 + np.arange(4)
        native(ask_light)(row, Table(path), Table(out))
        expected = np.maximum(daylight_rows()[(path[WAVELENGTHS : WAVELENGTHS + 4] - 359.5).astype(int)] @ out[:3], 0)
        np.testing.assert_allclose(out[4:], expected, rtol=1e-6, atol=1e-9)
        rows = spectra.band_table()[(path[WAVELENGTHS : WAVELENGTHS + 4] - 359.5).astype(int)]
        found += out[4:] @ rows[:, 4:7]
    np.testing.assert_allclose(found, out[:3], rtol=2e-3, atol=2e-3 * out[:3].max())


def test_an_environment_with_a_spectrum_takes_brightness_from_its_picture():
    picture = np.array([[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]])
    pixels = sr.EnvironmentLight(image=picture, spectrum="A").pixels
    np.testing.assert_allclose(pixels, [[[0.2126] * 3, [0.7152] * 3]], rtol=1e-6)
    np.testing.assert_allclose(sr.EnvironmentLight(image=picture).pixels, picture)


@pytest.mark.parametrize("stated", STATED)
def test_yaml_keeps_the_spectrum(stated, tmp_path):
    scene = sr.Scene(sr.PointLight(position=(0, 0, 2), spectrum=stated))
    sr.save(scene, tmp_path / "s.yaml")
    (light,) = sr.load(tmp_path / "s.yaml").objects
    assert light.spectrum == stated


def test_daylight_is_white():
    """The default, said aloud; and no light at all."""
    np.testing.assert_allclose(shown_colour((2, 2, 2), "D65"), 2, rtol=1e-12)
    np.testing.assert_allclose(light_rows((2, 2, 2), "D65"), spectra.band_table()[:, 3] / 3, rtol=1e-12)
    assert light_rows((1, 1, 1), None) is None
    assert not light_rows((0, 0, 0), "A").any()


@pytest.mark.parametrize(("stated", "message"), [
    ("D56", r"PointLight\.spectrum: unknown illuminant 'D56'; did you mean 'D55'\?|did you mean"),
    (-3, r"PointLight\.spectrum: blackbody: kelvin -3\.0; allowed: above 0"),
    (True, r"PointLight\.spectrum: got True; allowed: A, D50"),
    (spectra.Spectrum([400, 500, 600], [-1, 5, 5]), r"PointLight\.spectrum: got .* negative at some wavelength"),
    (spectra.Spectrum([400, 500], [0, 0]), r"PointLight\.spectrum: .*luminance is 0; allowed: above 0"),
])  # fmt: skip
def test_errors_say_where_what_and_what_is_allowed(stated, message):
    with pytest.raises(SceneError, match=message):
        sr.PointLight(position=(0, 0, 2), spectrum=stated)
