"""Refractive indices against catalogues, and metals against their reflectances."""

from __future__ import annotations

import numpy as np
import pytest

import sightray as sr
from sightray import spectra
from sightray.spectra import ComplexIndex, RefractiveIndex, Spectrum, complex_index, refractive_index
from sightray.spectra.conductors import normal_reflectance

GLASSES = [  # index at the d line and Abbe number, as their makers state them
    ("N-BK7", 1.51680, 64.17),
    ("N-SF10", 1.72828, 28.53),
    ("SF10", 1.72825, 28.41),
    ("N-SF11", 1.78472, 25.68),
    ("F2", 1.62004, 36.37),
    ("N-F2", 1.62005, 36.43),
    ("N-LAK22", 1.65113, 55.89),
    ("BK7G18", 1.51975, 63.58),
    ("P-BK7", 1.51640, 64.06),
    ("J-BK7", 1.51680, 63.880667),
    ("J-BK7A", 1.51680, 64.12995),
    ("J-SF10", 1.72825, 28.378835),
    ("E-BK7", 1.51680, 64.108694),
    ("E-SF10", 1.72825, 28.459666),
    ("SF10-Hikari", 1.72825, 28.34699),
    ("K-BK7", 1.51633, 64.1),
    ("diamond", 2.41749, 55.30),
    ("fused silica", 1.45846, 67.82),
]


@pytest.mark.parametrize(("name", "index", "abbe"), GLASSES)
def test_catalogue(name, index, abbe):
    glass = refractive_index(name)
    assert glass.index == pytest.approx(index, abs=6e-6)
    assert glass.abbe == pytest.approx(abbe, abs=0.05 if name == "K-BK7" else 0.006)
    assert glass.reference


@pytest.mark.parametrize(("name", "nm", "index", "within"), [
    ("water", 589.29, 1.33336, 1e-4),  # IAPWS, 20 °C
    ("sapphire", 587.6, 1.7682, 1e-4),
    ("fused silica", 404.66, 1.46962, 1e-5),  # Malitson's own table
    ("fused silica", 706.52, 1.45515, 1e-5),
    ("N-BK7", 404.66, 1.53024, 1e-5),  # Schott's data sheet: h and r lines
    ("N-BK7", 706.52, 1.51289, 1e-5),
    ("BK7 matching liquid", 589.3, 1.5167, 2e-4),
    ("water-Hale", 500.0, 1.335, 1e-9),
])  # fmt: skip
def test_indices_at_other_lines(name, nm, index, within):
    assert float(refractive_index(name).at(nm)) == pytest.approx(index, abs=within)


def test_every_clear_material_covers_what_is_visible():
    nm = spectra.WAVELENGTHS
    for name in spectra.index_names():
        n = refractive_index(name).at(nm)
        assert n.shape == nm.shape
        assert (n > 1.3).all(), name
        assert (np.diff(n) <= 0).all(), name  # clear materials bend blue more
        assert (refractive_index(name).absorption(nm) >= 0).all()


def test_formulas_of_cauchy_and_abbe():
    cauchy = RefractiveIndex.cauchy(1.5, 0.004, 0.0001)
    assert float(cauchy.at(500)) == pytest.approx(1.5 + 0.004 / 0.25 + 0.0001 / 0.0625, rel=1e-15)
    glass = RefractiveIndex.from_abbe(1.7, 35.0)
    assert (glass.index, glass.abbe) == pytest.approx((1.7, 35.0), rel=1e-12)
    for bad in ((0.9, 30), (1.5, 0), (1.5, -1)):
        with pytest.raises(sr.SceneError, match="above 1"):
            RefractiveIndex.from_abbe(*bad)
    with pytest.raises(sr.SceneError, match="no index at 105"):
        refractive_index("diamond").at(105)


def test_absorption_is_in_metres():
    assert float(refractive_index("N-BK7").absorption(500)) == pytest.approx(4 * np.pi * 9.5781e-9 / 500e-9)
    assert float(refractive_index("diamond").absorption(500)) == 0.0


@pytest.mark.parametrize(("call", "message"), [
    (lambda: refractive_index("N-BK8"), "did you mean 'N-BK7"),
    (lambda: refractive_index("Au"), "'Au' is a metal, see complex_index"),
    (lambda: complex_index("golt"), "did you mean 'gold'"),
    (lambda: complex_index("water"), "'water' is clear, see refractive_index"),
])  # fmt: skip
def test_unknown_names(call, message):
    with pytest.raises(sr.SceneError, match=message):
        call()


