"""Surfaces that glow are looked for like lamps: as many, as bright and as exact as if a ray met them by chance."""

from __future__ import annotations

import math

import numpy as np
import pytest

import sightray as sr
from sightray._jit import kernel, native
from sightray.lights.base import direction_density, illuminate
from sightray.materials.base import emitted
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, f64_at, f64_put, vec3_at, vec3_put
from sightray.scene.compile import compile_scene
from sightray.scene.light_choice import choose_light
from sightray.scene.world import LAMP_COUNT, LIGHT_COUNT, find_closest, light_at, light_count, point_of, thin_beam

GLOW = sr.Emitter(radiance=(3, 2, 1))
BOTH = sr.Lambert(emission=(1, 2, 3), albedo=0.2)
CORNERS = np.array([[-0.3, 0.2, -0.3], [0.3, 0.2, -0.3], [0.3, 0.2, 0.3], [-0.3, 0.3, 0.3]])
MESH = sr.Mesh(vertices=CORNERS, faces=[[0, 1, 2], [0, 2, 3]], material=GLOW)
TURN = sr.Transform.translate(0, 0.1, 0) @ sr.Transform.rotate((1, 0, 0.2), 30)
RECTANGLE = {"corner": (-0.3, 0.2, -0.3), "edge_u": (0.6, 0, 0), "edge_v": (0, 0, 0.6)}
EXAMPLES = {
    "mesh": (MESH, 2),
    "mirrored and stretched mesh": (sr.Instance(of=MESH, transform=TURN @ sr.Transform.scale(1, -2, 1.5)), 2),
    "two meshes": (sr.Group(objects=[MESH, sr.Instance(of=MESH, transform=sr.Transform.translate(0, 0.2, 0))]), 4),
    "rectangle": (sr.Rectangle(material=GLOW, **RECTANGLE), 1),
    "two-sided rectangle": (sr.Rectangle(material=BOTH, **RECTANGLE), 1),
    "skewed rectangle": (sr.Rectangle(corner=(-0.3, 0.2, -0.3), edge_u=(0.6, 0.1, 0.2), edge_v=(0.2, 0, 0.6),
                                      material=BOTH), 1),
    "triangle": (sr.Triangle(a=CORNERS[0], b=CORNERS[1], c=CORNERS[2], material=GLOW), 1),
    "disk": (sr.Disk(center=(0, 0.2, 0), normal=(0, -1, 0.2), radius=0.3, material=GLOW), 1),
    "stretched disk": (sr.Disk(center=(0, 0.2, 0), normal=(0, -1, 0.2), radius=0.3, material=BOTH,
                               transform=sr.Transform.scale(2, 1, 0.5)), 1),
    "sphere": (sr.Sphere(center=(0, 0.3, 0), radius=0.2, material=GLOW), 1),
    "scaled sphere": (sr.Sphere(center=(0, 0.3, 0), radius=0.1, material=BOTH, transform=TURN @ sr.Transform.scale(2)), 1),
    "stretched sphere": (sr.Sphere(center=(0, 0.3, 0), radius=0.1, material=GLOW, transform=sr.Transform.scale(2, 1, 1)), 0),
    "ring": (sr.Disk(center=(0, 0.2, 0), normal=(0, -1, 0), radius=0.3, inner_radius=0.2, material=GLOW), 0),
    "box": (sr.Box(lower=(-0.2, 0.1, -0.2), upper=(0.2, 0.2, 0.2), material=GLOW), 0),
}  # fmt: skip
LOOKED_FOR = [name for name, (_, count) in EXAMPLES.items() if count]
FLOOR = sr.Plane(point=(0, -0.5, 0), normal=(0, 1, 0), material=sr.Lambert(albedo=0.7))
CAMERA = sr.PerspectiveCamera(eye=(0, 0.3, 2.5), target=(0, -0.2, 0), vfov=40, width=40, height=30)


def scene_with(name: str) -> sr.Scene:
    return sr.Scene(FLOOR, EXAMPLES[name][0], camera=CAMERA)


