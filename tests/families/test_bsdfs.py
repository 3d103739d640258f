"""Scattering distribution functions: samples, densities and values agree, light goes both ways alike, none is made."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest
from material_examples import EXAMPLES, index_behind

import sightray as sr
from sightray._jit import kernel, native
from sightray.materials.base import bsdf, sample_bsdf
from sightray.materials.metal import fresnel_metal
from sightray.mathlib.bands import BANDS_WORDS, BLUE, GREEN, RED, SINGLE, WAVELENGTHS, WHITE
from sightray.mathlib.frame import fresnel
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, f64_at, f64_put, vec3_at, vec3_put
from sightray.mathlib.vec import Vec3
from sightray.registry import members
from sightray.scene.compile import Tables
from sightray.textures.base import Where, anywhere


def test_every_material_has_an_example():
    own = {name for name, cls in members("materials").items() if cls.__module__.startswith("sightray.")}
    assert set(EXAMPLES) == own


@kernel
def ask_bsdf(material: Table, numbers: Table, count: i64, out: Table) -> None:
    where = anywhere(0.3, 0.4, Vec3(0.0, 0.0, 0.0))
    for k in range(count):
        wo = vec3_at(numbers, 8 * k)
        chosen = sample_bsdf(
            material, where, wo, f64_at(numbers, 8 * k + 4), f64_at(numbers, 8 * k + 5), f64_at(numbers, 8 * k + 6)
        )
        back, forth = bsdf(material, where, wo, chosen.wi), bsdf(material, where, chosen.wi, wo)
        vec3_put(out, 16 * k, chosen.wi)
        vec3_put(out, 16 * k + 4, chosen.weight)
        vec3_put(out, 16 * k + 8, back.value)
        f64_put(out, 16 * k + 12, chosen.density)
        f64_put(out, 16 * k + 13, back.density)
        f64_put(out, 16 * k + 14, forth.value.x)


def asked(material, wo, count, compiled=True, seed=1):
    rng = np.random.default_rng(seed)
    tables = Tables()
    row = tables.row_of(material)
    tables.prepare(ask_bsdf, compiled=compiled)
    numbers = np.zeros((count, 8))
    numbers[:, :3], numbers[:, 4:7] = wo, rng.random((count, 3))
    out = np.zeros((count, 16))
    (native(ask_bsdf) if compiled else ask_bsdf)(row, tables.space.array(numbers), count, tables.space.array(out))
    return out


EVERY = [pytest.param(m, id=f"{name}{k}") for name, some in EXAMPLES.items() for k, m in enumerate(some)]
VIEWERS = {
    "top": np.array([0.0, 0, 1]),
    "side": np.array([0.6, 0.0, 0.8]),
    "grazing": np.array([0.3, -0.9, 0.3]) / math.sqrt(0.99),
    "inside": np.array([0.6, 0, -0.8]),
}
SEEN = [pytest.param(w, id=name) for name, w in VIEWERS.items()]
TABLED = 0.015  # what the tables of lost energy are good for


@pytest.mark.parametrize("material", EVERY)
@pytest.mark.parametrize("wo", SEEN)
def test_samples_agree_with_values(material, wo):
    """weight * density = value; the density is the one that `bsdf` states; both orders of directions agree."""
    out = asked(material, wo, 2000)
    wi, weight, value = out[:, :3], out[:, 4:7], out[:, 8:11]
    assert np.isfinite(out).all()
    assert (out[:, 4:14] >= 0).all()
    np.testing.assert_allclose(np.linalg.norm(wi, axis=1), 1, rtol=1e-9)
    rough = out[:, 12] > 0
    np.testing.assert_allclose(weight[rough] * out[rough, 12:13], value[rough], rtol=1e-9, atol=1e-14)
    np.testing.assert_allclose(out[rough, 12], out[rough, 13], rtol=1e-9)
    # Helmholtz: n² f is symmetric, with the index on the viewer's side, so values over their cosines are.
    index = index_behind(material)
    back, forth = (np.where(z > 0, 1.0, index**2) for z in (np.full(len(wi), wo[2]), wi[:, 2]))
    np.testing.assert_allclose(
        back[rough] * value[rough, 0] / np.abs(wi[rough, 2]), forth[rough] * out[rough, 14] / abs(wo[2]), rtol=1e-7,
        atol=1e-12,
    )  # fmt: skip
    # No material sends back more than arrives: the mean weight is the albedo.
    assert (weight.mean(0) < 1 + 4 * weight.std(0) / math.sqrt(len(weight)) + TABLED).all()


@pytest.mark.parametrize("material", EVERY)
@pytest.mark.parametrize("z", [0.0, 1e-300, -1e-18, 1e-12])
def test_what_is_seen_along_the_surface_is_a_number(material, z):
    out = asked(material, np.array([0.6, 0.8, z]), 50)
    assert np.isfinite(out[:, :8]).all()
    assert (out[:, 4:7] >= 0).all()
    assert (out[:, 4:7] < 1e3).all()


SHARP = ("Phong2", "RoughGlass2", "RoughGlass3", "RoughGlass4", "Conductor3", "Conductor4", "Principled5", "Subsurface0")
DELTA = ("Mirror", "Glass", "ThinGlass", "BumpMap0", "Boundary", "Emitter")
BROAD = [p for p in EVERY if p.id not in SHARP and not p.id.startswith(DELTA)]


@pytest.mark.parametrize("material", BROAD)
@pytest.mark.parametrize("wo", SEEN)
def test_sampling_matches_its_density(material, wo):
    """Pearson's chi-square of sampled directions against the density that `bsdf` states, on a grid over the sphere."""
    count, rows, columns = 40_000, 10, 12
    out = asked(material, wo, count)
    wi = out[:, :3]
    chosen = out[:, 12] > 0
    cell = np.clip(((wi[:, 2] + 1) / 2 * rows).astype(int), 0, rows - 1) * columns
    cell += np.clip(((np.arctan2(wi[:, 1], wi[:, 0]) / math.pi + 1) / 2 * columns).astype(int), 0, columns - 1)
    seen = np.bincount(cell[chosen], minlength=rows * columns)
    # Integrate the density over each cell by importance: uniform directions, weighed.
    fine = 48
    z = (np.arange(rows * fine) + 0.5) / (rows * fine) * 2 - 1
    phi = ((np.arange(columns * fine) + 0.5) / (columns * fine) * 2 - 1) * math.pi
    z, phi = np.meshgrid(z, phi, indexing="ij")
    r = np.sqrt(1 - z * z)
    grid = np.stack([r * np.cos(phi), r * np.sin(phi), z], -1).reshape(-1, 3)
    density = densities(material, wo, grid).reshape(rows, fine, columns, fine).mean((1, 3)).ravel()
    density *= 4 * math.pi / (rows * columns)
    expected = density * count
    big = expected > 10
    statistic = ((seen[big] - expected[big]) ** 2 / expected[big]).sum()
    freedom = big.sum() - 1
    assert statistic < freedom + 4 * math.sqrt(2 * freedom) + 8
    assert seen[~big].sum() < expected[~big].sum() + 6 * math.sqrt(expected[~big].sum() + 1)


