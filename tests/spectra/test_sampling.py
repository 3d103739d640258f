"""Which wavelengths paths get."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chisquare

from sightray import spectra
from sightray.spectra import hero_wavelengths, sample_wavelength, wavelength_density
from sightray.spectra.sampling import FROM_NM, TO_NM

MIDDLES = (np.arange(40000) + 0.5) / 40000


def white_estimates(wavelengths, density):
    """What each path returns that meets D65; `wavelengths` (n, 4)."""
    table = spectra.band_table()
    rows = table[np.floor(wavelengths - FROM_NM).astype(int)]
    return np.mean(rows[..., 3:4] * rows[..., 4:7] / density(wavelengths)[..., np.newaxis], axis=1)


def test_density_is_that_of_the_samples():
    edges = np.linspace(FROM_NM, TO_NM, 201)
    fine = np.linspace(FROM_NM, TO_NM, 200001)
    cells = np.diff(fine)[0] * (wavelength_density(fine)[:-1] + wavelength_density(fine)[1:]) / 2
    assert cells.sum() == pytest.approx(1.0, abs=1e-9)
    counts, _ = np.histogram(sample_wavelength(np.random.default_rng(3).random(200_000)), edges)
    assert chisquare(counts, 200_000 * cells.reshape(200, -1).sum(axis=1) / cells.sum()).pvalue > 1e-3


def test_range_and_order():
    np.testing.assert_allclose(sample_wavelength([0.0, 1.0]), [FROM_NM, TO_NM], atol=1e-9)
    assert sample_wavelength(1.0 - 2.0**-53) < TO_NM + 1e-9
    assert np.all(np.diff(sample_wavelength(np.linspace(0, 1, 1000))) > 0)
    assert wavelength_density([FROM_NM - 1, TO_NM + 1]).tolist() == [0, 0]


def test_four_wavelengths_are_quarters_of_the_distribution():
    heroes = hero_wavelengths(np.array([[0.1], [0.9]]))
    assert heroes.shape == (2, 1, 4)
    np.testing.assert_allclose(heroes[1, 0], sample_wavelength([0.9, 0.15, 0.4, 0.65]), rtol=1e-14)


def test_white_is_white_on_average_and_noise_is_what_the_table_says():
    ours = white_estimates(hero_wavelengths(MIDDLES), wavelength_density)
    np.testing.assert_allclose(ours.mean(axis=0), 1.0, atol=1e-4)
    assert ours.var(axis=0).sum() == pytest.approx(0.24, abs=0.01)
    single = white_estimates(sample_wavelength(MIDDLES)[:, np.newaxis], wavelength_density)
    assert single.var(axis=0).sum() == pytest.approx(14.5, abs=0.1)

    even = FROM_NM + (TO_NM - FROM_NM) * ((MIDDLES[:, np.newaxis] + np.arange(4) / 4) % 1.0)
    uniform = white_estimates(even, lambda nm: np.full_like(nm, 1 / (TO_NM - FROM_NM)))
    np.testing.assert_allclose(uniform.mean(axis=0), 1.0, atol=1e-4)
    assert uniform.var(axis=0).sum() == pytest.approx(1.47, abs=0.02)
