"""Which light is looked at: probabilities that add up, that agree with each other, and that leave no light out."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

import sightray as sr
from sightray._jit import kernel, native
from sightray.lights.base import illuminate
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, f64_at, f64_put, i64_put, vec3_at
from sightray.mathlib.vec import dot
from sightray.scene.compile import compile_scene
from sightray.scene.light_choice import choose_light, light_probability
from sightray.scene.light_tree import Cones, cone_measure, union
from sightray.scene.world import LIGHT_COUNT, light_at, light_count


@kernel
def choose(world: Table, count: i64, points: Table, numbers: Table, chances: Table) -> i64:
    """A light for each point, of 12 words: p, n, u; and with which probability it was said to be and is chosen."""
    for i in range(count):
        p, n = vec3_at(points, 12 * i), vec3_at(points, 12 * i + 4)
        chosen = choose_light(world, p, n, f64_at(points, 12 * i + 8))
        i64_put(numbers, i, chosen.light)
        f64_put(chances, 2 * i, chosen.probability)
        if chosen.light >= 0:
            f64_put(chances, 2 * i + 1, light_probability(world, p, n, chosen.light))
    return count


@kernel
def weigh(world: Table, count: i64, points: Table, chances: Table, light: Table) -> i64:
    """Probability of every light at each point, and the irradiance that comes from a sample of it."""
    lights = light_count(world)
    for i in range(count):
        p, n = vec3_at(points, 12 * i), vec3_at(points, 12 * i + 4)
        for k in range(lights):
            f64_put(chances, i * lights + k, light_probability(world, p, n, k))
            sample = illuminate(light_at(world, k), p, 0, f64_at(points, 12 * i + 8), 0.37)
            facing = dot(n, sample.direction) if dot(n, n) > 0.0 else 1.0
            brought = sample.irradiance
            f64_put(light, i * lights + k, max(0.0, facing) * (brought.x + brought.y + brought.z))
    return lights


def places(count: int, seed: int = 0, flat: bool = True) -> np.ndarray:
    rng = np.random.default_rng(seed)
    points = np.zeros((count, 12))
    points[:, :3] = rng.uniform(-6, 6, (count, 3))
    if flat:
        points[:, 4:7] = rng.normal(size=(count, 3))
        points[:, 4:7] /= np.linalg.norm(points[:, 4:7], axis=1, keepdims=True)
    points[:, 8] = rng.uniform(0, 1, count)
    return points


def chosen_in(scene, points, compiled: bool = True) -> tuple[np.ndarray, np.ndarray]:
    made = compile_scene(scene)
    made.tables.prepare(choose, compiled=compiled)
    numbers, chances = np.zeros(len(points), np.int64), np.zeros((len(points), 2))
    (native(choose) if compiled else choose)(made.world, len(points), Table(points), Table(numbers), Table(chances))
    return numbers, chances


def weighed_in(scene, points) -> tuple[np.ndarray, np.ndarray]:
    made = compile_scene(scene)
    made.tables.prepare(weigh)
    lights = int(made.world.view(np.int64)[LIGHT_COUNT])
    chances, light = np.zeros((2, len(points), lights))
    assert native(weigh)(made.world, len(points), Table(points), Table(chances), Table(light)) == lights
    return chances, light


def mixed(count: int, seed: int = 1) -> sr.Scene:
    """Lights of all kinds, some of them dark or in the same place, among surfaces that glow."""
    rng = np.random.default_rng(seed)
    lights = []
    for k in range(count):
        p, q = rng.uniform(-5, 5, (2, 3))
        d, e = rng.normal(size=(2, 3))
        brightness = rng.uniform(0, 3, 3) if k % 7 else 0
        lights.append([
            sr.PointLight(position=p, intensity=brightness),
            sr.SpotLight(position=p, target=q, angle=rng.uniform(5, 180), intensity=brightness),
            sr.RectangleLight(corner=p, edge_u=d, edge_v=e, radiance=brightness, two_sided=bool(k % 2)),
            sr.DiskLight(center=p, normal=d, radiance=brightness, radius=rng.uniform(0.01, 1)),
            sr.SphereLight(center=p, radius=0.2, radiance=brightness),
            sr.PointLight(position=(1, 1, 1), intensity=brightness),
        ][k % 6])  # fmt: skip
    mesh = sr.Mesh(vertices=rng.uniform(-4, 4, (12, 3)), faces=np.arange(12).reshape(4, 3),
                   material=sr.Emitter(radiance=(0, 2, 1)))  # fmt: skip
    return sr.Scene(mesh, sr.Disk(material=sr.Emitter()), sr.DirectionalLight(), sr.EnvironmentLight(), *lights)


SCENES = {
    "none": sr.Scene(sr.Sphere()),
    "one": sr.Scene(sr.PointLight(position=(0, 1, 0))),
    "sun": sr.Scene(sr.DirectionalLight()),
    "two": sr.Scene(sr.PointLight(position=(0, 1, 0)), sr.PointLight(position=(3, 1, 0), intensity=(0, 5, 0))),
    "suns": sr.Scene(sr.DirectionalLight(), sr.EnvironmentLight(), sr.DirectionalLight(direction=(1, 0, 0))),
    "dark": sr.Scene(*[sr.PointLight(position=(k, 1, 0), intensity=0) for k in range(5)]),
    "same": sr.Scene(*[sr.PointLight(position=(1, 2, 3)) for _ in range(40)]),
    "mixed": mixed(60),
}


@pytest.mark.parametrize("flat", [True, False])
@pytest.mark.parametrize("name", SCENES)
def test_what_is_said_of_a_light_that_was_chosen_is_true(name, flat):
    points = places(2000, flat=flat)
    numbers, chances = chosen_in(SCENES[name], points)
    if name == "none":
        assert (numbers == -1).all()
        return
    assert (chances > 0).all()
    np.testing.assert_allclose(chances[:, 1], chances[:, 0], rtol=1e-4)


@pytest.mark.parametrize("name", [name for name in SCENES if name != "none"])
def test_probabilities_add_up_and_leave_no_light_out_that_shines_here(name):
    for flat in (True, False):
        points = places(500, seed=4, flat=flat)
        chances, light = weighed_in(SCENES[name], points)
        np.testing.assert_allclose(chances.sum(axis=1), 1, rtol=1e-5)
        assert (chances[light > 0] > 0).all()
        assert name == "dark" or (light > 0).any()


def test_lights_are_chosen_as_often_as_said():
    points = places(40_000)
    points[:, :8] = points[5, :8]
    numbers, _ = chosen_in(SCENES["mixed"], points)
    (chances,), _ = weighed_in(SCENES["mixed"], points[:1])
    counts = np.bincount(numbers, minlength=len(chances))
    assert not counts[chances == 0].any()
    often = chances * len(points) > 10
    expected = np.append(chances[often], 1 - chances[often].sum()) * len(points)
    found = np.append(counts[often], counts[~often].sum())
    assert stats.chisquare(found[expected > 5], expected[expected > 5] * found[expected > 5].sum()
                           / expected[expected > 5].sum()).pvalue > 1e-3  # fmt: skip


def test_machine_code_chooses_as_python_does():
    points = places(60)
    numbers, chances = chosen_in(SCENES["mixed"], points)
    expected_numbers, expected = chosen_in(SCENES["mixed"], points, compiled=False)
    assert (numbers != expected_numbers).sum() <= 1  # clusters are compared in single precision
    same = numbers == expected_numbers
    np.testing.assert_allclose(chances[same], expected[same], rtol=1e-3)


def test_near_and_bright_lights_are_preferred_and_those_behind_are_not():
    scene = sr.Scene(*[sr.PointLight(position=p, intensity=i) for p, i in
                       [((0, 1, 0), 1), ((0, 5, 0), 1), ((3, 5, 0), 20), ((0, -1, 0), 1)]])  # fmt: skip
    points = np.zeros((1, 12))
    points[0, 5] = 1  # the normal is +y
    (chances,), _ = weighed_in(scene, points)
    assert chances[0] > 3 * chances[1]
    assert chances[2] > 3 * chances[1]
    assert chances[3] == 0
    points[0, 5] = 0
    (even,), _ = weighed_in(scene, points)
    assert even[3] == pytest.approx(even[0], rel=0.3)


def test_a_tree_over_a_thousand_lights_has_a_fraction_of_the_variance():
    """One light a sample: the second moment of light over probability, against that of an even choice."""
    rng = np.random.default_rng(3)
    lights = [sr.DiskLight(center=rng.uniform(-6, 6, 3), normal=rng.normal(size=3), radius=0.05,
                           radiance=rng.uniform(0, 9, 3)) for _ in range(1000)]  # fmt: skip
    chances, light = weighed_in(sr.Scene(*lights), places(400, seed=8))
    whole = light.sum(axis=1)
    seen = whole > 0
    by_tree = np.divide(light**2, chances, where=chances > 0, out=np.zeros_like(light)).sum(axis=1) / whole**2 - 1
    evenly = (light**2).sum(axis=1) * light.shape[1] / whole**2 - 1
    assert np.median((by_tree / evenly)[seen]) < 0.03
    assert by_tree[seen].mean() < 0.03 * evenly[seen].mean()


def test_unions_of_cones_contain_both():
    rng = np.random.default_rng(0)
    n = 2000
    axes = rng.normal(size=(2, n, 3))
    axes[1, : n // 4] = axes[0, : n // 4] * rng.choice([-1, 1], (n // 4, 1))
    axes /= np.linalg.norm(axes, axis=2, keepdims=True)
    half = rng.choice([0, 0.01, 0.7, 2.0, np.pi], (2, n))
    a, b = (Cones(axes[k], half[k], np.full(n, 1.5), np.ones(n)) for k in (0, 1))
    both = union(a, b)
    np.testing.assert_allclose(np.linalg.norm(both.axis, axis=1), 1, rtol=1e-9)
    for part in (a, b):
        between = np.arccos(np.clip((part.axis * both.axis).sum(axis=1), -1, 1))
        assert ((between + part.normals <= both.normals + 1e-6) | (both.normals >= np.pi)).all()
    smallest = 0.5 * (a.normals + b.normals + np.arccos(np.clip((a.axis * b.axis).sum(axis=1), -1, 1)))
    wanted = np.minimum(np.maximum.reduce([smallest, a.normals, b.normals]), np.pi)
    assert (both.normals <= wanted + 1e-6)[n // 4 :].all()


def test_measure_of_a_cone_is_its_integral():
    """2 pi times the integral over angles of the sine times the cosine of what lies beyond the cone."""
    for half in (0.0, 0.3, 1.2, 2.0, np.pi):
        angle = (np.arange(200_000) + 0.5) * np.pi / 200_000
        beyond = np.maximum(angle - half, 0)
        shone = np.where(beyond < np.pi / 2, np.cos(beyond), 0)
        expected = 2 * np.pi * (np.sin(angle) * shone).sum() * np.pi / 200_000
        assert cone_measure(np.array(np.cos(half))) == pytest.approx(expected, rel=1e-4)
