"""From spectra to colours: the CIE's observer and illuminants, Rec. 709, the ColorChecker."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

import sightray as sr
from sightray import spectra
from sightray.images.transfer import srgb_encode
from sightray.spectra import WAVELENGTHS, Spectrum
from sightray.spectra.tables import rows_of

EXPECTED = Path(__file__).with_name("colorchecker_expected.csv")  # computed by others from the same measurements


def colorchecker_rows():
    with EXPECTED.open(newline="") as file:
        for name, *numbers in list(csv.reader(file))[1:]:
            yield pytest.param(name, np.array(numbers, dtype=float), id=name)


def test_cie_observer_sums():
    observer = rows_of("observer")
    assert observer[:, 0].tolist() == WAVELENGTHS.tolist()
    np.testing.assert_allclose(observer[:, 1:].sum(axis=0), [106.865469489595, 106.856917101172, 106.892251278636])
    assert WAVELENGTHS[spectra.xyz_bar()[:, 1].argmax()] == 555


@pytest.mark.parametrize(
    ("name", "xy"), [("D65", (0.31271106772, 0.32900848408)), ("A", (0.44757143345, 0.40744043259))]
)
def test_cie_chromaticities_summed_every_5_nm(name, xy):
    nm = np.arange(360.0, 781.0, 5.0)
    observer = rows_of("observer")
    sums = spectra.illuminant(name).at(nm) @ observer[np.searchsorted(observer[:, 0], nm), 1:]
    np.testing.assert_allclose(sums[:2] / sums.sum(), xy, atol=5e-7)


@pytest.mark.parametrize(("name", "xy"), [
    ("A", (0.44758, 0.40745)),
    ("D50", (0.34567, 0.35851)),
    ("D55", (0.33243, 0.34744)),
    ("D65", (0.31272, 0.32903)),
    ("D75", (0.29903, 0.31488)),
    ("E", (1 / 3, 1 / 3)),
    ("FL2", (0.37208, 0.37529)),
])  # fmt: skip
def test_cie_15_illuminants(name, xy):
    np.testing.assert_allclose(spectra.illuminant(name).xy(), xy, atol=5e-5)
    assert name == "FL2" or float(spectra.illuminant(name).at(560)) == pytest.approx(100, rel=1e-12)
    assert spectra.illuminant(name).normalised().xyz()[1] == pytest.approx(1.0, abs=1e-14)


def test_d65_is_the_daylight_of_6504_kelvin():
    d65 = spectra.illuminant("D65")
    np.testing.assert_allclose(spectra.daylight(6504).at(d65.wavelengths), d65.values, atol=0.05)
    # Beyond the packaged source table, against CIE 15.
    assert d65.at([785, 790, 800, 830]).tolist() == [63.8434, 64.304, 59.4519, 60.3125]


@pytest.mark.parametrize("kelvin", [4000, 7000, 25000])
def test_daylight_passes_smoothly_and_reddens(kelvin):
    below, above = (spectra.daylight(k).xy() for k in (max(4000, kelvin - 1), min(25000, kelvin + 1)))
    assert np.abs(below - above).max() < 1e-4
    blue = [spectra.daylight(k).normalised().rgb()[2] for k in (4000, 5000, 6504, 10000, 25000)]
    assert np.all(np.diff(blue) > 0)


@pytest.mark.parametrize(
    ("kelvin", "xy"), [(1000, (0.6528, 0.3444)), (2856, (0.4475, 0.4075)), (6500, (0.3135, 0.3236))]
)
def test_planckian_locus(kelvin, xy):
    np.testing.assert_allclose(spectra.blackbody(kelvin).xy(), xy, atol=2e-4)


def test_blackbody_radiance_defined_the_candela_until_1979():
    """At the freezing point of platinum a black body had 600,000 cd/m², with 683 lm/W to within a per cent or so."""
    luminance = 683.0 * spectra.blackbody(2042.0).at(WAVELENGTHS) @ rows_of("observer")[:, 2]
    assert luminance == pytest.approx(6e5, rel=0.01)


def test_blackbody_peaks_where_wien_says():
    assert WAVELENGTHS[spectra.blackbody(5000).values.argmax()] == round(2.897771955e6 / 5000)
    assert spectra.blackbody(1e-3).values.max() == 0.0


@pytest.mark.parametrize(("call", "message"), [
    (lambda: spectra.illuminant("D66"), "did you mean 'D65'"),
    (lambda: spectra.daylight(3000), "4000 to 25000"),
    (lambda: spectra.blackbody(0), "above 0"),
    (lambda: spectra.blackbody(np.nan), "above 0"),
    (lambda: Spectrum.constant(0.0).normalised(), "luminance is 0"),
    (lambda: Spectrum.constant(0.5).rgb("d65"), "unknown illuminant"),
])  # fmt: skip
def test_bad_lights(call, message):
    with pytest.raises(sr.SceneError, match=message):
        call()


def test_white_is_white():
    np.testing.assert_allclose(spectra.white() @ spectra.rgb_bar(), 1.0, atol=1e-14)
    np.testing.assert_allclose(spectra.illuminant("D65").normalised().rgb(), 1.0, atol=1e-14)
    np.testing.assert_allclose(Spectrum.constant(0.18).rgb("D65"), 0.18, atol=1e-14)
    assert Spectrum.constant(1.0).xyz()[1] == pytest.approx(1.0, abs=1e-14)


def test_matrix_is_srgb_to_the_digits_that_its_white_is_given_in():
    published = [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]  # IEC 61966-2-1
    np.testing.assert_allclose(spectra.rgb_from_xyz(), published, atol=4e-4)
    np.testing.assert_allclose(spectra.rgb_from_xyz() @ spectra.xyz_from_rgb(), np.eye(3), atol=1e-14)
    for column, xy in zip(spectra.xyz_from_rgb().T, [(0.64, 0.33), (0.3, 0.6), (0.15, 0.06)], strict=True):
        np.testing.assert_allclose(column[:2] / column.sum(), xy, atol=1e-14)


@pytest.mark.parametrize(("field", "expected"), list(colorchecker_rows()))
def test_colorchecker(field, expected):
    reflectance = spectra.colorchecker()[field]
    assert 0 < reflectance.values.min() < reflectance.values.max() < 1
    np.testing.assert_allclose(reflectance.xyz("D65"), expected[:3], atol=5e-5)
    rgb = reflectance.rgb("D65")
    np.testing.assert_allclose(rgb, expected[3:6], atol=3e-4)  # the published matrix has four digits
    np.testing.assert_allclose(255 * srgb_encode(np.clip(rgb, 0, 1)), expected[6:], atol=0.75)


def test_colorchecker_is_whole_and_in_order():
    names = list(spectra.colorchecker())
    assert len(names) == 24
    assert (names[0], names[14], names[-1]) == ("dark skin", "red", "black 2 (1.5 D)")
    raw = rows_of("colorchecker")
    np.testing.assert_allclose(spectra.colorchecker()["red"].at(raw[:, 0]), raw[:, 15], atol=1e-14)
