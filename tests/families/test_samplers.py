"""Every sampler: uniform, evenly spread, independent where it must be, the same in machine code and in Python."""

from __future__ import annotations

import functools
import itertools
import math

import numpy as np
import pytest
from scipy import stats

import sightray as sr
from sightray._jit import kernel, native
from sightray.mathlib.digits import permuted, reverse_bits, scramble_reversed, sobol_y
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_put
from sightray.registry import members
from sightray.samplers.base import begin, default_sampler, nested, pair
from sightray.samplers.blue_noise import quadrants
from sightray.samplers.halton import radical_inverse
from sightray.scene.compile import Tables

NAMES = sorted(members("samplers"))
EVEN = [name for name in NAMES if name != "IndependentSampler"]


@kernel
def draw_all(
    sampler: Table, x0: i64, width: i64, y0: i64, height: i64, seed: i64, samples: i64, expected: i64,
    level: i64, dimension: i64, out: Table,
) -> f64:  # fmt: skip
    """One pair of all samples of some pixels, at a level of nesting or (-1) none."""
    k = 0
    for y in range(y0, y0 + height):
        for x in range(x0, x0 + width):
            for s in range(samples):
                draws = begin(sampler, x, y, seed, s, expected)
                if level >= 0:
                    draws = nested(nested(draws, 0), level)
                p = pair(draws, dimension)
                f64_put(out, 2 * k, p.u)
                f64_put(out, 2 * k + 1, p.v)
                k += 1
    return 0.0


@functools.cache
def row_of(name: str, compiled: bool = True):
    tables = Tables()
    row = tables.row_of(members("samplers")[name]())
    tables.prepare(draw_all, compiled=compiled)
    return tables, row


@pytest.fixture(autouse=True, scope="module")
def _forget_rows():
    yield
    row_of.cache_clear()


def drawn(name, samples, *, width=1, height=1, seed=0, x=0, y=0, level=-1, dimension=0, expected=None, compiled=True):
    """(height, width, samples, 2) numbers."""
    out = np.zeros((height, width, samples, 2))
    expected = samples if expected is None else expected
    run = native(draw_all) if compiled else draw_all
    run(row_of(name, compiled)[1], x, width, y, height, seed, samples, expected, level, dimension, Table(out))
    return out


def boxes(points, columns, rows):
    """How many points lie in each of columns x rows equal boxes: the points are (..., n, 2)."""
    cell = (points[..., 0] * columns).astype(int) * rows + (points[..., 1] * rows).astype(int)
    return np.apply_along_axis(np.bincount, -1, cell, minlength=columns * rows)


def is_net(points) -> bool:
    """Whether 2^k points have exactly one in each of the 2^k boxes of every division: a (0,k,2)-net in base 2."""
    k = int(math.log2(points.shape[-2]))
    return all((boxes(points, 1 << j, 1 << (k - j)) == 1).all() for j in range(k + 1))


def test_sobol_is_the_default():
    assert isinstance(default_sampler(), sr.SobolSampler)


@pytest.mark.parametrize("name", NAMES)
def test_machine_code_draws_as_python_does(name):
    for options in ({}, {"level": 3, "dimension": 5}, {"expected": 0}, {"x": 700, "y": 65, "level": 0}):
        for samples in (1, 6):
            fast = drawn(name, samples, width=3, height=2, seed=7, **options)
            slow = drawn(name, samples, width=3, height=2, seed=7, **options, compiled=False)
            np.testing.assert_allclose(fast, slow, rtol=0, atol=1e-15)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("level", "dimension"), [(-1, 0), (0, 1), (4, 7)])
@pytest.mark.parametrize("expected", [0, 7, 16])
def test_every_sample_alone_is_uniform(name, level, dimension, expected):
    """χ² of one sample over 40,000 pixels in 8 by 8 boxes: what makes every estimate unbiased."""
    for sample in (0, 5):
        points = drawn(name, 6, width=200, height=200, level=level, dimension=dimension, expected=expected, seed=3)
        points = points[:, :, sample].reshape(-1, 2)
        assert points.min() >= 0
        assert points.max() < 1
        if name == "BlueNoiseSampler" and level < 1:
            points = points[::7]  # neighbours share a sequence: take some that are apart
        statistic, p = stats.chisquare(boxes(points, 8, 8))
        assert p > 1e-4, (statistic, p)


