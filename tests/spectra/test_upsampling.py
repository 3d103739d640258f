"""RGB as spectra: the three basis reflectances, and what kernels read."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

import sightray as sr
from sightray import spectra
from sightray.spectra import WAVELENGTHS

TOOL = Path(__file__).parents[2] / "tools" / "make_basis_spectra.py"


def test_basis_adds_up_to_one_and_stays_within_it():
    basis = spectra.basis()
    assert basis.shape == (471, 3)
    assert basis.min() >= 0.0
    assert basis.max() <= 1.0
    np.testing.assert_allclose(basis.sum(axis=1), 1.0, atol=1e-15)


def test_basis_has_the_colours_of_the_primaries():
    np.testing.assert_allclose(
        (spectra.basis() * spectra.white()[:, np.newaxis]).T @ spectra.rgb_bar(), np.eye(3), atol=1e-9
    )


def test_basis_is_smooth():
    assert np.abs(np.diff(spectra.basis(), axis=0)).max() < 0.027  # per nm
    assert np.abs(np.diff(spectra.basis(), 2, axis=0)).max() < 0.0022  # per nm²


def test_packaged_basis_is_what_the_tool_finds(tmp_path):
    specification = importlib.util.spec_from_file_location("make_basis_spectra", TOOL)
    tool = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(tool)
    tool.TARGET = tmp_path / "basis.csv"
    tool.main()
    made = np.loadtxt(tool.TARGET, delimiter=",", skiprows=1)
    np.testing.assert_allclose(made[:, 1:], spectra.basis(), atol=1e-6)
    # Any other triple with the same colours and sums has larger steps: moving along the constraints costs.
    rough = lambda triple: np.sum(np.diff(triple, axis=0) ** 2)  # noqa: E731
    colour = (spectra.white()[:, np.newaxis] * spectra.rgb_bar()).T
    rng = np.random.default_rng(1)
    free = (spectra.basis() > 0.01).all(axis=1)
    for _ in range(20):
        moved = np.zeros((471, 3))
        moved[free, :2] = rng.standard_normal((free.sum(), 2))
        moved[free, :2] -= np.linalg.pinv(colour[:, free]) @ (colour[:, free] @ moved[free, :2])
        moved[:, 2] = -moved[:, 0] - moved[:, 1]
        assert rough(spectra.basis() + 1e-4 * moved / np.abs(moved).max()) > rough(spectra.basis())


def test_colours_come_back_under_d65_and_grey_is_flat():
    for rgb in np.random.default_rng(2).random((50, 3)):
        reflectance = spectra.reflectance(rgb)
        np.testing.assert_allclose(reflectance.rgb("D65"), rgb, atol=1e-9)
        assert 0 <= reflectance.values.min() <= reflectance.values.max() <= 1
        np.testing.assert_allclose(spectra.emission(100 * rgb).rgb(), 100 * rgb, atol=1e-7)
    np.testing.assert_allclose(spectra.reflectance((0.4, 0.4, 0.4)).values, 0.4, atol=1e-15)


@pytest.mark.parametrize("bad", [0.5, (1, 2), (1, 2, np.nan), "red", (1, 2, 3, 4)])
def test_what_is_no_colour(bad):
    with pytest.raises(sr.SceneError, match="three finite numbers"):
        spectra.reflectance(bad)


def test_band_table_holds_what_a_path_needs():
    table = spectra.band_table()
    assert table.shape == (471, 8)
    assert table.flags.c_contiguous
    assert not table.flags.writeable
    light = table[:, :3] @ [0.2, 0.7, 0.4] * table[:, 3]  # a coloured surface under white light
    np.testing.assert_allclose(light @ table[:, 4:7], [0.2, 0.7, 0.4], atol=1e-9)
    assert WAVELENGTHS[table[:, 5].argmax()] == pytest.approx(540, abs=10)