@kernel
def ask_density(material: Table, wo: Table, directions: Table, count: i64, out: Table) -> None:
    where = anywhere(0.3, 0.4, Vec3(0.0, 0.0, 0.0))
    for k in range(count):
        f64_put(out, k, bsdf(material, where, vec3_at(wo, 0), vec3_at(directions, 4 * k)).density)


def densities(material, wo, directions):
    tables = Tables()
    row = tables.row_of(material)
    tables.prepare(ask_density)
    packed = np.zeros((len(directions), 4))
    packed[:, :3] = directions
    out, viewer = np.zeros(len(directions)), np.append(wo, 0.0)
    array = tables.space.array
    native(ask_density)(row, array(viewer), array(packed), len(directions), array(out))
    return out


@pytest.mark.parametrize("material", EVERY)
@pytest.mark.parametrize("wo", [SEEN[1], SEEN[3]])
def test_machine_code_and_python_choose_the_same(material, wo):
    np.testing.assert_allclose(asked(material, wo, 20), asked(material, wo, 20, compiled=False), rtol=1e-8, atol=1e-12)


ANGLES = (0.0, 0.6, 1.2, 1.45, 1.55, math.pi - 1.5, math.pi - 0.9)


def directional_albedo(material, angle, count=22_500):
    """Mean weight of samples on an even grid, by channel; and its standard error, at most."""
    wo = np.array([0.8 * math.sin(angle), 0.6 * math.sin(angle), math.cos(angle)])
    weight = asked(material, wo, count, seed=3)[:, 4:7]
    return weight.mean(0), weight.std(0).max() / math.sqrt(count)