@pytest.mark.parametrize("name", NAMES)
def test_estimates_are_unbiased(name):
    """Z-test over 400 seeds: the mean of a kinked function of four numbers, from 8 samples each."""
    means = []
    for seed in range(400):
        a, b = (drawn(name, 8, seed=seed, level=0, dimension=d, expected=8)[0, 0] for d in (0, 1))
        means.append((np.abs(a[:, 0] - b[:, 1]) * (a[:, 1] < 0.3) + b[:, 0] ** 2).mean())
    exact = 0.3 / 3 + 1 / 3
    assert abs(np.mean(means) - exact) < 4 * np.std(means, ddof=1) / 20


@pytest.mark.parametrize("name", ["SobolSampler", "BlueNoiseSampler"])
@pytest.mark.parametrize("k", range(9))
def test_powers_of_two_are_nets(name, k):
    """All 2^k boxes of all k + 1 divisions hold one of the first 2^k points, in pixels, bounces and pairs at will."""
    for level, dimension in ((-1, 0), (0, 3), (5, 2)):
        assert is_net(drawn(name, 1 << k, width=4, height=4, seed=k, level=level, dimension=dimension))
    if name == "SobolSampler":
        more = drawn(name, 2 << k, expected=0, seed=1)
        assert is_net(more[..., : 1 << k, :])
        assert is_net(more[..., 1 << k :, :])  # and so is every further run


def test_blue_noise_quadrants_are_nets_too():
    for side in (2, 4, 8):
        points = drawn("BlueNoiseSampler", 4, x=128, y=64, width=side, height=side, seed=2, dimension=1)
        assert is_net(points.reshape(-1, 2))


@pytest.mark.parametrize(("count", "columns", "rows"), [(16, 4, 4), (64, 8, 8), (12, 3, 4), (7, 2, 4)])
def test_stratified_fills_cells_and_strips(count, columns, rows):
    points = drawn("StratifiedSampler", count, width=20, height=20, level=1, dimension=2)
    assert (boxes(points, 1, count) == 1).all()
    if columns * rows == count:
        assert (boxes(points, columns, rows) == 1).all()
        assert (boxes(points, count, 1) == 1).all()
    # Where the number is not known, or surpassed, each further pattern does so too.
    points = drawn("StratifiedSampler", 32, expected=0)
    assert (boxes(points[..., :16, :], 4, 4) == 1).all()
    assert (boxes(points[..., 16:, :], 4, 4) == 1).all()


