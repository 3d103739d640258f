"""Textures under the footprint of a ray: means over what it covers, instead of one point of it."""

from __future__ import annotations

import numpy as np
import pytest

import sightray as sr
from sightray._jit import kernel, native
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, f64_at, no_table, vec3_at, vec3_put
from sightray.mathlib.vec import Vec3
from sightray.scene.compile import Tables
from sightray.textures.base import Where, texture_value
from sightray.textures.checker import BOX

RNG = np.random.default_rng(0)
UP = (0.0, 1.0, 0.0)


@kernel
def ask(texture: Table, count: i64, places: Table, colours: Table) -> i64:
    """`texture_value` at many places, each u, v, p, normal, width, reach (10 of 16 words)."""
    for i in range(count):
        u, v, width, reach = (f64_at(places, 16 * i), f64_at(places, 16 * i + 1), f64_at(places, 16 * i + 8),
                              f64_at(places, 16 * i + 9))  # fmt: skip
        p, n = vec3_at(places, 16 * i + 2), vec3_at(places, 16 * i + 5)
        where = Where(u, v, p, Vec3(n.x, n.y, n.z, reach), width, no_table())
        vec3_put(colours, 4 * i, texture_value(texture, where))
    return count


def reds(texture, *, uv=(0.0, 0.0), p=(0.0, 0.0, 0.0), normal=UP, width=0.0, reach=0.0) -> np.ndarray:
    """(n,) reds at places with footprints."""
    count = max(np.size(uv) // 2, np.size(p) // 3)
    rows = np.zeros((count, 16))
    rows[:, :2], rows[:, 2:5], rows[:, 5:8], rows[:, 8], rows[:, 9] = uv, p, normal, width, reach
    tables, out = Tables(), np.zeros((count, 4))
    row = tables.row_of(texture)
    tables.prepare(ask)
    native(ask)(row, count, Table(rows), Table(out))
    return out[:, 0]


# --- checkers ------------------------------------------------------------------------------------------------------

OFFSETS = (np.arange(400) + 0.5) / 400 - 0.5
WIDTHS = (0.05, 0.6, 1.0, 1.7, 2.0)  # cells


@pytest.mark.parametrize("width", WIDTHS)
def test_a_checker_is_the_mean_over_a_box(width):
    checker = sr.Checker(even=0.9, odd=0.1, scale=3)
    for u, v in RNG.uniform(-2, 2, (4, 2)):
        s, t = np.meshgrid(u + OFFSETS * width / 3, v + OFFSETS * width / 3)
        mean = reds(checker, uv=np.column_stack([s.ravel(), t.ravel()])).mean()
        assert abs(reds(checker, uv=(u, v), width=width / 3 / BOX)[0] - mean) < 0.02


@pytest.mark.parametrize("width", WIDTHS)
def test_a_solid_checker_is_the_mean_over_a_patch_of_the_surface(width):
    """On a floor the box is flat: colours do not bleed through from below."""
    checker = sr.Checker(even=0.9, odd=0.1, scale=3, mode="solid")
    for x, z in RNG.uniform(-2, 2, (4, 2)):
        s, t = np.meshgrid(x + OFFSETS * width / 3, z + OFFSETS * width / 3)
        p = np.column_stack([s.ravel(), np.zeros(s.size), t.ravel()])
        assert abs(reds(checker, p=(x, 0, z), reach=width / 3 / BOX)[0] - reds(checker, p=p).mean()) < 0.02


@pytest.mark.parametrize("mode", ["uv", "solid"])
def test_far_checkers_are_their_mean(mode):
    checker = sr.Checker(even=0.9, odd=0.1, mode=mode)
    uv, p = RNG.uniform(-50, 50, (500, 2)), RNG.uniform(-50, 50, (500, 3))
    for width in (2.0 / BOX, 3.1 / BOX, 1e3, np.inf):
        np.testing.assert_allclose(reds(checker, uv=uv, p=p, width=width, reach=width), 0.5, atol=1e-12)


def test_filtered_checkers_show_what_is_in_their_cells():
    """Nested textures are filtered too, each by the same footprint."""
    nested = sr.Checker(even=sr.Checker(even=1, odd=0, scale=50), odd=0.25)
    uv = np.array([[0.5, 0.5], [0.5, 1.5]])
    np.testing.assert_allclose(reds(nested, uv=uv, width=0.1), [0.5, 0.25], atol=1e-12)


# --- noise ---------------------------------------------------------------------------------------------------------


def test_solid_noise_drops_octaves_by_the_footprint_in_metres():
    p = RNG.uniform(-9, 9, (300, 3))
    coarse, fine = sr.Noise(octaves=2, scale=2, contrast=0.7), sr.Noise(octaves=6, scale=2, contrast=0.7)
    strengths = [sum(0.5**k for k in range(octaves)) for octaves in (2, 6)]
    expected = 0.5 + (reds(coarse, p=p) - 0.5) * strengths[0] / strengths[1]
    np.testing.assert_allclose(
        reds(fine, p=p, reach=0.125), expected, atol=1e-12
    )  # 1 cell of octave 2, 1/2 of octave 1
    np.testing.assert_allclose(reds(fine, p=p, width=9.0), reds(fine, p=p), atol=0)  # uv has no say
    np.testing.assert_allclose(reds(fine, p=p, reach=0.5), 0.5, atol=1e-12)


@pytest.mark.parametrize(
    "texture",
    [
        sr.Marble(dark=0, light=1),
        sr.Marble(dark=0, light=1, fold=0, sharpness=1.5),
        sr.Wood(dark=0, light=1, grain=0.6),
    ],
)
def test_far_stone_and_wood_are_their_mean(texture):
    p = RNG.uniform(-100, 100, (200_000, 3))
    near = reds(texture, p=p)
    far = reds(texture, p=p[:100], reach=50.0)
    assert np.ptp(far) < 1e-12
    assert abs(far[0] - near.mean()) < 0.01


@pytest.mark.parametrize("texture", [sr.Marble(), sr.Wood(), sr.Noise(), sr.Checker(mode="solid"), sr.Checker()])
def test_a_footprint_blurs_gradually(texture):
    """Contrast falls with the footprint, and there is no jump on the way."""
    p = RNG.uniform(-5, 5, (2000, 3))
    widths = np.concatenate([[0.0], np.geomspace(1e-4, 20, 200)])
    shown = np.array([reds(texture, uv=p[:, :2], p=p, width=w, reach=w) for w in widths])
    spread = shown.std(axis=1)
    assert (np.diff(spread) < 0.02 * spread[0]).all()
    assert spread[-1] < 1e-9 < 0.05 < spread[0]
    assert np.abs(np.diff(shown, axis=0)).mean(axis=1).max() < 0.25 * spread[0]


# --- projections ---------------------------------------------------------------------------------------------------


def test_projected_pictures_are_filtered_by_the_footprint():
    picture = sr.Bitmap(image=RNG.uniform(0, 1, (64, 64)), filter="trilinear")
    p = RNG.uniform(-3, 3, (50, 3))
    found = reds(sr.Triplanar(x=picture, scale=0.7), p=p, normal=(0, 0, 1), reach=0.1)
    np.testing.assert_allclose(found, reds(picture, uv=0.7 * p[:, :2], width=0.07), atol=1e-12)
    assert np.abs(found - reds(picture, uv=0.7 * p[:, :2])).max() > 0.1


def test_a_moved_texture_keeps_its_footprint_in_metres():
    p = RNG.uniform(-3, 3, (50, 3))
    marble = sr.Marble()
    moved = sr.UvTransform(texture=marble, scale=3)
    np.testing.assert_array_equal(reds(moved, p=p, reach=0.1), reds(marble, p=p, reach=0.1))


# --- in pictures ---------------------------------------------------------------------------------------------------


def floor_to_the_horizon(albedo, samples, seed=0):
    material = sr.Phong(diffuse=0, specular=0, ambient=albedo)
    floor = sr.Rectangle(corner=(-100, 0, 30), edge_u=(200, 0, 0), edge_v=(0, 0, -200), material=material)
    camera = sr.PerspectiveCamera(eye=(0.3, 2, 20), target=(0.1, 0, 0), width=100, height=60)
    scene = sr.Scene(floor, camera=camera, ambient=1.0)
    return np.asarray(sr.render(scene, sr.Whitted(), samples=samples, seed=seed))[24:, :, 0]


def test_a_chessboard_to_the_horizon_has_no_moire():
    """One filtered sample a pixel is near 1024 unfiltered ones, and far away the board is grey in every patch."""
    tiles = sr.Bitmap(image=np.array([[0.0, 1.0], [1.0, 0.0]], np.float32), filter="nearest", scale=100)  # same board
    board = sr.Checker(even=1, odd=0, scale=200)
    converged = floor_to_the_horizon(tiles, 1024)
    aliased, filtered = floor_to_the_horizon(tiles, 1), floor_to_the_horizon(board, 1)
    error = [np.sqrt(np.mean((picture - converged) ** 2)) for picture in (aliased, filtered)]
    assert error[1] < 0.4 * error[0]
    far = slice(0, 5)  # rows
    assert np.sqrt(np.mean((filtered - converged)[far] ** 2)) < 0.05
    assert np.sqrt(np.mean((aliased - converged)[far] ** 2)) > 0.4
    patches = filtered[far].reshape(5, 10, 10).mean(axis=(0, 2))
    assert np.abs(patches - 0.5).max() < 0.02


# --- gradients -----------------------------------------------------------------------------------------------------

STOPS = {"colors": [[0.1] * 3, [0.9] * 3, [0.3] * 3, [0.3] * 3, [1.0] * 3], "places": [0.0, 0.2, 0.45, 0.45, 0.8]}


@pytest.mark.parametrize("wrap", ["clamp", "repeat", "mirror"])
@pytest.mark.parametrize("along", ["u", "v", "z"])
@pytest.mark.parametrize("width", [0.01, 0.3, 1.0, 2.7, 20.0])
def test_a_gradient_is_the_mean_over_a_box(along, wrap, width):
    gradient = sr.Gradient(**STOPS, along=along, wrap=wrap, begin=0.5, end=-1.5)
    offsets = ((np.arange(40_000) + 0.5) / 40_000 - 0.5) * width
    for x in (*RNG.uniform(-9, 9, 6), 0.4, 0.5):
        uv, p = np.full((len(offsets), 2), x + offsets[:, None]), np.outer(x + offsets, (0.0, 0.0, 1.0))
        seen = reds(gradient, uv=(x, x), p=(0, 0, x), width=width / BOX, reach=width / BOX)[0]
        assert abs(seen - reds(gradient, uv=uv, p=p).mean()) < 2e-4


def test_a_gradient_across_the_surface_is_sharp():
    """What runs along the normal does not change within the surface, however wide the footprint is."""
    gradient, p = sr.Gradient(**STOPS, along="y"), np.array([[0, y, 0] for y in np.linspace(-0.2, 1.2, 50)])
    np.testing.assert_allclose(reds(gradient, p=p, reach=5.0), reds(gradient, p=p), atol=1e-12)
    assert np.ptp(reds(gradient, p=p, reach=100.0, normal=(1.0, 0.0, 0.0))) < 0.05


@pytest.mark.parametrize(("wrap", "mean"), [("repeat", None), ("mirror", None), ("clamp", 0.55)])
def test_far_gradients_are_their_mean(wrap, mean):
    gradient = sr.Gradient(**STOPS, wrap=wrap)
    if mean is None:
        mean = reds(gradient, uv=np.column_stack([(np.arange(10_000) + 0.5) / 10_000] * 2)).mean()
    far = reds(gradient, uv=RNG.uniform(-50, 50, (100, 2)), width=np.inf)
    np.testing.assert_allclose(far, mean, atol=0.06 if wrap == "clamp" else 1e-3)