@pytest.mark.parametrize("roughness", [0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0])
@pytest.mark.parametrize("make", [
    pytest.param(lambda r: sr.Conductor(eta=0, k=1, roughness=r), id="metal"),
    pytest.param(lambda r: sr.Conductor(eta=0, k=1, roughness=r, distribution="beckmann"), id="beckmann"),
    pytest.param(lambda r: sr.Conductor(eta=0, k=1, roughness=r, anisotropy=0.8), id="brushed"),
    pytest.param(lambda r: sr.RoughGlass(roughness=r), id="glass"),
    pytest.param(lambda r: sr.RoughGlass(roughness=r, ior=0.6, distribution="beckmann"), id="bubble"),
    pytest.param(lambda r: sr.Principled(base_color=1, roughness=r), id="plastic"),
    pytest.param(lambda r: sr.Principled(base_color=1, metallic=1, roughness=r), id="white-metal"),
    pytest.param(lambda r: sr.Principled(base_color=1, transmission=1, roughness=r, ior=1.8), id="clear"),
    pytest.param(lambda r: sr.Principled(base_color=1, transmission=1, roughness=r, ior=1), id="clear-as-air"),
    pytest.param(lambda r: sr.Principled(base_color=1, roughness=r, ior=1), id="without-varnish"),
    pytest.param(lambda r: sr.Principled(base_color=1, transmission=1, roughness=r, thin_walled=True), id="sheet"),
    pytest.param(lambda r: sr.Principled(base_color=1, transmission=0.4, metallic=0.3, roughness=r), id="all"),
    pytest.param(lambda r: sr.Principled(base_color=1, metallic=1, roughness=r, anisotropy=0.7), id="brushed-base"),
    pytest.param(lambda r: sr.Principled(base_color=1, transmission=1, roughness=r, anisotropy=-0.7), id="brushed-clear"),
    pytest.param(lambda r: sr.Principled(base_color=1, roughness=r, ior=2, anisotropy=1), id="brushed-plastic"),
    pytest.param(lambda r: sr.OrenNayar(albedo=1, sigma=90 * r), id="matte"),
])  # fmt: skip
def test_white_furnace(make, roughness):
    """What absorbs nothing loses nothing, at any roughness and angle: the single bounce alone would lose up to 60 %."""
    material = make(roughness)
    for angle in ANGLES:
        albedo, error = directional_albedo(material, angle)
        assert abs(albedo - 1).max() < TABLED + 4 * error, angle
        assert error < 0.01


