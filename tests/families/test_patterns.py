"""Procedural textures and textures made of others: what each one says."""

from __future__ import annotations

import math

import numpy as np
import pytest

import sightray as sr
from sightray import spectra
from sightray._jit import kernel, native
from sightray.errors import SceneError
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, f64_put, no_table, vec3_at, vec3_put
from sightray.mathlib.vec import Vec3
from sightray.scene.compile import Tables
from sightray.textures.base import Where, texture_value
from sightray.textures.perlin import FOLDED_MEAN, NEXT, noise, octaves_of


@kernel
def ask(texture: Table, count: i64, places: Table, colours: Table) -> i64:
    """`texture_value` at many places, each u, v, p, normal, width (9 of 16 words)."""
    for i in range(count):
        u, v, width = f64_at(places, 16 * i), f64_at(places, 16 * i + 1), f64_at(places, 16 * i + 8)
        where = Where(u, v, vec3_at(places, 16 * i + 2), vec3_at(places, 16 * i + 5), width, no_table())
        vec3_put(colours, 4 * i, texture_value(texture, where))
    return count


def colours_of(texture, p=None, *, uv=(0.0, 0.0), normal=(0.0, 0.0, 1.0), width=0.0) -> np.ndarray:
    """(n, 3) colours at points of the shape's space, or at texture coordinates."""
    count = max(np.size(p) // 3 if p is not None else 1, np.size(uv) // 2, np.size(normal) // 3)
    rows = np.zeros((count, 16))
    rows[:, :2], rows[:, 2:5], rows[:, 5:8], rows[:, 8] = uv, (0, 0, 0) if p is None else p, normal, width
    tables, out = Tables(), np.zeros((count, 4))
    row = tables.row_of(texture)
    tables.prepare(ask)
    native(ask)(row, count, Table(rows), Table(out))
    return out[:, :3]


@kernel
def noise_at(count: i64, p: Table, seed: i64, octaves: i64, width: f64, folded: i64, out: Table) -> i64:
    """Noise, or with octaves the sum of them, at many points."""
    for i in range(count):
        q = Vec3(f64_at(p, 3 * i), f64_at(p, 3 * i + 1), f64_at(p, 3 * i + 2))
        f64_put(out, i, noise(q, seed) if octaves == 0 else octaves_of(q, seed, octaves, 0.5, width, folded != 0))
    return count


def noises(p, seed: int = 0, octaves: int = 0, width: float = 0.0, folded: bool = False) -> np.ndarray:
    p = np.ascontiguousarray(p, np.float64)
    out = np.zeros(len(p))
    native(noise_at)(len(p), Table(p), seed, octaves, width, int(folded), Table(out))
    return out


RNG = np.random.default_rng(0)
ANYWHERE = RNG.uniform(-100, 100, (200_000, 3))
BLENDS = [sr.Noise, sr.Wood, sr.Marble]


# --- noise ---------------------------------------------------------------------------------------------------------


def test_noise_is_zero_on_the_lattice_and_smooth_across_its_cells():
    """Perlin 2002: the blend's first two derivatives vanish at the cells' faces, so noise and its slope have no jump."""
    assert (noises(RNG.integers(-50, 50, (1000, 3))) == 0).all()
    p, h = np.column_stack([np.full(2000, 7.0), RNG.uniform(-9, 9, (2000, 2))]), 1e-4
    before, at, after = (noises(p + np.array([dx, 0, 0])) for dx in (-h, 0, h))
    np.testing.assert_allclose((after - at) / h, (at - before) / h, atol=20 * h)
    steps = np.diff(noises(np.linspace((-5, 0.3, 0.7), (5, 0.9, 1.2), 100_001)))
    assert np.abs(steps).max() < 3e-4  # no slope is steeper than three


def test_noise_is_even_bounded_and_the_same_for_no_two_seeds():
    found = noises(ANYWHERE)
    assert np.abs(found).max() < 1.04
    assert abs(found.mean()) < 4 * found.std() / math.sqrt(len(found) / 8)
    assert np.abs(found).mean() == pytest.approx(FOLDED_MEAN, abs=3e-3)
    assert abs(np.corrcoef(found, noises(ANYWHERE, seed=1))[0, 1]) < 0.01
    assert abs(np.corrcoef(found, noises(ANYWHERE + 2 * np.eye(3)[0]))[0, 1]) < 0.01
    likeness = [np.corrcoef(found, noises(ANYWHERE + shift))[0, 1] for shift in 0.25 * np.eye(3)]
    assert 0.7 < min(likeness)
    assert max(likeness) - min(likeness) < 0.01  # no axis is preferred


def test_octaves_are_noise_ever_finer_and_weaker():
    p = ANYWHERE[:1000]
    expected = (noises(p) + 0.5 * noises(2 * p, NEXT) + 0.25 * noises(4 * p, 2 * NEXT)) / 1.75
    np.testing.assert_allclose(noises(p, 0, 3), expected, atol=1e-12)
    folded = (abs(noises(p)) + 0.5 * abs(noises(2 * p, NEXT))) / 1.5
    np.testing.assert_allclose(noises(p, 0, 2, folded=True), folded, atol=1e-12)


def test_octaves_that_a_footprint_hides_fade_to_their_mean():
    p = ANYWHERE[:1000]
    np.testing.assert_allclose(noises(p, 0, 3, width=0.5), noises(p) / 1.75, atol=1e-12)
    assert (noises(p, 0, 3, width=9.0) == 0).all()
    np.testing.assert_allclose(noises(p, 0, 3, width=9.0, folded=True), FOLDED_MEAN)


@pytest.mark.parametrize("kind", BLENDS)
def test_patterns_lie_between_their_colours_and_use_both(kind):
    found = colours_of(kind(dark=(0.1, 0.2, 0.3), light=(0.9, 0.6, 0.3)), ANYWHERE * 0.05)
    share = (found[:, 0] - 0.1) / 0.8
    assert -1e-12 < share.min() < 0.1
    assert 0.9 < share.max() < 1 + 1e-12
    np.testing.assert_allclose(found[:, 1], 0.2 + 0.4 * share, atol=1e-12)
    np.testing.assert_allclose(found[:, 2], 0.3, atol=1e-12)


@pytest.mark.parametrize("kind", BLENDS)
def test_patterns_are_continuous_and_follow_their_seed(kind):
    line = np.linspace((-1, 0.3, 0.7), (1, -0.4, 1.2), 200_001)
    found = colours_of(kind(dark=0, light=1), line)[:, 0]
    assert np.ptp(found) > 0.3
    assert np.abs(np.diff(found)).max() < 0.01
    assert np.abs(found - colours_of(kind(dark=0, light=1, seed=1), line)[:, 0]).max() > 0.2


def test_uv_noise_ignores_the_place_and_solid_noise_the_coordinates():
    uv, p = RNG.uniform(0, 9, (100, 2)), RNG.uniform(0, 9, (100, 3))
    flat, solid = sr.Noise(mode="uv", scale=2.5), sr.Noise(scale=2.5)
    assert (colours_of(flat, p, uv=uv) == colours_of(flat, uv=uv)).all()
    assert (colours_of(solid, p, uv=uv) == colours_of(solid, p)).all()
    np.testing.assert_allclose(colours_of(flat, uv=uv), colours_of(solid, np.column_stack([uv, np.zeros(100)])))


def test_marble_without_folds_is_even_layers():
    h = np.linspace(-2, 2, 101)
    found = colours_of(sr.Marble(dark=0, light=1, fold=0, sharpness=2, scale=0.5, direction=(0, 0, 3)),
                       np.column_stack([h * 0 + 3, h, h]))[:, 0]  # fmt: skip
    np.testing.assert_allclose(found, np.sin(math.pi * h / 2) ** 2, atol=1e-12)


def test_straight_wood_has_rings_about_its_axis():
    wood = sr.Wood(dark=0, light=1, waviness=0, grain=0, scale=4, center=(1, 2, 3), axis=(0, 0, 1))
    angles, r = RNG.uniform(0, 7, 500), RNG.uniform(0, 2, 500)
    p = np.column_stack([1 + r * np.cos(angles), 2 + r * np.sin(angles), RNG.uniform(-9, 9, 500)])
    along = np.column_stack([1 + r, 0 * r + 2, 0 * r])
    np.testing.assert_allclose(colours_of(wood, p), colours_of(wood, along), atol=1e-10)
    np.testing.assert_allclose(colours_of(wood, along), colours_of(wood, along + 0.25 * np.eye(3)[0]), atol=1e-9)
    assert colours_of(wood, [(1, 2, 0)])[0, 0] == 1  # a ring begins light
    assert colours_of(wood, [(1 + 0.82 / 4, 2, 0)])[0, 0] == pytest.approx(0)


# --- gradients -----------------------------------------------------------------------------------------------------


def test_gradients_pass_through_their_colours():
    colors, places = [(1, 0, 0), (0, 1, 0), (0, 0, 1)], [0.0, 0.25, 1.0]
    ramp = sr.Gradient(colors=colors, places=places, along="x", begin=2.0, end=6.0)
    x = np.array([-5, 2, 2.5, 3, 4.5, 6, 99.0])
    expected = [(1, 0, 0), (1, 0, 0), (0.5, 0.5, 0), (0, 1, 0), (0, 0.5, 0.5), (0, 0, 1), (0, 0, 1)]
    np.testing.assert_allclose(colours_of(ramp, np.column_stack([x, x * 0, x * 0])), expected, atol=1e-15)
    hard = sr.Gradient(colors=[0 * np.ones(3), np.ones(3)], places=[0.5, 0.5])
    assert colours_of(hard, uv=[(0.499, 0), (0.501, 0)])[:, 0].tolist() == [0, 1]
    assert colours_of(sr.Gradient(colors=[(1, 2, 3)]), uv=[(-1, 0), (2, 0)]).tolist() == [[1, 2, 3]] * 2


@pytest.mark.parametrize(("wrap", "expected"), [
    ("clamp", [0, 0, 0.25, 1, 1]), ("repeat", [0.75, 0.9, 0.25, 0.25, 0.5]), ("mirror", [0.75, 0.1, 0.25, 0.75, 0.5]),
])  # fmt: skip
def test_what_lies_beyond_a_gradient(wrap, expected):
    for along, column in (("u", 0), ("v", 1)):
        uv = np.zeros((5, 2))
        uv[:, column] = [-1.25, -0.1, 0.25, 1.25, 2.5]
        np.testing.assert_allclose(colours_of(sr.Gradient(wrap=wrap, along=along), uv=uv)[:, 0], expected, atol=1e-12)


# --- textures of textures ------------------------------------------------------------------------------------------

ARROW = np.zeros((8, 8, 3), np.float32)
ARROW[0, 4], ARROW[2, 7], ARROW[7, 4], ARROW[2, 0] = (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0)  # top, right, bottom, left


@pytest.mark.parametrize(("normal", "right", "up"), [
    ((1, 0, 0), (0, 0, -1), (0, 1, 0)), ((-1, 0, 0), (0, 0, 1), (0, 1, 0)),
    ((0, 1, 0), (1, 0, 0), (0, 0, -1)), ((0, -1, 0), (-1, 0, 0), (0, 0, -1)),
    ((0, 0, 1), (1, 0, 0), (0, 1, 0)), ((0, 0, -1), (-1, 0, 0), (0, 1, 0)),
])  # fmt: skip
def test_projected_pictures_stand_upright_and_are_not_mirrored(normal, right, up):
    """Seen from the side that a face looks to: `right` x `up` is the normal."""
    assert np.cross(right, up).tolist() == list(normal)
    image = sr.Bitmap(image=ARROW, filter="nearest")
    texture = sr.Triplanar(x=image, scale=0.5)
    uv = RNG.uniform(0, 1, (200, 2))
    p = 2 * (uv[:, :1] * np.array(right) + uv[:, 1:] * np.array(up)) + 5 * np.array(normal)
    np.testing.assert_array_equal(colours_of(texture, p, normal=normal), colours_of(image, uv=uv))


def test_projections_are_mixed_by_where_the_surface_faces():
    texture = sr.Triplanar(x=(1, 0, 0), y=(0, 1, 0), z=(0, 0, 1), sharpness=3)
    n = RNG.normal(size=(100, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    weights = np.abs(n) ** 3
    np.testing.assert_allclose(colours_of(texture, normal=n), weights / weights.sum(axis=1, keepdims=True), atol=1e-14)


def test_coordinates_are_scaled_turned_and_shifted_in_this_order():
    ramp = sr.Gradient(colors=[(0, 0, 0), (1, 1, 1)], begin=-100, end=100)
    for rotate, expected in [(0, lambda u, v: 2 * u + 0.3), (90, lambda u, v: 0.3 - 3 * v), (180, lambda u, v: 0.3 - 2 * u)]:
        texture = sr.UvTransform(texture=ramp, scale=(2, 3), rotate=rotate, offset=(0.3, 0.7))
        u, v = RNG.uniform(-1, 1, (2, 50))
        found = colours_of(texture, uv=np.column_stack([u, v]))[:, 0]
        np.testing.assert_allclose(found * 200 - 100, expected(u, v), atol=1e-11)


def test_a_footprint_grows_with_its_coordinates():
    picture = sr.Bitmap(image=RNG.uniform(0, 1, (64, 64, 3)), filter="trilinear")
    uv = RNG.uniform(0, 1, (50, 2))
    for rotate in (0, 30):
        texture = sr.UvTransform(texture=picture, scale=4, rotate=rotate)
        c, s = math.cos(math.radians(rotate)), math.sin(math.radians(rotate))
        moved = 4 * uv @ np.array([[c, s], [-s, c]])
        np.testing.assert_allclose(colours_of(texture, uv=uv, width=0.03), colours_of(picture, uv=moved, width=0.12),
                                   atol=1e-9)  # fmt: skip


def test_products():
    uv = RNG.uniform(0, 1, (20, 2))
    picture = sr.Bitmap(image=ARROW)
    found = colours_of(sr.Multiply(a=picture, b=(2, 0.5, 1)), uv=uv)
    np.testing.assert_allclose(found, colours_of(picture, uv=uv) * (2, 0.5, 1))


def test_a_measured_colour_has_its_daylight_colour_in_rgb():
    flat = sr.SpectralColor(wavelengths=[400, 700], reflectances=[0.3, 0.3])
    np.testing.assert_allclose(colours_of(flat), [(0.3, 0.3, 0.3)], atol=1e-6)
    red = spectra.colorchecker()["red"]
    np.testing.assert_allclose(colours_of(sr.SpectralColor.of(red))[0], np.maximum(red.rgb("D65"), 0), atol=1e-12)


# --- in pictures ---------------------------------------------------------------------------------------------------


def test_a_tiled_floor_to_the_horizon_has_no_moire():
    """With mip-mapping one sample a pixel is near the mean of 256 without it; without it, far from it."""
    tiles = np.kron(np.indices((8, 8)).sum(0) % 2, np.ones((8, 8)))[..., None].astype(np.float32)

    def picture(filter, samples):
        material = sr.Phong(diffuse=0, specular=0, ambient=sr.Bitmap(image=tiles, filter=filter, scale=60))
        floor = sr.Rectangle(corner=(-100, 0, 30), edge_u=(200, 0, 0), edge_v=(0, 0, -200), material=material)
        camera = sr.PerspectiveCamera(eye=(0, 2, 20), target=(0, 0, 0), width=100, height=60)
        return np.asarray(sr.render(sr.Scene(floor, camera=camera, ambient=1.0), sr.Whitted(), samples=samples))[25:, :, 0]

    converged = picture("bilinear", 256)
    aliased, filtered = (picture(name, 1) for name in ("bilinear", "trilinear"))
    far = slice(0, 12)
    assert np.sqrt(np.mean((filtered - converged)[far] ** 2)) < 0.12
    assert np.sqrt(np.mean((aliased - converged)[far] ** 2)) > 0.4


@pytest.mark.parametrize(("make", "message"), [
    (lambda: sr.Gradient(colors=np.zeros((0, 3))), r"Gradient\.colors: allowed: one or more colours"),
    (lambda: sr.Gradient(places=[1, 0]), r"Gradient\.places: got \[1\.0, 0\.0\] for 2 colours; allowed: as many, asc"),
    (lambda: sr.Gradient(begin=1, end=1), r"Gradient\.end: got 1, which is begin"),
    (lambda: sr.Noise(octaves=0), r"Noise\.octaves: got 0"),
    (lambda: sr.Noise(light="red"), r"Noise\.light: got 'red'; allowed: a linear colour"),
    (lambda: sr.Marble(direction=(0, 0, 0)), r"Marble\.direction: got .*not all zero"),
    (lambda: sr.Triplanar(), r"Triplanar\.x: missing"),
    (lambda: sr.SpectralColor(wavelengths=[400], reflectances=[1, 2]), r"1 wavelengths and 2 values"),
    (lambda: sr.SpectralColor(wavelengths=[400, 500], reflectances=[1, 2]), r"SpectralColor\.reflectances: got numbers out"),
    (lambda: sr.UvTransform(texture=1, scale="x"), r"UvTransform\.scale: got 'x'"),
])  # fmt: skip
def test_errors_say_where_what_and_what_is_allowed(make, message):
    with pytest.raises(SceneError, match=message):
        make()
