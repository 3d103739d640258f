"""The forms for eight paths against those for one: all materials and lights that have them, found by themselves."""

from __future__ import annotations

import math

import numpy as np
import pytest

import sightray as sr
from sightray._jit import kernel, native
from sightray.fields import REQUIRED, Choice, ColorField, Flag, Integer, Number, Vector
from sightray.lights.base import (
    WHOLE,
    density_eight,
    direction_density,
    illuminate,
    illuminate_eight,
    sky,
    sky_eight,
)
from sightray.materials.base import Material, bsdf, bsdf_eight, sample_bsdf, sample_eight
from sightray.mathlib.eight_functions import atan2_8, exp8, log8, pow8
from sightray.mathlib.eight_paths import lane_at, load8v, put_lane, store8v
from sightray.mathlib.eights import abs8d, load8d, load8i, store8d
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, advance, aligned, f64_at, f64_put, i64_at
from sightray.mathlib.vec import Vec3
from sightray.registry import members
from sightray.scene.compile import Tables
from sightray.textures.base import Textured, anywhere

# What chance makes too seldom: panels so near that they are cut by solid angles, and a sky without a picture.
PANEL = {"corner": (-2, 0.5, -1.5), "edge_u": (4, 0, 0), "edge_v": (0, 0, 3)}
MORE = {
    "RectangleLight": [sr.RectangleLight(**PANEL), sr.RectangleLight(**PANEL, two_sided=True, visible=False)],
    "EnvironmentLight": [sr.EnvironmentLight(radiance=(1, 2, 3))],
}
PARAMETERS, EIGHTS = 40, 1200  # members of a class, and eights that are asked
NEAR, FAR = 1e-9, 1e-6  # relative differences that a hundredth, and a thousandth, may have: what rounding decides


def own_forms(family, base, form):
    """The members of a family that have a form of their own."""
    default = base.kernels.get(form)
    return [cls for cls in members(family).values() if cls.kernels.get(form) not in (None, default)]


# ------------------------------------------------------------------------------------------------------------ members


def some_value(name, field, rng):
    """A value for a field: often one at an end of what is allowed."""
    if name == "image":
        return rng.random((int(rng.integers(1, 9)), int(rng.integers(1, 9)), 3)) ** 3 * (rng.random((1, 1, 3)) < 0.8)
    if isinstance(field, Textured):
        value = float(rng.choice([0.0, 1.0, 0.5, rng.random()]))
        return value if rng.random() < 0.5 else tuple((value * rng.random(3)).tolist())
    if isinstance(field, Flag):
        return bool(rng.random() < 0.5)
    if isinstance(field, Choice):
        return str(rng.choice(field.options))
    if isinstance(field, Number) and not isinstance(field, Integer):
        ends = [bound for bound, sign in field.bounds if bound is not None and "=" in sign]
        usual = 0.7 if field.default is REQUIRED else field.default
        return float(rng.choice([*ends, usual, 0.6 * usual + 0.4 * (ends[-1] if ends else 2.0), 1.3]))
    if isinstance(field, ColorField):
        return tuple(rng.choice([0.0, 1.0, 0.3], 3).tolist())
    if isinstance(field, Vector):  # anywhere, or along an axis, so that some are at right angles to others
        return tuple((rng.normal(size=3) * rng.choice([(1, 1, 1), *np.eye(3)])).tolist())
    return field.default


def some_members(cls, rng, count):
    """Members of a class with values all over what is allowed."""
    found = []
    while len(found) < count:
        chosen = {name: field for name, field in cls.given.items() if field.default is REQUIRED or rng.random() < 0.6}
        try:
            found.append(cls(**{name: some_value(name, field, rng) for name, field in chosen.items()}))
        except sr.SceneError:  # fields that contradict one another
            continue
    return found