def test_halton_runs_fill_boxes_of_its_primes():
    """Of n consecutive points each of the 2^a 3^b boxes has n / (2^a 3^b), rounded up or down; and so in other pairs."""
    points = drawn("HaltonSampler", 256, width=3, height=3)
    for a, b in ((8, 0), (0, 5), (3, 3), (4, 2), (2, 4)):
        counts = boxes(points, 2**a, 3**b)
        assert counts.min() >= 256 // (2**a * 3**b)
        assert counts.max() <= -(-256 // (2**a * 3**b))
    second = boxes(drawn("HaltonSampler", 256, width=3, height=3, dimension=1), 5, 7)
    assert (second.min(), second.max()) == (256 // 35, 256 // 35 + 1)


def test_halton_spreads_pairs_together():
    """First numbers of two pairs, bases 2 and 5: the boxes of their plane too are evenly filled."""
    first, second = (drawn("HaltonSampler", 640, expected=640, dimension=d)[0, 0, :, 0] for d in (0, 1))
    counts = boxes(np.stack([first, second], axis=1)[:640], 4, 5)
    assert counts.min() >= 30
    assert counts.max() <= 34


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("what", ["dimension", "bounce", "pixel", "seed"])
def test_pairs_know_nothing_of_one_another(name, what):
    """Products of two centred numbers: zero on average, and their mean over a pixel as uncertain as by chance.

    The second fails where two pairs run through their points in the same order: then it is about 9 times that. Orders
    that keep runs of 2, 4, 8 together leave 1.6.
    """
    n, side = 16, 64
    a = drawn(name, n, width=side, height=side, seed=5, level=1, dimension=0, y=64)
    b = drawn(name, n, width=side, height=side, seed=5 + (what == "seed"), level=1 + (what == "bounce"),
              dimension=int(what == "dimension"), x=int(what == "pixel"), y=64)  # fmt: skip
    if what == "pixel":
        b[:, -1] = drawn(name, n, width=1, height=side, seed=99, level=1, y=64)[:, 0]
    for i in (0, 1):
        for j in (0, 1):
            products = 12 * ((a[..., i] - 0.5) * (b[..., j] - 0.5)).mean(axis=-1).ravel()
            z = products.mean() / products.std() * math.sqrt(products.size)
            assert abs(z) < 4.5, (i, j, z)
            if name != "HaltonSampler" or what != "dimension":  # whose dimensions are spread together on purpose
                assert 0.85 < products.var() * n < 1.8, (i, j)


@pytest.mark.parametrize(("one", "other"), [((1, 7), (1, 15)), ((1, 3), (1, 7)), ((0, 15), (1, 15)), ((2, 0), (40, 0))])
def test_late_dimensions_of_halton_make_no_stripes(one, other):
    """Bands along the diagonals of two dimensions get their share of samples, no less surely than by chance.

    Linearly scrambled digits of large primes fail: for few samples their pairs are lattices, 5.5 times as uncertain.
    """
    n = 1024
    a, b = (drawn("HaltonSampler", n, width=20, height=20, level=level, dimension=d) for level, d in (one, other))
    for i, j in itertools.product((0, 1), repeat=2):
        for sign in (1, -1):
            share = ((a[..., i] + sign * b[..., j]) % 1 < 0.5).mean(axis=-1)
            assert 4 * n * ((share - 0.5) ** 2).mean() < 1.6, (i, j, sign)


def smooth(points):
    """A function of one pair with mean 1/4."""
    return (np.sin(math.pi * points[..., 0]) ** 2) * (0.5 + (points[..., 1] - 0.5) ** 3)


def smooth4(a, b):
    """A function of two pairs with mean 1/4, mostly a sum of functions of one pair each."""
    return smooth(a) + 0.3 * (b[..., 0] - 0.5) * a[..., 1] + (b[..., 0] + b[..., 1] - 1) ** 3


def slope(name, error_of) -> float:
    """Exponent of the root mean square error in the number of samples, from 16 to 1024."""
    counts = [16, 64, 256, 1024]
    return float(np.polyfit(np.log(counts), np.log([error_of(name, n) for n in counts]), 1)[0])


@pytest.mark.parametrize("name", NAMES)
def test_errors_fall_as_they_should(name):
    """Independent numbers: n^-0.5. Evenly spread ones on a smooth function of a pair: steeper than n^-0.85; of two
    pairs, never flatter, and the error itself much smaller."""

    def error2(name, n):
        points = drawn(name, n, width=16, height=16, level=1, seed=n)
        return np.sqrt(((smooth(points).mean(-1) - 0.25) ** 2).mean())

    def error4(name, n):
        a, b = (drawn(name, n, width=16, height=16, level=1, dimension=d, seed=n) for d in (0, 1))
        return np.sqrt(((smooth4(a, b).mean(-1) - 0.25) ** 2).mean())

    if name == "IndependentSampler":
        assert slope(name, error2) == pytest.approx(-0.5, abs=0.07)
        assert slope(name, error4) == pytest.approx(-0.5, abs=0.07)
    else:
        assert slope(name, error2) < -0.85
        assert slope(name, error4) < -0.45
        assert error4(name, 256) < 0.35 * error4("IndependentSampler", 256)


def test_blue_noise_errors_cancel_among_neighbours():
    """Means over 4 by 4 pixels, 4 samples each: Sobol's errors are 1/4 of a pixel's (16 independent ones), these less."""

    def error(name, block):
        points = drawn(name, 4, width=128, height=128, seed=1, dimension=1)
        wrong = smooth(points).mean(-1) - 0.25
        blocks = wrong.reshape(128 // block, block, 128 // block, block).mean((1, 3))
        return np.sqrt((blocks**2).mean())

    assert error("SobolSampler", 4) / error("SobolSampler", 1) == pytest.approx(0.25, abs=0.05)
    assert error("BlueNoiseSampler", 4) / error("BlueNoiseSampler", 1) < 0.07
    assert error("BlueNoiseSampler", 1) == pytest.approx(error("SobolSampler", 1), rel=0.1)


def test_halton_digits_are_scrambled_fairly():
    """The first digits of two indices, base 5: all 20 pairs of different digits equally often over keys (χ²)."""
    keys = np.random.default_rng(3).integers(-(1 << 63), (1 << 63) - 1, 4000).tolist()
    first = np.array([[int(5 * radical_inverse(i, 5, key)) for i in (0, 3)] for key in keys])
    found = np.bincount(first @ [5, 1], minlength=25).reshape(5, 5)
    assert (np.diag(found) == 0).all()
    assert stats.chisquare(found[~np.eye(5, dtype=bool)]).pvalue > 1e-4


@pytest.mark.parametrize("level", [0, 3])
def test_quadrants_come_in_every_order(level):
    """All 24 orders of a quadrant's four parts, equally often over keys (χ²), at the lowest level and a higher one."""
    keys = np.random.default_rng(4).integers(-(1 << 63), (1 << 63) - 1, 5000).tolist()
    corners = [(x << level) + ((y << level) << 16) for y in (2, 3) for x in (4, 5)]
    orders = np.array([[(quadrants(pixel, key) >> (2 * level)) & 3 for pixel in corners] for key in keys])
    assert (np.sort(orders, axis=1) == np.arange(4)).all()
    found = np.unique(orders, axis=0, return_counts=True)[1]
    assert len(found) == 24
    assert stats.chisquare(found).pvalue > 1e-4


# --- digits --------------------------------------------------------------------------------------------------------


def test_reversed_bits():
    rng = np.random.default_rng(0)
    for x in rng.integers(-(1 << 63), (1 << 63) - 1, 100).tolist():
        bits = f"{x & ((1 << 64) - 1):064b}"
        assert reverse_bits(x) & ((1 << 64) - 1) == int(bits[::-1], 2)


def test_sobol_second_coordinate_is_pascals_triangle():
    """Row j of the generator matrix is C(column, j) modulo 2 (I. Sobol, 1967): entry by entry."""
    for column in range(32):
        expected = sum((math.comb(column, j) & 1) << j for j in range(32))
        assert sobol_y(1 << column) == expected


def test_scrambling_flips_every_node_of_the_digit_tree_fairly_and_alone():
    """The flips of the 31 nodes of the first five digits, over 4096 seeds: fair, and no two of them correlated."""
    seeds = np.random.default_rng(1).integers(0, 1 << 32, 4096).tolist()
    flips = np.array([
        [((scramble_reversed(prefix, seed) >> depth) & 1) * 2 - 1 for depth in range(5) for prefix in range(1 << depth)]
        for seed in seeds
    ])  # fmt: skip
    correlation = flips.T @ flips / len(seeds)
    np.fill_diagonal(correlation, 0)
    assert np.abs(flips.mean(axis=0)).max() < 4.5 / 64
    assert np.abs(correlation).max() < 5 / 64
    # What stands above a digit never changes it.
    assert all((scramble_reversed(5, s) ^ scramble_reversed(5 + 64, s)) & 63 == 0 for s in seeds[:100])


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 7, 16, 100])
def test_permutations_are_one_to_one_and_fair(n):
    """Every number goes everywhere equally often, and every pair of numbers to every pair of places (χ²)."""
    keys = np.random.default_rng(n).integers(-(1 << 63), (1 << 63) - 1, 20000 if n < 16 else 200).tolist()
    places = np.array([[permuted(i, n, key) for i in range(n)] for key in keys])
    assert (np.sort(places, axis=1) == np.arange(n)).all()
    if 1 < n < 16:
        for i, j in ((0, 1), (n - 1, 0), (n // 2, n - 1)):
            if i == j:
                continue
            table = np.bincount(places[:, i] * n + places[:, j], minlength=n * n).reshape(n, n)
            found = table[~np.eye(n, dtype=bool)]
            assert stats.chisquare(found).pvalue > 1e-4, (i, j, found)
