"""Textures: what every one promises, and what each one says."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import sightray as sr
from sightray import spectra
from sightray._jit import kernel, native
from sightray.errors import FormatError, SceneError
from sightray.images import Image
from sightray.mathlib.bands import BANDS_WORDS, BLUE, GREEN, RED, WAVELENGTHS
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, f64_at, no_table, vec3_at, vec3_put
from sightray.registry import members
from sightray.scene.compile import Tables
from sightray.textures.base import Where, texture_value, value_at
from sightray.textures.bitmap import Bitmap
from sightray.textures.checker import Checker
from sightray.textures.constant import Constant
from sightray.textures.gradient import Gradient
from sightray.textures.marble import Marble
from sightray.textures.multiply import Multiply
from sightray.textures.noise import Noise
from sightray.textures.pyramid import pyramid
from sightray.textures.spectralcolor import SpectralColor
from sightray.textures.triplanar import Triplanar
from sightray.textures.uvtransform import UvTransform
from sightray.textures.wood import Wood

COLOURS = np.random.default_rng(5).uniform(0, 2, (3, 4, 3)).astype(np.float32)  # 4 wide, 3 high
MODES = [(f, w) for f in ("nearest", "bilinear", "trilinear") for w in ("repeat", "clamp", "mirror")]
EXAMPLES = {
    "Constant": [Constant(color=(1, 2, 3))],
    "Checker": [
        Checker(),
        Checker(even=(1, 2, 3), odd=Checker(scale=10, even=5), scale=3.3),
        Checker(mode="solid", scale=0.7, even=Bitmap(image=COLOURS)),
    ],
    "Bitmap": [Bitmap(image=COLOURS, filter=f, wrap=w, scale=(2, -1.5), offset=(0.1, 7)) for f, w in MODES],
    "Gradient": [
        Gradient(),
        Gradient(colors=[(0, 1, 0), (2, 0, 1), (0, 0, 3)], places=[0, 0.2, 0.9], along="z", begin=-1, end=3),
        Gradient(colors=[(1, 0, 0), (0, 1, 0), (0, 1, 1)], along="v", wrap="repeat", end=-0.7),
        Gradient(colors=[(1, 1, 0), (0, 1, 0)], along="y", wrap="mirror"),
    ],
    "Noise": [
        Noise(),
        Noise(mode="uv", turbulence=True, scale=3.1, dark=(1, 0, 0), light=Checker(), seed=7, octaves=3, gain=0.7),
    ],
    "Marble": [Marble(), Marble(direction=(1, 2, 3), scale=0.3, fold=1, sharpness=2, light=Bitmap(image=COLOURS))],
    "Wood": [Wood(), Wood(axis=(1, 0, 2), center=(3, 1, 0), scale=3, waviness=2, grain=1, seed=3)],
    "Triplanar": [
        Triplanar(x=Bitmap(image=COLOURS)),
        Triplanar(x=Bitmap(image=COLOURS), y=(0, 2, 1), z=Checker(scale=5), scale=0.7, sharpness=9),
    ],
    "UvTransform": [UvTransform(texture=Bitmap(image=COLOURS), scale=(2, -3), rotate=33, offset=(0.1, 4))],
    "Multiply": [Multiply(a=Bitmap(image=COLOURS), b=Multiply(a=0.5, b=Checker(scale=3)))],
    "SpectralColor": [SpectralColor(wavelengths=[400, 500, 600, 700], reflectances=[0.1, 0.7, 0.2, 0.9])],
}
EVERY = [pytest.param(t, id=f"{name}-{i}") for name, all_of in EXAMPLES.items() for i, t in enumerate(all_of)]


@kernel
def ask(texture: Table, count: i64, places: Table, colours: Table) -> i64:
    """`texture_value` at many places, each u, v, p, normal, width (9 of 16 words)."""
    for i in range(count):
        u, v, width = f64_at(places, 16 * i), f64_at(places, 16 * i + 1), f64_at(places, 16 * i + 8)
        where = Where(u, v, vec3_at(places, 16 * i + 2), vec3_at(places, 16 * i + 5), width, no_table())
        vec3_put(colours, 4 * i, texture_value(texture, where))
    return count


@kernel
def ask_spectrally(texture: Table, bands: Table, count: i64, places: Table, lanes: Table) -> i64:
    """`value_at` at many places, at the wavelengths of `bands`."""
    for i in range(count):
        u, v = f64_at(places, 16 * i), f64_at(places, 16 * i + 1)
        where = Where(u, v, vec3_at(places, 16 * i + 2), vec3_at(places, 16 * i + 5), 0.0, bands)
        vec3_put(lanes, 4 * i, value_at(texture, where))
    return count


def rows_of(places) -> np.ndarray:
    """(n, 2 to 9) places u, v, x, y, z, normal, width -> what the kernels read; the normal is +z unless given."""
    rows = np.zeros((len(places), 16))
    rows[:, 7] = 1.0
    rows[:, : np.shape(places)[1]] = places
    return rows


def colours_of(texture, places, compiled: bool = True) -> np.ndarray:
    """(n, 2 to 9) places u, v, x, y, z, normal, width -> (n, 3) colours."""
    rows = rows_of(places)
    tables = Tables()
    row = tables.row_of(texture)
    tables.prepare(ask, compiled=compiled)
    out = np.zeros((len(rows), 4))
    (native(ask) if compiled else ask)(row, len(rows), Table(rows), Table(out))
    return out[:, :3]


def test_no_texture_lacks_an_example():
    assert set(EXAMPLES) == {n for n, cls in members("textures").items() if cls.__module__.startswith("sightray.")}


def some_places(count: int, seed: int = 0) -> np.ndarray:
    """(n, 9) places all about, with unit normals and footprints of up to a unit of u."""
    generator = np.random.default_rng(seed)
    n = generator.normal(size=(count, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    return np.hstack([generator.uniform(-5, 5, (count, 5)), n, generator.uniform(0, 1, (count, 1))])


@pytest.mark.parametrize("texture", EVERY)
def test_machine_code_answers_as_python_does(texture):
    places = some_places(100)
    expected = colours_of(texture, places, compiled=False)
    assert np.isfinite(expected).all()
    np.testing.assert_allclose(colours_of(texture, places), expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("texture", EVERY)
@pytest.mark.parametrize("value", [1e300, -1e300, math.inf, math.nan])
def test_absurd_places_stay_within_the_texture(texture, value):
    colours_of(texture, np.full((1, 9), value))  # bilinear weights may be NaN there; memory must not be left


@pytest.mark.parametrize("value", [1e300, -1e300, 1e19, math.inf, -math.inf, math.nan])
@pytest.mark.parametrize("wrap", ["repeat", "clamp", "mirror"])
def test_the_nearest_texel_exists_for_any_number(wrap, value):
    found = colours_of(Bitmap(image=COLOURS, filter="nearest", wrap=wrap), [(value, value)])[0]
    assert found.astype(np.float32).tolist() in COLOURS.reshape(-1, 3).tolist()


def spectra_of(texture, places, nm, compiled: bool = True) -> np.ndarray:
    """Four lanes at the wavelengths `nm` for each place, (n, 4)."""
    rows, tables, out = rows_of(places), Tables(), np.zeros((len(places), 4))
    words = np.zeros(BANDS_WORDS)
    words[WAVELENGTHS : WAVELENGTHS + 4] = nm
    for lane, at in enumerate((RED, GREEN, BLUE)):
        words[at : at + 4] = [np.interp(x, spectra.WAVELENGTHS, spectra.basis()[:, lane]) for x in nm]
    row, bands = tables.row_of(texture), tables.space.array(words)
    tables.prepare(ask_spectrally, compiled=compiled)
    (native(ask_spectrally) if compiled else ask_spectrally)(row, bands, len(rows), Table(rows), Table(out))
    return out


NM = (420.0, 510.0, 570.0, 690.0)


@pytest.mark.parametrize("texture", EVERY)
def test_a_spectrum_is_that_of_the_colour_where_nothing_else_is_stated(texture):
    places = some_places(30, 3)
    places[:, 8] = 0
    found = spectra_of(texture, places, NM)
    np.testing.assert_allclose(found, spectra_of(texture, places, NM, compiled=False), rtol=1e-11, atol=1e-12)
    if isinstance(texture, SpectralColor):
        np.testing.assert_allclose(found, np.tile(texture.spectrum.at(NM), (30, 1)), rtol=1e-14)
    elif not isinstance(texture, Multiply):  # a product of spectra is another one than the spectrum of the product
        basis = np.array([[np.interp(x, spectra.WAVELENGTHS, lane) for x in NM] for lane in spectra.basis().T])
        np.testing.assert_allclose(found, colours_of(texture, places) @ basis, rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("wrap", [
    lambda t: Checker(even=t, odd=t), lambda t: Noise(dark=t, light=t), lambda t: Triplanar(x=t), lambda t: Multiply(a=t),
    lambda t: UvTransform(texture=t), lambda t: Wood(dark=t, light=t), lambda t: Marble(dark=t, light=t),
])  # fmt: skip
def test_a_measured_colour_keeps_its_spectrum_within_other_textures(wrap):
    color = SpectralColor(wavelengths=[400, 500, 600, 700], reflectances=[0.1, 0.7, 0.2, 0.9])
    found = spectra_of(wrap(color), some_places(10), NM)
    np.testing.assert_allclose(found, np.tile(color.spectrum.at(NM), (10, 1)), rtol=1e-12)


@pytest.mark.parametrize("texture", EVERY)
def test_yaml_keeps_every_texture(texture, tmp_path):
    scene = sr.Scene(sr.Sphere(material=sr.Phong(diffuse=texture)))
    sr.save(scene, tmp_path / "scene.yaml")
    again = sr.load(tmp_path / "scene.yaml").objects[0].material.diffuse
    places = some_places(20, 4)
    np.testing.assert_array_equal(colours_of(again, places), colours_of(texture, places))


def test_a_texture_of_numbers_reads_its_pictures_as_they_are(tmp_path):
    path = tmp_path / "half.png"
    Image(np.full((2, 2, 3), 0.5, np.float32)).save(path)  # sRGB: 188
    texture = Multiply(a=UvTransform(texture=Bitmap(image=path), scale=2), b=0.5)
    assert abs(colours_of(texture, [(0.5, 0.5)])[0, 0] - 0.25) < 0.002
    assert abs(colours_of(texture.as_numbers(), [(0.5, 0.5)])[0, 0] - 0.5 * 188 / 255) < 1e-6
    plain = Checker()
    assert plain.as_numbers() is plain


# --- Checker -------------------------------------------------------------------------------------------------------


def test_checker_alternates_along_u_and_v():
    places = [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75), (-0.25, 0.25), (-0.25, -0.25)]
    found = colours_of(Checker(even=1, odd=0, scale=2), places)[:, 0]
    assert found.tolist() == [1, 0, 0, 1, 0, 1]


def test_solid_checker_counts_three_axes_and_ignores_uv():
    cells = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)])
    places = np.column_stack([np.random.default_rng(1).uniform(-9, 9, (len(cells), 2)), cells + 0.5])
    found = colours_of(Checker(even=1, odd=0, mode="solid"), places)[:, 0]
    np.testing.assert_array_equal(found, (cells.sum(axis=1) + 1) % 2)


def test_a_solid_floor_does_not_flicker_between_cells():
    floor = np.zeros((50, 5))
    floor[:, 2], floor[:, 4] = 0.5, 0.5
    floor[:, 3] = np.random.default_rng(2).uniform(-1e-9, 1e-9, 50)
    assert (colours_of(Checker(even=1, odd=0, mode="solid"), floor) == 1).all()


def test_checkers_nest():
    outer = Checker(even=0, odd=Checker(even=1, odd=2, scale=4))
    assert colours_of(outer, [(0.1, 0.1), (1.1, 0.1), (1.3, 0.1)])[:, 0].tolist() == [0, 1, 2]


# --- Bitmap --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("filter", ["nearest", "bilinear"])
def test_texel_centres_are_exact_with_v_upwards(filter):
    places = [((x + 0.5) / 4, 1 - (y + 0.5) / 3) for y in range(3) for x in range(4)]
    found = colours_of(Bitmap(image=COLOURS, filter=filter), places)
    np.testing.assert_allclose(found, COLOURS.reshape(-1, 3), rtol=1e-14 if filter == "nearest" else 1e-12)


def test_the_top_row_is_at_v_1_and_the_left_column_at_u_0():
    picture = np.array([[1, 2], [3, 4]], dtype=float)  # grey, 1 2 on top
    corners = [(0.01, 0.99), (0.99, 0.99), (0.01, 0.01), (0.99, 0.01)]
    for filter in ("nearest", "bilinear"):
        found = colours_of(Bitmap(image=picture, filter=filter, wrap="clamp"), corners)
        assert found.tolist() == [[1] * 3, [2] * 3, [3] * 3, [4] * 3]


def test_bilinear_blends_by_distance():
    picture = np.array([[1, 2], [3, 4]], dtype=float)
    found = colours_of(Bitmap(image=picture), [(0.5, 0.5), (0.5, 0.75), (0.375, 0.75), (0.25, 0.5)])[:, 0]
    np.testing.assert_allclose(found, [2.5, 1.5, 1.25, 2.0], rtol=1e-14)


def test_bilinear_is_continuous_across_the_seam_of_a_repeated_picture():
    edge = [(1 - 1e-9, 0.3), (1 + 1e-9, 0.3), (0.3, 2 - 1e-9), (0.3, 2 + 1e-9)]
    a, b, c, d = colours_of(Bitmap(image=COLOURS), edge)
    np.testing.assert_allclose(a, b, atol=1e-6)
    np.testing.assert_allclose(c, d, atol=1e-6)


@pytest.mark.parametrize(("wrap", "columns"), [
    ("repeat", [2, 3, 0, 1, 2, 3, 0, 1]), ("clamp", [0, 0, 0, 1, 2, 3, 3, 3]), ("mirror", [1, 0, 0, 1, 2, 3, 3, 2]),
])  # fmt: skip
def test_what_lies_beyond_the_edges(wrap, columns):
    places = [((i + 0.5) / 4, 0.5) for i in range(-2, 6)]
    found = colours_of(Bitmap(image=COLOURS, filter="nearest", wrap=wrap), places)
    np.testing.assert_array_equal(found.astype(np.float32), COLOURS[1, columns])


def test_scale_and_offset_move_the_place_that_is_looked_up():
    places = np.random.default_rng(3).uniform(-1, 2, (50, 2))
    moved = colours_of(Bitmap(image=COLOURS, scale=(2, -3), offset=(0.25, 0.5)), places)
    np.testing.assert_allclose(moved, colours_of(Bitmap(image=COLOURS), places * (2, -3) + (0.25, 0.5)), atol=1e-12)
    assert Bitmap(image=COLOURS, scale=3).scale == (3.0, 3.0)


def areas(picture: np.ndarray, columns: int, rows: int) -> np.ndarray:
    """Means over a grid of equal parts, by brute force: each texel many times, so that parts hold whole ones."""
    h, w = picture.shape[:2]
    fine = picture.astype(float).repeat(rows, axis=0).repeat(columns, axis=1)
    return fine.reshape(rows, h, columns, w, 3).mean(axis=(1, 3))


def test_levels_of_a_pyramid_are_means_over_areas():
    picture = np.random.default_rng(6).uniform(0, 1, (6, 5, 3))
    sizes, texels = pyramid(picture)
    assert sizes.tolist() == [[5, 6, 0], [3, 3, 0], [2, 2, 9], [1, 1, 13]]
    np.testing.assert_allclose(texels[:9].reshape(3, 3, 3), areas(picture, 3, 3), rtol=1e-6)
    np.testing.assert_allclose(texels[9:13].reshape(2, 2, 3), areas(texels[:9].reshape(3, 3, 3), 2, 2), rtol=1e-6)
    np.testing.assert_allclose(texels[13], picture.mean(axis=(0, 1)), rtol=1e-6)


def test_trilinear_is_a_mean_over_the_footprint():
    """On the level whose texels are as wide as the footprint, at the middle of a texel: the mean over just that area."""
    picture = np.random.default_rng(7).uniform(0, 1, (32, 32, 3)).astype(np.float32)
    texture = Bitmap(image=picture, filter="trilinear", scale=2)
    for level in range(6):
        n = 32 >> level
        i, j = np.meshgrid(np.arange(n), np.arange(n))
        places = np.zeros((n * n, 9))
        places[:, 0], places[:, 1] = (i.ravel() + 0.5) / n / 2, (j.ravel() + 0.5) / n / 2
        places[:, 7], places[:, 8] = 1, 1 / n / 2  # in units of u, of which a picture has 1/2
        np.testing.assert_allclose(colours_of(texture, places).reshape(n, n, 3)[::-1], areas(picture, n, n), rtol=1e-5)
        places[:, 8] *= math.sqrt(2) if level < 5 else 99  # halfway to the next level, or beyond the last
        found = colours_of(texture, places)
        assert np.isfinite(found).all()
        assert found.mean() == pytest.approx(picture.mean(), rel=1e-4)
    sharp = [(0.1, 0.2, 0, 0, 0, 0, 0, 1, 0.0), (0.1, 0.2, 0, 0, 0, 0, 0, 1, 0.4 / 32)]
    expected = colours_of(texture.replace(filter="bilinear"), sharp)
    np.testing.assert_array_equal(colours_of(texture, sharp), expected)
    assert len(texture.replace(filter="bilinear").levels()[0]) == 1
    wide = np.tile([0.1, 0.2, 0, 0, 0, 0, 0, 1, 0.07], (1, 1))
    halved = wide * (2, 2, 1, 1, 1, 1, 1, 1, 2)
    np.testing.assert_array_equal(colours_of(texture, wide), colours_of(texture.replace(scale=1), halved))


def test_trilinear_has_no_jump_where_the_level_changes():
    texture = Bitmap(image=np.random.default_rng(8).uniform(0, 1, (16, 16, 3)), filter="trilinear")
    places = np.zeros((4000, 9))
    places[:, :2], places[:, 8] = (0.37, 0.81), np.geomspace(0.01, 2, 4000)
    assert np.abs(np.diff(colours_of(texture, places), axis=0)).max() < 0.002


def test_one_channel_is_grey_and_alpha_is_ignored():
    grey, with_alpha = COLOURS[..., :1], np.dstack([COLOURS, np.zeros((3, 4), np.float32)])
    assert (Bitmap(image=grey).pixels == np.repeat(grey, 3, axis=2)).all()
    assert (Bitmap(image=with_alpha).pixels == COLOURS).all()
    assert (Bitmap(image=Image(COLOURS)).pixels == COLOURS).all()


def test_a_file_is_decoded_to_linear_colours_unless_it_holds_numbers(tmp_path):
    path = tmp_path / "half.png"
    Image(np.full((2, 2, 3), 0.5, np.float32)).save(path)  # sRGB: 188
    assert abs(colours_of(Bitmap(image=path), [(0.5, 0.5)])[0, 0] - 0.5) < 0.003
    assert abs(colours_of(Bitmap(image=str(path), linear=True), [(0.5, 0.5)])[0, 0] - 188 / 255) < 1e-6


def test_a_later_change_of_the_array_does_not_reach_the_texture():
    picture = np.ones((2, 2, 3))
    texture = Bitmap(image=picture)
    picture[:] = 0
    assert (texture.pixels == 1).all()
    assert not texture.pixels.flags.writeable


@pytest.mark.parametrize("image", [COLOURS, "file"])
def test_plain_values_make_the_same_texture(image, tmp_path):
    if isinstance(image, str):
        image = tmp_path / "a.exr"
        Image(COLOURS).save(image)
    texture = Bitmap(image=image, wrap="mirror", scale=(1, 2))
    plain = {name: texture.fields[name].plain(value) for name, value in texture.values().items()}
    assert (Bitmap(**plain).pixels == texture.pixels).all()
    assert Bitmap(**plain).scale == (1.0, 2.0)


def test_a_broken_file_is_a_format_error_that_names_it(tmp_path):
    (tmp_path / "broken.png").write_bytes(b"not a picture")
    with pytest.raises(FormatError, match=r"broken\.png"):
        Bitmap(image=tmp_path / "broken.png")


@pytest.mark.parametrize(("make", "message"), [
    (lambda: Bitmap(image="no/such.png"), r"such\.png: no such file"),
    (lambda: Bitmap(image=Path("no/such.png")), r"such\.png: no such file"),
    (lambda: Bitmap(), r"Bitmap\.image: missing"),
    (lambda: Bitmap(image=np.zeros((2, 2, 2))), r"Bitmap\.image: .*shape \(2, 2, 2\).*1, 3 or 4 channels"),
    (lambda: Bitmap(image=np.zeros((2, 2, 3), np.uint8)), r"Bitmap\.image: .*uint8.*Divide uint8 values by 255"),
    (lambda: Bitmap(image=[[1.0], [1.0, 2.0]]), r"Bitmap\.image: .*path of a picture"),
    (lambda: Bitmap(image=np.full((2, 2), np.nan)), r"Bitmap\.image: the array holds infinite or undefined numbers"),
    (lambda: Bitmap(image=COLOURS, wrap="mirrored"), r"Bitmap\.wrap: unknown choice 'mirrored'; did you mean 'mirror'"),
    (lambda: Bitmap(image=COLOURS, scale=(1, 2, 3)), r"Bitmap\.scale: got \(1, 2, 3\); allowed: two finite numbers"),
    (lambda: Checker(scale=0), r"Checker\.scale: got 0; allowed: a finite number > 0"),
    (lambda: Checker(mode="xyz"), r"Checker\.mode: unknown choice 'xyz'.*solid, uv"),
    (lambda: Checker(even="red"), r"Checker\.even: got 'red'; allowed: a linear colour"),
])  # fmt: skip
def test_errors_say_where_what_and_what_is_allowed(make, message):
    with pytest.raises(SceneError, match=message):
        make()


# --- brightness ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("texture", [
    pytest.param(t, id=f"{name}{k}") for name, examples in EXAMPLES.items() for k, t in enumerate(examples)
])  # fmt: skip
def test_brightness_is_about_the_mean(texture):
    """Right to the last digit where a pattern has equal shares; else a lamp's guess."""
    places = np.zeros((40_000, 9))
    places[:, :5] = np.random.default_rng(2).uniform(-30, 30, (40_000, 5))
    places[:, 5] = places[:, 6] = places[:, 7] = math.sqrt(1 / 3)
    mean = colours_of(texture, places).mean()
    assert texture.brightness() == pytest.approx(mean, rel=0.02 if isinstance(texture, Checker | Constant) else 0.75)


def test_brightness_of_what_is_made_of_others():
    half = Checker(even=1, odd=0)
    assert half.brightness() == 0.5
    assert Multiply(a=half, b=(3, 0, 0)).brightness() == 0.5
    assert Bitmap(image=COLOURS).brightness() == pytest.approx(COLOURS.mean())
    assert Triplanar(x=half, z=Constant(color=2)).brightness() == pytest.approx(1.25)
    assert sr.Principled(emission=UvTransform(texture=half, scale=3)).glow == 0.5
    assert sr.Principled(emission=(1, 2, 3)).glow == 2