def directions(rng, n):
    """Unit vectors of all kinds: anywhere, nearly along the surface, and straight up or down."""
    d = rng.normal(size=(n, 3))
    kind = rng.random(n)
    d[kind < 0.2, 2] *= 10.0 ** rng.uniform(-5, 0, (kind < 0.2).sum())
    d[kind > 0.97, :2] = 0.0
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def in_eights(*columns):
    """Numbers of n paths, (n,) or (n, 3), in blocks of eight: all x of a block, then all y and z, then the next."""
    blocks = []
    for column in columns:
        column = np.asarray(column, np.float64)
        blocks.append(column.reshape(len(column) // 8, 8, -1).transpose(0, 2, 1).reshape(len(column) // 8, -1))
    block = np.concatenate(blocks, axis=1)
    found = aligned(block.shape, np.float64)
    found[:] = block
    return found


def assert_near(eight, one, what):
    """The same numbers, but for rounding: (n, k) each, whose columns belong together."""
    same = (eight == one) | (np.isnan(eight) & np.isnan(one))
    with np.errstate(invalid="ignore", over="ignore"):
        size = np.abs(one).max(axis=1, keepdims=True)
        off = np.where(same, 0.0, np.abs(eight - one) / (size + 1e-290)).max(axis=1)
    off = np.where(np.isnan(off), np.inf, off)
    assert (off > NEAR).mean() <= 0.01, f"{what}: {(off > NEAR).mean():.4f} differ"
    assert (off > FAR).mean() <= 0.001, f"{what}: {(off > FAR).mean():.4f} differ, by up to {off.max():.3g}"


# ---------------------------------------------------------------------------------------------------------- materials

WORDS = 88  # of a block: rows, wo, wi, u, v, choice


@kernel
def materials_wide(material: Table, blocks: Table, n: i64, out: Table) -> None:
    """Samples and values of n eights."""
    for k in range(n):
        block, to = advance(blocks, WORDS * k), advance(out, WORDS * k)
        rows, wo = load8i(block, 0), load8v(block, 8)
        sample = sample_eight(material, rows, wo, load8d(block, 56), load8d(block, 64), load8d(block, 72))
        value = bsdf_eight(material, rows, wo, load8v(block, 32))
        store8v(to, 0, sample.wi)
        store8v(to, 24, sample.weight)
        store8d(to, 48, sample.density)
        store8v(to, 56, value.value)
        store8d(to, 80, value.density)


@kernel
def materials_narrow(material: Table, blocks: Table, n: i64, out: Table) -> None:
    """The same, one after the other."""
    where = anywhere(0.0, 0.0, Vec3(0.0, 0.0, 0.0))
    for i in range(8 * n):
        block, to, k = advance(blocks, WORDS * (i // 8)), advance(out, WORDS * (i // 8)), i % 8
        row, wo = advance(material, i64_at(block, k)), lane_at(block, 8 + k)
        sample = sample_bsdf(row, where, wo, f64_at(block, 56 + k), f64_at(block, 64 + k), f64_at(block, 72 + k))
        value = bsdf(row, where, wo, lane_at(block, 32 + k))
        put_lane(to, k, sample.wi)
        put_lane(to, 24 + k, sample.weight)
        f64_put(to, 48 + k, sample.density)
        put_lane(to, 56 + k, value.value)
        f64_put(to, 80 + k, value.density)


class Answers:
    """What n paths are told: directions, weights and densities of samples, and values and densities."""

    def __init__(self, out):
        wi, weight, density, value, chance = np.split(out.reshape(-1, WORDS // 8, 8), [3, 6, 7, 10], axis=1)
        self.wi, self.weight, self.value = (x.transpose(0, 2, 1).reshape(-1, 3) for x in (wi, weight, value))
        self.density, self.chance = density.reshape(-1, 1), chance.reshape(-1, 1)


class Asked:
    """Many members of a class, ready to be asked."""

    def __init__(self, cls, rng):
        self.tables = Tables()
        rows = [self.tables.row_of(member) for member in some_members(cls, rng, PARAMETERS)]
        self.first = rows[0]
        self.words = np.array([(row.address - rows[0].address) // 8 for row in rows])
        for root in (materials_wide, materials_narrow):
            self.tables.prepare(root)

    def ask(self, root, which, wo, wi, numbers):
        blocks = in_eights(np.zeros(len(wo)), wo, wi, numbers, np.zeros(len(wo)))
        blocks.view(np.int64)[:, :8] = self.words[which].reshape(-1, 8)
        out = aligned(blocks.shape, np.float64)
        native(root)(self.first, Table(blocks), len(blocks), Table(out))
        return Answers(out[:, :WORDS])


@pytest.mark.parametrize("cls", own_forms("materials", Material, sample_eight), ids=lambda cls: cls.__name__)
def test_materials_answer_eight_paths_as_they_answer_one(cls):
    rng, n = np.random.default_rng(1), 8 * EIGHTS
    asked = Asked(cls, rng)
    which, wo, wi, numbers = rng.integers(0, PARAMETERS, n), directions(rng, n), directions(rng, n), rng.random((n, 3))
    lobes = asked.ask(materials_narrow, which, wo, wi, rng.random((n, 3))).wi
    wi = np.where(rng.random((n, 1)) < 0.7, lobes, wi)  # where the values are large
    one, eight = (asked.ask(root, which, wo, wi, numbers) for root in (materials_narrow, materials_wide))
    assert_near(eight.wi, one.wi, "directions")
    assert_near(eight.weight, one.weight, "weights")
    assert_near(eight.density, one.density, "densities of samples")
    assert_near(eight.value, one.value, "values")
    assert_near(eight.chance, one.chance, "densities")
    assert (one.weight > 0).any() or cls.kernels[sample_bsdf] is Material.kernels[sample_bsdf]

    # Lanes that ask for nothing sensible change nothing for the others.
    senseless = rng.random(n) < 0.3
    nothing = rng.choice([np.nan, np.inf, 0.0, -1e300, 7.0], (n, 3))
    mixed = asked.ask(
        materials_wide, np.where(senseless, 0, which), np.where(senseless[:, None], nothing, wo),
        np.where(senseless[:, None], nothing, wi), numbers,
    )  # fmt: skip
    for name in ("wi", "weight", "density", "value", "chance"):
        np.testing.assert_allclose(getattr(mixed, name)[~senseless], getattr(eight, name)[~senseless], rtol=1e-12)


# ------------------------------------------------------------------------------------------------------------- lights

LIGHT_WORDS, LIT_WORDS = 72, 104  # of a block: points, directions, u, v, distances; and of the answers


@kernel
def lights_wide(light: Table, blocks: Table, n: i64, out: Table) -> None:
    """Samples, skies and densities of n eights; densities of the samples' directions, too."""
    for k in range(n):
        block, to = advance(blocks, LIGHT_WORDS * k), advance(out, LIT_WORDS * k)
        p, d, distance = load8v(block, 0), load8v(block, 24), load8d(block, 64)
        sample = illuminate_eight(light, p, load8d(block, 48), load8d(block, 56))
        store8v(to, 0, sample.direction)
        store8v(to, 24, sample.irradiance)
        store8d(to, 48, sample.distance)
        store8d(to, 56, sample.density)
        store8v(to, 64, sky_eight(light, d))
        store8d(to, 88, density_eight(light, p, d, distance))
        store8d(to, 96, density_eight(light, p, sample.direction, sample.distance))


@kernel
def lights_narrow(light: Table, blocks: Table, n: i64, out: Table) -> None:
    """The same, one after the other."""
    for i in range(8 * n):
        block, to, k = advance(blocks, LIGHT_WORDS * (i // 8)), advance(out, LIT_WORDS * (i // 8)), i % 8
        p, d, distance = lane_at(block, k), lane_at(block, 24 + k), f64_at(block, 64 + k)
        sample = illuminate(light, p, WHOLE, f64_at(block, 48 + k), f64_at(block, 56 + k))
        put_lane(to, k, sample.direction)
        put_lane(to, 24 + k, sample.irradiance)
        f64_put(to, 48 + k, sample.distance)
        f64_put(to, 56 + k, sample.density)
        put_lane(to, 64 + k, sky(light, d))
        f64_put(to, 88 + k, direction_density(light, p, d, distance))
        f64_put(to, 96 + k, direction_density(light, p, sample.direction, sample.distance))


@pytest.mark.parametrize("cls", members("lights").values(), ids=lambda cls: cls.__name__)
def test_lights_answer_eight_points_as_they_answer_one(cls):
    rng, n = np.random.default_rng(2), 8 * EIGHTS // 10
    tables = Tables()
    lights = some_members(cls, rng, PARAMETERS // 4) + MORE.get(cls.__name__, [])
    rows = [tables.row_of(light) for light in lights]
    for root in (lights_wide, lights_narrow):
        tables.prepare(root)
    found = []
    for row in rows:
        p = rng.normal(size=(n, 3)) * 10.0 ** rng.uniform(-1, 1, (n, 1))
        blocks = in_eights(p, directions(rng, n), rng.random((n, 2)), rng.uniform(0, 5, n))
        out = [aligned((n // 8, LIT_WORDS), np.float64) for _ in range(2)]
        for root, answers in zip((lights_wide, lights_narrow), out, strict=True):
            native(root)(row, Table(blocks), n // 8, Table(answers))
        found.append([x.reshape(n // 8, LIT_WORDS // 8, 8).transpose(0, 2, 1).reshape(n, -1) for x in out])
    eight, one = (np.concatenate(part) for part in zip(*found, strict=True))
    parts = {"directions": [0, 1, 2], "irradiances": [3, 4, 5], "distances": [6], "densities of samples": [7],
             "skies": [8, 9, 10], "densities": [11], "densities of the samples' directions": [12]}  # fmt: skip
    for what, columns in parts.items():
        assert_near(eight[:, columns], one[:, columns], what)
    assert (one[:, 3:6] > 0).any()


# --------------------------------------------------------------------------------------------------------------- skies


def test_a_sky_is_drawn_with_the_density_that_it_states():
    rng, n = np.random.default_rng(3), 8 * EIGHTS
    picture = rng.random((60, 110, 3)) ** 6
    picture[:7] = picture[30:33, 50:] = 0.0
    light = sr.EnvironmentLight(image=picture, transform=sr.Transform.rotate((1, 2, 3), 50))
    tables = Tables()
    row = tables.row_of(light)
    tables.prepare(lights_wide)
    blocks = in_eights(np.zeros((n, 3)), directions(rng, n), rng.random((n, 2)), np.zeros(n))
    blocks[5, 24:48], blocks[6, 24:48] = np.nan, np.inf  # rays that are not there
    out = aligned((n // 8, LIT_WORDS), np.float64)
    native(lights_wide)(row, Table(blocks), n // 8, Table(out))
    drawn, stated = out[:, 56:64].ravel(), out[:, 96:].ravel()
    assert (drawn > 0).all()
    assert (np.abs(drawn - stated) > 1e-9 * drawn).mean() < 1e-3  # a direction at an edge may be the neighbour's


# --------------------------------------------------------------------------------------------------------------- angles


@kernel
def angles(points: Table, n: i64, out: Table) -> None:
    """The angles of n eights of points, y and x."""
    for k in range(n):
        store8d(out, 8 * k, atan2_8(load8d(points, 16 * k), load8d(points, 16 * k + 8)))


def test_angles_are_right_to_two_units_in_the_last_place():
    rng = np.random.default_rng(4)
    some = np.concatenate(
        [rng.normal(size=(20000, 2)), rng.normal(size=(4000, 2)) * 10.0 ** rng.uniform(-9, 9, (4000, 2))]
    )
    ends = np.array([0.0, -0.0, 1.0, -1.0, 1e-300, -3.0, math.sqrt(2) - 1, 1 - math.sqrt(2)])
    y, x = np.concatenate([some, np.stack(np.meshgrid(ends, ends), axis=-1).reshape(-1, 2)]).T
    points, out = in_eights(y, x), aligned((len(x),), np.float64)
    native(angles)(Table(points), len(x) // 8, Table(out))
    true = np.array([math.atan2(*pair) for pair in zip(y, x, strict=True)])
    assert (np.abs(out - true) <= 2 * np.spacing(np.abs(true))).all()
    np.testing.assert_array_equal(np.signbit(out), np.signbit(true))


@kernel
def powers(points: Table, n: i64, out: Table) -> None:
    """Of n eights of pairs x, y: e^x, log |x|, |x|^y."""
    for k in range(n):
        x, y = load8d(points, 16 * k), load8d(points, 16 * k + 8)
        store8d(out, 24 * k, exp8(x))
        store8d(out, 24 * k + 8, log8(abs8d(x)))
        store8d(out, 24 * k + 16, pow8(abs8d(x), y))


def test_powers_and_logarithms_are_those_of_numpy():
    rng = np.random.default_rng(5)
    sizes = 10.0 ** rng.uniform(-12, 2.84, 8000)
    x = np.concatenate(
        [rng.choice([-1, 1], 8000) * sizes, rng.uniform(0.5, 2, 4000), [1, -1, 709, -708, 5, 1e-300, 0.5, 2]]
    )
    y = np.concatenate([rng.normal(size=8000) * 3, rng.uniform(0, 900, 4000), [0, 1, 2, -2, 0, 0.5, 1e-300, -0.5]])
    points, out = in_eights(x, y), aligned((len(x) // 8, 24), np.float64)
    native(powers)(Table(points), len(points), Table(out))
    exp, log, power = (column.ravel() for column in np.split(out, 3, axis=1))
    np.testing.assert_allclose(exp, np.exp(x), rtol=1e-15)
    np.testing.assert_allclose(log, np.log(np.abs(x)), rtol=3e-16, atol=3e-16)
    with np.errstate(under="ignore"):
        true = np.abs(x) ** y
    np.testing.assert_allclose(power, true, rtol=3e-13, atol=1e-306)

    # Ends: zero, and what no double holds.
    x = np.array([-710.0, -np.inf, 710.0, np.inf, 0.0, 0.0, 0.0, 1e-310])
    points, out = in_eights(x, np.array([1.0, 1.0, 1.0, 1.0, 0.0, 0.3, 5.0, 2.0])), np.empty(24)
    native(powers)(Table(points), 1, Table(out))
    np.testing.assert_array_equal(out[:5], [0, 0, np.inf, np.inf, 1])
    np.testing.assert_array_equal(out[20:], [1, 0, 0, 0])