@kernel
def shine(world: Table, count: i64, points: Table, out: Table) -> i64:
    """For points of 8 words, p and u, v, w: light looked for from there, against what a ray in its direction meets.

    Out come 16 words: irradiance over what it should be (radiance of the surface over density), distance that it
    should be and is, number of the light that it should be and is.
    """
    for i in range(count):
        p = vec3_at(points, 8 * i)
        chosen = choose_light(world, p, vec3_at(points, 8 * count), f64_at(points, 8 * i + 6))
        light = light_at(world, chosen.light)
        sample = illuminate(light, p, 0, f64_at(points, 8 * i + 4), f64_at(points, 8 * i + 5))
        density = direction_density(light, p, sample.direction, sample.distance)
        vec3_put(out, 16 * i, sample.irradiance * density)
        f64_put(out, 16 * i + 4, sample.distance)
        f64_put(out, 16 * i + 5, float(chosen.light))
        hit = find_closest(world, p, sample.direction, 0.0, sample.distance * (1.0 + 1e-6))
        f64_put(out, 16 * i + 6, hit.t)
        if hit.item >= 0:
            point = point_of(world, hit, p, sample.direction, thin_beam())
            f64_put(out, 16 * i + 7, float(point.light))
            vec3_put(out, 16 * i + 8, emitted(point.material, point.where, point.cos_view))
    return light_count(world)


@pytest.mark.parametrize("name", EXAMPLES)
def test_shapes_that_glow_are_lights(name):
    thing, count = EXAMPLES[name]
    made = compile_scene(sr.Scene(FLOOR, thing, sr.PointLight(position=(0, 1, 0))))
    assert made.world.view(np.int64)[LIGHT_COUNT] == 1  # until someone asks for all
    made.tables.prepare(shine, compiled=False)
    assert made.world.view(np.int64)[LIGHT_COUNT] == count + 1
    assert made.world.view(np.int64)[LAMP_COUNT] == 1


@pytest.mark.parametrize("name", LOOKED_FOR)
def test_light_that_is_looked_for_is_the_light_that_a_ray_meets(name):
    made = compile_scene(scene_with(name))
    made.tables.prepare(shine)
    rng = np.random.default_rng(0)
    count = 400
    points = np.zeros((count + 1, 8))
    points[:count, :3] = rng.uniform((-1, -0.5, -1), (1, 0.8, 1), (count, 3))
    points[:count, 4:7] = rng.uniform(0, 1, (count, 3))
    out = np.zeros((count, 16))
    assert native(shine)(made.world, count, Table(points), Table(out)) == EXAMPLES[name][1]
    first = np.isfinite(out[:, 6]) & (np.abs(out[:, 6] - out[:, 4]) < 1e-6 * out[:, 4])  # nothing stands before it
    assert first.sum() > 100
    np.testing.assert_array_equal(out[first, 7], out[first, 5])
    np.testing.assert_allclose(out[first, :3], out[first, 8:11], rtol=1e-6, atol=1e-12)
    assert out[first, :3].any()


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_path_tracer_agrees_with_the_simple_one(name):
    """Mean of the picture, by ten seeds each, of light that is looked for and of light that is met by chance."""
    scene = scene_with(name)
    runs = [
        [np.asarray(sr.render(scene, how, samples=n, seed=k)).mean() for k in range(10)]
        for how, n in ((sr.PathTracer(max_depth=2), 16), (sr.SimplePathTracer(max_depth=2), 100))
    ]
    a, b = np.mean(runs, axis=1)
    error = math.sqrt(np.var(runs, axis=1, ddof=1).sum() / 10)
    assert error < 0.03 * b
    assert abs(a - b) < 4 * error


def test_looking_for_small_lamps_pays():
    lamp = sr.Sphere(center=(0, 0.6, 0), radius=0.02, material=sr.Emitter(radiance=300))
    scene = sr.Scene(FLOOR, lamp, camera=CAMERA)
    noise = [
        np.std([np.asarray(sr.render(scene, how, samples=4, seed=k))[20:, :] for k in range(6)], axis=0).mean()
        for how in (sr.PathTracer(max_depth=1), sr.SimplePathTracer(max_depth=1))
    ]
    assert noise[0] < 0.1 * noise[1]


def test_whitted_takes_glow_as_before():
    scene = scene_with("mesh")
    image = np.asarray(sr.render(scene.replace(ambient=0.0), sr.Whitted(), samples=1))
    assert {tuple(x) for x in np.round(image.reshape(-1, 3), 6).tolist()} <= {(0, 0, 0), (3, 2, 1)}


def test_a_sphere_that_glows_does_not_light_itself_from_within():
    """Points of its own surface are not outside of it, however they were rounded: the furnace is without noise."""
    camera = sr.PerspectiveCamera(eye=(0.3, -0.2, 0.1), target=(0, 1, 0.5), vfov=70, width=16, height=16)
    scene = sr.Scene(sr.Sphere(material=sr.Lambert(albedo=0.5, emission=1)), camera=camera)
    image = np.asarray(sr.render(scene, sr.PathTracer(max_depth=3), samples=16))
    np.testing.assert_allclose(image, 1.875, rtol=1e-6)