@pytest.mark.parametrize("roughness", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("sheen", [0.1, 0.4, 1.0])
def test_layers_make_no_light(roughness, sheen):
    material = sr.Principled(base_color=1, sheen=1, sheen_roughness=sheen, clearcoat=1, clearcoat_roughness=roughness,
                             roughness=roughness, metallic=0.5)  # fmt: skip
    for angle in ANGLES:
        albedo, error = directional_albedo(material, angle)
        assert albedo.max() < 1 + 0.005 + 4 * error
        assert albedo.min() > 0.7


def test_the_back_of_two_sided_answers_as_the_front():
    """What knows its sides, such as glass, shows the same one to both."""
    material = sr.TwoSided(material=sr.RoughGlass(roughness=0.6))
    front, back = asked(material, VIEWERS["side"], 200), asked(material, VIEWERS["inside"], 200)
    assert (front[:, 2] * back[:, 2] <= 0).all()
    np.testing.assert_allclose(front[:, [0, 1, 4, 8, 12, 13, 14]], back[:, [0, 1, 4, 8, 12, 13, 14]], rtol=1e-12)


@pytest.mark.parametrize("metal", [
    sr.Conductor(metal="Al", roughness=0.4, anisotropy=0.8),
    sr.Principled(metallic=1, roughness=0.4, anisotropy=0.8),
], ids=["Conductor", "Principled"])  # fmt: skip
def test_a_brushed_metal_has_highlights_along_u(metal):
    """Anisotropy above 0: facets vary more along the tangent than across it."""
    assert metal.oriented
    wi = asked(metal, VIEWERS["top"], 4000)[:, :2]
    wide, narrow = np.quantile(np.abs(wi), 0.5, axis=0)
    assert wide > 2.5 * narrow


# --- Fresnel, Snell, and measured indices ----------------------------------------------------------------------------

FRESNEL = [  # ORACLES: n, R at 0, 45 and 75 degrees
    (1.333, 0.02037319, 0.02789836, 0.21237758),
    (1.5, 0.04000000, 0.05023991, 0.25306056),
    (1.5168, 0.04216456, 0.05259507, 0.25614389),
    (2.4175, 0.17203986, 0.18118366, 0.33052122),
]


@pytest.mark.parametrize(("n", "head_on", "at_45", "at_75"), FRESNEL)
def test_metals_without_extinction_reflect_as_glass(n, head_on, at_45, at_75):
    for angle, expected in ((0, head_on), (45, at_45), (75, at_75)):
        cosine = math.cos(math.radians(angle))
        assert fresnel(cosine, 1 / n) == pytest.approx(expected, abs=1e-8)
        assert fresnel_metal(cosine, n, 0.0) == pytest.approx(expected, abs=1e-8)


def test_metals_reflect_by_the_complex_form_of_fresnels_equations():
    rng = np.random.default_rng(2)
    for n, k, cosine in rng.uniform((0.05, 0.05, 0.0), (4, 8, 1), (50, 3)):
        index = complex(n, k)
        inner = np.sqrt(index**2 - 1 + cosine**2)
        r_s = (cosine - inner) / (cosine + inner)
        r_p = (index**2 * cosine - inner) / (index**2 * cosine + inner)
        assert fresnel_metal(cosine, n, k) == pytest.approx((abs(r_s) ** 2 + abs(r_p) ** 2) / 2, rel=1e-10)


def test_gold_is_gold():
    """Head-on, the RGB of polished gold is that of its measured spectrum under D65, within the gamut."""
    weight = asked(sr.Conductor(metal="Au"), VIEWERS["top"], 1)[0, 4:7]
    assert weight[1:] == pytest.approx(sr.spectra.complex_index("Au").reflectance().rgb("D65")[1:], abs=2e-3)
    assert weight[0] > 0.9


@pytest.mark.parametrize("roughness", [0.0, 0.05])
def test_rough_glass_divides_light_as_smooth_glass_does(roughness):
    for angle, expected in ((0, 0.04), (45, 0.05023991), (75, 0.25306056)):
        wo = np.array([math.sin(math.radians(angle)), 0, math.cos(math.radians(angle))])
        out = asked(sr.RoughGlass(ior=1.5, roughness=roughness), wo, 40_000)
        assert (out[:, 2] > 0).mean() == pytest.approx(expected, abs=0.008)
        below = out[out[:, 2] < 0, :3]
        assert np.median(-below[:, 0]) == pytest.approx(wo[0] / 1.5, abs=0.002)  # Snell


def test_a_pane_sums_its_inner_reflections():
    """Both polarisations, term by term: the n-th pair of inner reflections is a² R² weaker than the one before."""
    tint, ior, angle = 0.7, 1.6, math.radians(50)
    cos_i, cos_t = math.cos(angle), math.sqrt(1 - (math.sin(angle) / ior) ** 2)
    a = tint ** (1 / cos_t)
    back = on = 0.0
    for r in ((cos_i - ior * cos_t) / (cos_i + ior * cos_t), (ior * cos_i - cos_t) / (ior * cos_i + cos_t)):
        share = r * r
        series = [(1 - share) ** 2 * a * (a * share) ** k for k in range(60)]  # leaves after k inner reflections
        on += sum(series[0::2]) / 2
        back += (share + sum(series[1::2])) / 2
    out = asked(sr.ThinGlass(ior=ior, tint=tint), np.array([math.sin(angle), 0, cos_i]), 60_000)
    up = out[:, 2] > 0
    assert out[up, 4].sum() / len(out) == pytest.approx(back, abs=0.006)
    assert out[~up, 4].sum() / len(out) == pytest.approx(on, abs=0.006)
    assert up.mean() * out[up, 4].mean() + (~up).mean() * out[~up, 4].mean() == pytest.approx(back + on, rel=1e-9)
    np.testing.assert_allclose(out[~up, :3], np.tile([-math.sin(angle), 0, -cos_i], (int((~up).sum()), 1)), atol=1e-15)


# --- spectral paths --------------------------------------------------------------------------------------------------


@kernel
def ask_in_bands(material: Table, bands: Table, wo: Table, numbers: Table, count: i64, out: Table) -> None:
    where = Where(0.3, 0.4, Vec3(0.0, 0.0, 0.0), Vec3(0.0, 0.0, 1.0), 0.0, bands)
    for k in range(count):
        f64_put(bands, SINGLE, 0.0)
        u, v, choice = f64_at(numbers, 3 * k), f64_at(numbers, 3 * k + 1), f64_at(numbers, 3 * k + 2)
        chosen = sample_bsdf(material, where, vec3_at(wo, 0), u, v, choice)
        single = f64_at(bands, SINGLE)
        f64_put(bands, SINGLE, 0.0)
        seen = bsdf(material, where, vec3_at(wo, 0), chosen.wi)
        vec3_put(out, 16 * k, chosen.wi)
        vec3_put(out, 16 * k + 4, chosen.weight)
        vec3_put(out, 16 * k + 8, seen.value)
        f64_put(out, 16 * k + 12, chosen.density)
        f64_put(out, 16 * k + 13, single)


def asked_in_bands(material, wavelengths, wo, count):
    """Answers of a path that follows four wavelengths; up-sampled colours are flat."""
    bands = np.zeros(BANDS_WORDS + 7)
    bands[WAVELENGTHS : WAVELENGTHS + 4] = wavelengths
    for word in (RED, GREEN, BLUE):
        bands[word : word + 4] = 1 / 3
    bands[WHITE : WHITE + 4] = 1
    tables = Tables()
    row = tables.row_of(material)
    tables.prepare(ask_in_bands)
    out, numbers, array = np.zeros((count, 16)), np.random.default_rng(4).random((count, 3)), tables.space.array
    native(ask_in_bands)(row, array(bands), array(np.append(wo, 0.0)), array(numbers), count, array(out))
    return out


LINES = np.array([450.0, 550.0, 620.0, 700.0])


@pytest.mark.parametrize(("material", "noise"), [
    (sr.Glass(ior="diamond"), 0.02),
    (sr.RoughGlass(ior="N-SF10", roughness=0.3), 0.03),
    (sr.Principled(base_color=1, transmission=1, roughness=0.3, ior=1.728, dispersion=0.9), 0.03),
])  # fmt: skip
def test_dispersive_glass_is_unbiased_in_every_wavelength(material, noise):
    """Over the four choices of hero, each wavelength is reflected by its own Fresnel share, and the rest passes."""
    angle = math.radians(40)
    wo = np.array([math.sin(angle), 0, math.cos(angle)])
    if isinstance(material.ior, str):
        index = sr.spectra.refractive_index(material.ior).at
    else:
        index = functools.partial(np.interp, xp=sr.spectra.WAVELENGTHS, fp=material.indices())
    up, down = np.zeros(4), np.zeros(4)
    for hero in range(4):
        out = asked_in_bands(material, np.roll(LINES, -hero), wo, 20_000)
        weight, above = np.roll(out[:, 4:8], hero, axis=1), out[:, 2] > 0
        up += weight[above].sum(0) / len(out) / 4
        down += weight[~above].sum(0) / len(out) / 4
        lost = ~above & (out[:, 4:8].max(1) > 0)
        assert (out[lost, 13] == 1).all()  # refracted light has one colour,
        assert (out[lost, 5:8] == 0).all()
        assert (out[above, 13] == 0).all()  # reflected light has all of them
        if type(material) is sr.Glass:
            expected = math.sin(angle) / index(LINES[hero])
            np.testing.assert_allclose(-out[lost, 0], expected, rtol=1e-4)  # tables hold whole nanometres
    shares = [fresnel(math.cos(angle), 1 / n) for n in index(LINES)]
    np.testing.assert_allclose(up, shares, atol=noise)
    np.testing.assert_allclose(up + down, 1, atol=noise)


@pytest.mark.parametrize("material", [
    sr.Glass(ior=1.5), sr.RoughGlass(ior=1.5, roughness=0.5), sr.ThinGlass(), sr.Principled(base_color=1, metallic=0.5),
    sr.Conductor(eta=0, k=1, roughness=0.5), sr.OrenNayar(albedo=1), sr.Lambert(albedo=1),
])  # fmt: skip
def test_what_is_white_in_rgb_is_white_in_all_four_lanes(material):
    out = asked_in_bands(material, LINES, VIEWERS["side"], 20_000)
    assert (out[:, 13] == 0).all()
    np.testing.assert_allclose(out[:, 5:8], np.tile(out[:, 4:5], (1, 3)), rtol=1e-12)
    np.testing.assert_allclose(out[:, 4].mean(), 1, atol=0.02)


def test_metals_reflect_each_wavelength_by_its_own_index():
    gold = sr.spectra.complex_index("Au")
    expected = [fresnel_metal(0.8, gold.n.at(nm), gold.k.at(nm)) for nm in LINES]
    smooth = asked_in_bands(sr.Conductor(metal="Au"), LINES, VIEWERS["side"], 1)
    np.testing.assert_allclose(smooth[0, 4:8], expected, rtol=1e-9)
    stated = asked_in_bands(sr.Conductor(eta=1.5, k=4), LINES, VIEWERS["side"], 1)
    np.testing.assert_allclose(stated[0, 4:8], fresnel_metal(0.8, 1.5, 4.0), rtol=1e-9)


@pytest.mark.parametrize("side", [1, -1])
def test_principled_glass_reflects_each_wavelength_by_its_own_index(side):
    """From outside and from inside; so smooth that hardly any light bounces between facets."""
    material = sr.Principled(base_color=1, transmission=1, roughness=0.1, ior=1.5, dispersion=5)
    wo = np.array([0.5, 0.0, side * math.sqrt(0.75)])
    out = asked_in_bands(material, LINES, wo, 20_000)
    mirrored = out[(out[:, 2] * side > 0) & (out[:, 12] > 0)][:200]
    assert len(mirrored) > 100
    m = wo + mirrored[:, :3]
    cosines = (m @ wo) / np.linalg.norm(m, axis=1)
    indices = np.interp(LINES, sr.spectra.WAVELENGTHS, material.indices())
    shares = np.array([[fresnel(c, 1 / n if side > 0 else n) for n in indices] for c in cosines])
    assert (np.ptp(shares, axis=1) > 0.1 * shares.max(axis=1)).mean() > 0.9
    np.testing.assert_allclose(mirrored[:, 8:12] / mirrored[:, 8:9], shares / shares[:, :1], rtol=0.02)


def test_a_turned_grain_is_the_same_grain_seen_by_turned_viewers():
    """And at right angles its highlights are long where they were short."""
    angle = math.radians(25)
    turn = np.array([[math.cos(angle), math.sin(angle), 0], [-math.sin(angle), math.cos(angle), 0], [0, 0, 1]])
    straight = sr.Principled(metallic=1, roughness=0.4, anisotropy=0.9)
    wo = np.array([0.3, -0.5, math.sqrt(1 - 0.34)])
    out = asked_in_bands(straight.replace(anisotropy_rotation=25), LINES, wo, 200)
    same = asked_in_bands(straight, LINES, turn @ wo, 200)
    np.testing.assert_allclose(out[:, :3] @ turn.T, same[:, :3], atol=1e-12)
    np.testing.assert_allclose(out[:, 8:13], same[:, 8:13], rtol=1e-9)
    head_on = np.array([0.0, 0.0, 1.0])
    along, across = (asked_in_bands(straight.replace(anisotropy_rotation=a), LINES, head_on, 4000)[:, :2].std(0)
                     for a in (0, 90))  # fmt: skip
    assert along[0] > 2 * along[1]
    np.testing.assert_allclose(along, across[::-1], rtol=0.05)


def test_values_that_lights_are_looked_up_with_do_not_mark_the_path():
    """`bsdf` of a dispersive boundary weighs the hero four times as `sample_bsdf` does, but chooses nothing."""
    out = asked_in_bands(sr.RoughGlass(ior="N-BK7", roughness=0.6), LINES, VIEWERS["side"], 500)
    rough = out[:, 12] > 0
    np.testing.assert_allclose(out[rough, 4:8] * out[rough, 12:13], out[rough, 8:12], rtol=1e-9, atol=1e-14)
