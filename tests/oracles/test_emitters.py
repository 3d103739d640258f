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
from sightray.scene.compile import compile_scene, flatten
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


# --- painted lamps --------------------------------------------------------------------------------------------------


def sheet(side: int, **options) -> sr.Mesh:
    """A level square of side 2 at y = 1 that faces down, of ``2 side²`` triangles; u runs along x, v along -z."""
    s = np.linspace(0, 1, side + 1)
    u, v = (part.ravel() for part in np.meshgrid(s, s))
    a = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    faces = np.concatenate([np.stack([a, a + side + 1, a + 1], 1), np.stack([a + 1, a + side + 1, a + side + 2], 1)])
    return sr.Mesh(vertices=np.stack([2 * u - 1, np.ones(u.size), 1 - 2 * v], 1), faces=faces,
                   uvs=np.stack([u, v], 1), **options)  # fmt: skip


def spotted(rng) -> np.ndarray:
    """A dark picture, (48, 80, 3), with some bright spots of a texel each."""
    picture = np.full((48, 80, 3), 0.01)
    picture[rng.integers(0, 48, 6), rng.integers(0, 80, 6)] = rng.uniform(50, 200, (6, 3))
    return picture


@pytest.mark.parametrize("side", [1, 3, 40, 200])
@pytest.mark.parametrize("wrap", ["repeat", "mirror", "clamp"])
def test_triangles_of_a_painted_lamp_count_by_what_is_painted_on_them(side, wrap):
    """Against the mean of many places; what shines is never taken for dark."""
    from sightray.scene.emitters import EVENLY, lights_of

    rng = np.random.default_rng(side)
    smooth = np.cumsum(np.cumsum(rng.normal(size=(48, 80, 3)), 0), 1)
    painted = sr.Bitmap(image=np.float32(smooth - smooth.min()), wrap=wrap, scale=(1.7, -0.6), offset=(0.3, 0.2))
    mesh = sheet(side)
    corners = mesh.uvs[mesh.faces] * painted.scale + painted.offset
    found = sr.Multiply(a=painted, b=(3, 3, 3)).brightness_over(mesh.uvs[mesh.faces])
    picked = rng.choice(len(corners), min(20, len(corners)), replace=False)
    for k in picked:
        w = rng.dirichlet((1, 1, 1), 20_000) @ corners[k] * (80, 48) - 0.5
        i = np.floor(w).astype(int)
        i = {"repeat": i % (80, 48), "clamp": np.clip(i, 0, (79, 47)),
             "mirror": np.minimum(i % (160, 96), (159, 95) - i % (160, 96))}[wrap]  # fmt: skip
        mean = 3 * painted.pixels.mean(axis=2)[47 - i[:, 1], i[:, 0]].mean()
        assert found[k] == pytest.approx(mean, rel=0.1, abs=0.2 * float(np.ptp(painted.pixels)))  # at edges where it wraps

    lamp = sr.Emitter(radiance=sr.Bitmap(image=spotted(rng)))
    mesh = sheet(side, material=lamp)
    (item,) = flatten(sr.Scene(mesh))
    shine = lights_of(item).bounds.intensity
    total = lamp.glow * 4.0
    assert shine.sum() == pytest.approx(total, rel=0.15)
    assert (shine > EVENLY * total / len(shine) * 0.99).all()


def test_a_spot_on_a_large_screen_lights_as_a_small_lamp_does():
    """Of 3200 triangles two shine: light is exact at the hit, and as free of noise as that of a lamp of that size."""
    picture = np.zeros((40, 40, 3), np.float32)
    picture[7, 22] = (30, 20, 10)
    screen = sheet(40, material=sr.Emitter(radiance=sr.Bitmap(image=picture, filter="nearest")))
    x, z = 22 / 20 - 1, 1 - 2 * (40 - 7) / 40
    lamp = sr.Rectangle(corner=(x, 1, z), edge_u=(0.05, 0, 0), edge_v=(0, 0, 0.05),
                        material=sr.Emitter(radiance=(30, 20, 10)))  # fmt: skip
    pictures, noises = [], []
    for thing in (screen, lamp):
        scene = sr.Scene(FLOOR, thing, camera=CAMERA)
        many = [np.asarray(sr.render(scene, sr.PathTracer(max_depth=1), samples=16, seed=s)) for s in range(8)]
        floor = np.array(many)[:, 16:]
        pictures.append(floor.mean(axis=0))
        noises.append(np.sqrt(floor.var(axis=0).mean()) / floor.mean())
    np.testing.assert_allclose(pictures[0].mean(axis=(0, 1)), pictures[1].mean(axis=(0, 1)), rtol=0.01)
    assert noises[0] < 0.12
    assert noises[1] < 0.12


def test_what_is_painted_glows_where_it_is():
    """A ray that meets the screen sees the texel, in RGB; with a spectrum its luminance counts."""
    picture = np.random.default_rng(3).uniform(0.2, 1, (3, 4, 3)).astype(np.float32)
    wall = sr.Rectangle(corner=(-2, -1.5, 0), edge_u=(4, 0, 0), edge_v=(0, 3, 0),
                        material=sr.Emitter(radiance=sr.Bitmap(image=picture, filter="nearest")))  # fmt: skip
    camera = sr.OrthographicCamera(eye=(0, 0, 5), target=(0, 0, 0), height=3, view_height=3, width=4)
    seen = np.asarray(sr.render(sr.Scene(wall, camera=camera), sr.PathTracer(), samples=1))
    np.testing.assert_allclose(seen, picture, rtol=1e-5)