def test_other_names():
    assert complex_index("gold") == complex_index("Au")
    assert refractive_index("BK7") == refractive_index("N-BK7")


PAGE = """
REFERENCES: "A. <i>Body</i>"
DATA:
  - type: {kind}
    {body}
"""


def test_pages_are_read(tmp_path):
    path = tmp_path / "stuff.yml"
    path.write_text(PAGE.format(kind="formula 1", body="wavelength_range: 0.3 2\n    coefficients: 0 1.25 0.1"))
    stuff = RefractiveIndex.load(path)
    assert (stuff.name, stuff.reference, stuff.measured) == ("stuff", "A. Body", (300.0, 2000.0))
    assert float(stuff.at(500)) == pytest.approx((1 + 1.25 * 0.25 / (0.25 - 0.01)) ** 0.5)
    path.write_text(PAGE.format(kind="tabulated nk", body="data: |\n        0.4 1.5 0.1\n        0.6 1.7 0.3"))
    assert float(RefractiveIndex.load(path).at(500)) == pytest.approx(1.6)
    assert complex(ComplexIndex.load(path).at(500)) == pytest.approx(1.6 + 0.2j)


@pytest.mark.parametrize(("text", "error", "message"), [
    (PAGE.format(kind="formula 4", body="wavelength_range: 0 2\n    coefficients: 1 2 3"), sr.UnsupportedError, "formula 4"),
    (PAGE.format(kind="formula 1", body="wavelength_range: 0.3 2\n    coefficients: 1 2"), sr.FormatError, "odd number"),
    (PAGE.format(kind="tabulated k", body="data: |\n        0.4 1.5"), sr.FormatError, "neither a formula"),
    (PAGE.format(kind="tabulated nk", body="data: |\n        0.4 1.5"), sr.FormatError, "rows of 2 numbers"),
    (PAGE.format(kind="tabulated n", body="data: |\n        0.4 x"), sr.FormatError, "not a page"),
    (PAGE.format(kind="formula 1", body="coefficients: 1 2 3"), sr.FormatError, "wavelength_range"),
    ("- 1", sr.FormatError, "not a page"),
    ("a: [", sr.FormatError, "not YAML"),
    ("", sr.FormatError, "not a page"),
])  # fmt: skip
def test_pages_that_are_none(tmp_path, text, error, message):
    path = tmp_path / "page.yml"
    path.write_text(text)
    with pytest.raises(error, match=message):
        RefractiveIndex.load(path)


def test_clear_page_is_no_metal(tmp_path):
    path = tmp_path / "page.yml"
    path.write_text(PAGE.format(kind="tabulated n", body="data: |\n        0.4 1.5\n        0.6 1.4"))
    with pytest.raises(sr.FormatError, match="no table of n and k"):
        ComplexIndex.load(path)


def test_normal_reflectance():
    np.testing.assert_allclose(normal_reflectance([1.5, 2.4175], 0.0), [0.04, 0.17203986], atol=1e-8)
    assert float(normal_reflectance(0.0, 3.0)) == 1.0


def test_johnson_and_christy_gold():
    gold = complex_index("Au")
    assert complex(gold.at(548.6)) == pytest.approx(0.43 + 2.455j)
    assert gold.reflectance().at([450, 550, 650]) == pytest.approx([0.39, 0.81, 0.97], abs=0.03)
    assert (np.diff(gold.reflectance().rgb("D65")) < 0).all()  # yellow: more red than green than blue


@pytest.mark.parametrize("name", spectra.metal_names())
def test_three_numbers_have_the_metals_colour(name):
    metal = complex_index(name)
    n, k = metal.rgb()
    assert (n > 0).all()
    assert (k > 1).all()
    colour = normal_reflectance(n, k)
    most = metal.reflectance().values[40:341].max()  # from 400 to 700 nm
    np.testing.assert_allclose(colour, np.minimum(metal.reflectance().rgb("D65"), most), atol=1e-12)


def test_three_numbers_of_a_flat_metal_are_its_own():
    n, k = ComplexIndex("flat", Spectrum.constant(0.5), Spectrum.constant(3.0)).rgb()
    np.testing.assert_allclose(n, 0.5, rtol=1e-12)
    np.testing.assert_allclose(k, 3.0, rtol=1e-9)
