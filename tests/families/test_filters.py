"""Pixel filters: their shapes, and that drawn samples follow them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import integrate, stats

from sightray._jit import kernel, native
from sightray.errors import SceneError
from sightray.filters.blackman_harris import BlackmanHarrisFilter
from sightray.filters.box import BoxFilter
from sightray.filters.gaussian import GaussianFilter
from sightray.filters.mitchell import MitchellFilter
from sightray.filters.table import filter_table, sample_filter
from sightray.filters.tent import TentFilter
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Space, Table, f64_at, f64_put
from sightray.registry import members

EXAMPLES = {
    "BoxFilter": [BoxFilter(), BoxFilter(radius=1.7)],
    "TentFilter": [TentFilter(), TentFilter(radius=0.3)],
    "GaussianFilter": [
        GaussianFilter(),
        GaussianFilter(radius=3, sigma=1),
        GaussianFilter(sigma=1e3),
        GaussianFilter(radius=16, sigma=0.2),
    ],
    "MitchellFilter": [MitchellFilter(), MitchellFilter(radius=5)],
    "BlackmanHarrisFilter": [BlackmanHarrisFilter(), BlackmanHarrisFilter(radius=0.75)],
}
EVERY = [pytest.param(f, id=f"{name}-{i}") for name, all_of in EXAMPLES.items() for i, f in enumerate(all_of)]


@kernel
def draw(table: Table, count: i64, samples: Table) -> i64:
    """Replace each random number (first of two words) by an offset and a weight."""
    for i in range(count):
        sample = sample_filter(table, f64_at(samples, 2 * i))
        f64_put(samples, 2 * i, sample.offset)
        f64_put(samples, 2 * i + 1, sample.weight)
    return count


def drawn(filter, u: np.ndarray, compiled: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """Offsets and weights for random numbers."""
    space = Space()
    samples = np.zeros((len(u), 2))
    samples[:, 0] = u
    (native(draw) if compiled else draw)(filter_table(filter, space), len(u), Table(samples))
    return samples[:, 0], samples[:, 1]


def evenly(count: int) -> np.ndarray:
    return (np.arange(count) + 0.5) / count


def integral(function, radius: float) -> float:
    return integrate.quad(function, -radius, radius, limit=500, points=[-radius / 2, 0, radius / 2])[0]


def test_no_filter_lacks_an_example():
    assert set(EXAMPLES) == {n for n, cls in members("filters").items() if cls.__module__.startswith("sightray.")}


def test_no_name_stands_for_members_of_two_families():
    """``sightray.<Name>`` finds members of all families."""
    families = ("shapes", "materials", "textures", "lights", "cameras", "integrators", "filters")
    names = [name for family in families for name in members(family)]
    assert sorted(names) == sorted(set(names))


@pytest.mark.parametrize("filter", EVERY)
def test_filters_are_even_one_at_the_centre_and_zero_beyond_the_radius(filter):
    x = np.linspace(0, filter.radius, 101)
    np.testing.assert_array_equal(filter.weight(x), filter.weight(-x))
    assert filter.weight(0.0) == pytest.approx(1, abs=1e-14)
    assert filter.weight(x).max() <= 1 + 1e-12
    assert not filter.weight(filter.radius * np.array([1.0001, 2, 100, np.inf])).any()
    assert filter.weight(np.zeros((2, 3))).shape == (2, 3)


@pytest.mark.parametrize("filter", [p for p in EVERY if not p.id.startswith("Box")])
def test_filters_other_than_the_box_end_without_a_step(filter):
    assert abs(filter.weight(filter.radius * (1 - 1e-9))) < 1e-4


@pytest.mark.parametrize("filter", [BoxFilter(), TentFilter(), MitchellFilter()])
def test_neighbouring_pixels_weigh_a_point_by_one_in_total(filter):
    """A partition of unity: an even picture stays even."""
    x = np.random.default_rng(0).uniform(-0.5, 0.5, 100)
    total = sum(filter.weight(x - k) for k in range(-3, 4))
    np.testing.assert_allclose(total, integral(filter.weight, filter.radius), rtol=1e-12)


def test_mitchell_netravali_values():
    """B = C = 1/3: 8/9 at the centre, 1/18 at 1, over the unit integral; negative beyond."""
    f = MitchellFilter()
    assert f.weight(1.0) == pytest.approx((1 / 18) / (8 / 9), rel=1e-12)
    assert integral(f.weight, 2) == pytest.approx(1 / (8 / 9), rel=1e-9)
    assert f.weight(1.5) < 0
    assert f.weight(2.0) == pytest.approx(0, abs=1e-14)


def test_gaussian_values():
    """Far from its end the bell is exp(-x²/2 sigma²); near, the value at the radius is taken off."""
    x = np.array([0, 0.5, 1, 2])
    np.testing.assert_allclose(GaussianFilter(radius=16, sigma=1).weight(x), np.exp(-(x**2) / 2), rtol=1e-12)
    end = np.exp(-4.5)
    assert GaussianFilter(radius=1.5, sigma=0.5).weight(0.5) == pytest.approx(
        (np.exp(-0.5) - end) / (1 - end), rel=1e-12
    )


def test_harris_four_term_window_values():
    assert BlackmanHarrisFilter(radius=1).weight(1.0) == pytest.approx(6e-5, abs=1e-12)
    assert BlackmanHarrisFilter(radius=1).weight(0.5) == pytest.approx(0.35875 - 0.14128, abs=1e-12)


# --- sampling ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("filter", EVERY)
def test_machine_code_draws_as_python_does(filter):
    u = np.concatenate([[0.0, 0.5, 1 - 2**-53], np.random.default_rng(0).uniform(0, 1, 100)])
    for found, expected in zip(drawn(filter, u), drawn(filter, u, compiled=False), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("filter", EVERY)
def test_offsets_grow_with_u_and_stay_within_the_radius(filter):
    offsets, weights = drawn(filter, np.concatenate([[0.0], evenly(10_000), [1 - 2**-53]]))
    assert (np.diff(offsets) >= 0).all()
    assert np.abs(offsets).max() <= filter.radius
    assert np.isfinite(weights).all()


@pytest.mark.parametrize("filter", EVERY)
def test_chi_square_of_offsets_against_the_density(filter):
    n, bins = 200_000, 37  # bins whose ends are not those of the table's cells
    offsets, _ = drawn(filter, np.random.default_rng(1).uniform(0, 1, n))
    edges = np.linspace(-filter.radius, filter.radius, bins + 1)
    found = np.histogram(offsets, edges)[0]
    inside = np.linspace(edges[:-1], edges[1:], 401)
    density = np.abs(filter.weight((inside[1:] + inside[:-1]) / 2)).sum(axis=0)
    expected = n * density / density.sum()
    enough = expected >= 5
    assert found[~enough].sum() <= 3 * expected[~enough].sum() + 10
    statistic = ((found - expected)[enough] ** 2 / expected[enough]).sum()
    assert stats.chi2.sf(statistic, enough.sum() - 1) > 1e-3


@pytest.mark.parametrize("filter", EVERY)
def test_weights_are_one_on_average_and_carry_the_sign(filter):
    offsets, weights = drawn(filter, evenly(1 << 18))
    assert weights.mean() == pytest.approx(1, abs=2e-5)
    values = filter.weight(offsets)
    clear = np.abs(values) > 0.02
    assert (np.sign(weights[clear]) == np.sign(values[clear])).all()
    if (values >= 0).all():
        np.testing.assert_allclose(weights, 1, rtol=1e-12)


@pytest.mark.parametrize("filter", EVERY)
def test_weighted_samples_integrate_what_the_filter_integrates(filter):
    """The variance of the signed filter: MitchellFilter's negative lobes subtract."""
    offsets, weights = drawn(filter, evenly(1 << 18))
    r = filter.radius
    expected = integral(lambda x: filter.weight(x) * (x / r) ** 2, r) / integral(filter.weight, r)
    assert (weights * (offsets / r) ** 2).mean() == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize(("make", "message"), [
    (lambda: BoxFilter(radius=0), r"BoxFilter\.radius: got 0; allowed: a finite number > 0 and <= 16 \(pixels\)"),
    (lambda: GaussianFilter(sigma=-1), r"GaussianFilter\.sigma: got -1"),
    (lambda: MitchellFilter(b=1), r"MitchellFilter: unknown field 'b'"),
])  # fmt: skip
def test_errors_say_where_what_and_what_is_allowed(make, message):
    with pytest.raises(SceneError, match=message):
        make()
