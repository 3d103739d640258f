"""The value class: what spectra are made of, how they combine, how they are read."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import sightray as sr
from sightray.spectra import Spectrum

RAMP = Spectrum([400, 500, 700], [0.0, 1.0, 0.5])


def test_lines_between_and_ends_outside():
    assert RAMP.at([300, 400, 425, 600, 700, 900]).tolist() == [0, 0, 0.25, 0.75, 0.5, 0.5]
    assert RAMP.at(600).shape == ()
    assert RAMP.at(np.full((2, 3), 600.0)).shape == (2, 3)


def test_arithmetic_stands_at_the_wavelengths_of_both():
    other = Spectrum([450, 600], [2.0, 4.0])
    nm = np.array([400, 450, 500, 600, 700.0])
    for combined, expected in (
        (RAMP + other, RAMP.at(nm) + other.at(nm)),
        (RAMP - other, RAMP.at(nm) - other.at(nm)),
        (RAMP * other, RAMP.at(nm) * other.at(nm)),
        (RAMP / other, RAMP.at(nm) / other.at(nm)),
    ):
        assert combined.wavelengths.tolist() == nm.tolist()
        np.testing.assert_allclose(combined.values, expected, rtol=1e-15)


def test_arithmetic_with_numbers():
    assert (2 * RAMP).values.tolist() == (RAMP * np.float32(2)).values.tolist() == [0, 2, 1]
    assert (1 - RAMP).values.tolist() == [1, 0, 0.5]
    assert (1 + RAMP).values.tolist() == (RAMP + 1).values.tolist() == [1, 2, 1.5]
    assert (RAMP - 1).values.tolist() == (-(1 - RAMP)).values.tolist()
    assert (1 / (RAMP + 1)).values.tolist() == [1, 0.5, 1 / 1.5]
    with pytest.raises(TypeError):
        RAMP + "red"
    with pytest.raises(TypeError):
        np.ones(3) * RAMP
    with pytest.raises(sr.SceneError, match="finite"):
        1 / RAMP


def test_value_semantics():
    same = Spectrum([400, 500, 700], [0.0, 1.0, 0.5])
    assert same == RAMP
    assert hash(same) == hash(RAMP)
    assert RAMP != Spectrum([400, 500, 700], [0.0, 1.0, 0.6])
    assert pickle.loads(pickle.dumps(RAMP)) == RAMP
    with pytest.raises(AttributeError, match="immutable"):
        RAMP.values = np.zeros(3)
    with pytest.raises(ValueError, match="read-only"):
        RAMP.values[0] = 1.0
    source = np.array([1.0, 2.0])
    kept = Spectrum([400, 500], source)
    source[0] = 9.0
    assert kept.values[0] == 1.0


@pytest.mark.parametrize(("wavelengths", "values", "message"), [
    ([400, 500], [1], "2 wavelengths and 1 values"),
    ([500, 400], [1, 2], "increase"),
    ([400, 400], [1, 2], "increase"),
    ([0, 400], [1, 2], "above 0"),
    ([400, np.nan], [1, 2], "finite"),
    ([400, 500], [1, np.inf], "finite"),
    ([], [], "one or more"),
    ([[400, 500]], [[1, 2]], "in a row"),
    (["red"], [1], "a sequence of numbers"),
])  # fmt: skip
def test_what_is_no_spectrum(wavelengths, values, message):
    with pytest.raises(sr.SceneError, match=message):
        Spectrum(wavelengths, values)


def test_sprague_meets_the_measurements_and_reproduces_quartics_and_curves():
    nm = np.arange(400.0, 701.0, 10.0)
    fine = np.arange(400.0, 701.0, 1.0)
    noise = Spectrum(nm, np.random.default_rng(4).random(len(nm)))
    np.testing.assert_allclose(noise.resampled(nm, smooth=True).values, noise.values, atol=1e-14)
    x = (fine - 550) / 150
    quartic = Spectrum(nm, np.polyval([3, -2, 1, 4, -1], (nm - 550) / 150)).resampled(fine, smooth=True)
    inner = slice(20, -20)  # in front of the first and behind the last measurement two more are made up
    np.testing.assert_allclose(quartic.values[inner], np.polyval([3, -2, 1, 4, -1], x)[inner], atol=1e-12)
    line = Spectrum(nm, 2 * nm).resampled(fine, smooth=True)
    np.testing.assert_allclose(line.values, 2 * fine, atol=1e-9)
    bell = Spectrum(nm, np.exp(-(((nm - 550) / 30) ** 2))).resampled(fine, smooth=True)
    np.testing.assert_allclose(bell.values, np.exp(-(((fine - 550) / 30) ** 2)), atol=1e-3)


def test_sprague_holds_the_ends_and_needs_even_steps():
    even = Spectrum([400, 410, 420, 430, 440, 450], [1, 2, 4, 3, 1, 5])
    np.testing.assert_allclose(even.resampled([350, 500], smooth=True).values, [1, 5], rtol=1e-14)
    for bad in (RAMP, Spectrum([400, 410, 420, 430, 440, 460], [1, 2, 3, 4, 5, 6])):
        with pytest.raises(sr.SceneError, match="evenly spaced"):
            bad.resampled(smooth=True)


def test_csv_with_and_without_names(tmp_path):
    path = tmp_path / "s.csv"
    path.write_text("nm,a,b\n400,1,2\n\n500, 3 ,4\n")
    assert Spectrum.load(path) == Spectrum([400, 500], [1, 3])
    assert Spectrum.load(path, "b") == Spectrum([400, 500], [2, 4])
    path.write_text("\ufeff400,1\r\n500,3e0\r\n", encoding="utf-8")
    assert Spectrum.load(str(path)) == Spectrum([400, 500], [1, 3])


@pytest.mark.parametrize(("text", "column", "error", "message"), [
    ("", None, sr.FormatError, "empty"),
    ("nm,a\n400,x\n", None, sr.FormatError, r"s\.csv:2: got '400,x'"),
    ("400\n", None, sr.FormatError, r"s\.csv:1: got '400'"),
    ("500,1\n400,1\n", None, sr.FormatError, "increase"),
    ("nm,power\n", None, sr.FormatError, "one or more"),
    ("nm,power\n400,1\n", "powr", sr.SceneError, "did you mean 'power'"),
    ("400,1\n", "a", sr.SceneError, "unknown column"),
    (b"\xff\xfe\x00", None, sr.SceneError, "cannot be read"),
])  # fmt: skip
def test_csv_that_is_none(tmp_path, text, column, error, message):
    path = tmp_path / "s.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(error, match=message):
        Spectrum.load(path, column)


def test_missing_file():
    with pytest.raises(sr.SceneError, match=r"none\.csv: cannot be read as text: No such file"):
        Spectrum.load("none.csv")
