"""Direct light and openness against closed forms: Lambert's polygons, three ways of sampling, disks overhead, walls."""

from __future__ import annotations

import math

import numpy as np
import pytest

import sightray as sr

WHITE = sr.Lambert(albedo=1)
SQUARE = sr.RectangleLight(corner=(-1, 1, -1), edge_u=(2, 0, 0), edge_v=(0, 0, 2), radiance=1, visible=False)
TINY = {"width": 6, "height": 6}


def at_point(integrator, *objects, p=(0, 0, 0), n=(0, 1, 0), **options):
    """What a tiny white disk at p with normal n shows, times pi: its irradiance."""
    p, n = np.array(p, float), np.array(n, float) / np.linalg.norm(n)
    up = (1, 0, 0) if abs(n[0]) < 0.9 else (0, 1, 0)
    camera = sr.PerspectiveCamera(eye=p + 1e-3 * n, target=p, up=up, vfov=1e-3, width=1, height=1)
    disk = sr.Disk(center=p, normal=n, radius=1e-6, material=WHITE)
    return np.asarray(sr.render(sr.Scene(disk, *objects, camera=camera), integrator, **options))[0, 0] * math.pi


def quadrature(corners, p, n, cells=600):
    """E/L of a parallelogram or triangle that faces p: the sum over small pieces above the horizon."""
    a, u, v = corners[0], corners[1] - corners[0], corners[-1] - corners[0]
    s, t = np.meshgrid(*[(np.arange(cells) + 0.5) / cells] * 2)
    if len(corners) == 3:
        s, t = 1 - np.sqrt(s), t * np.sqrt(s)
    d = a + s[..., None] * u + t[..., None] * v - p
    area = np.cross(u, v) * (0.5 if len(corners) == 3 else 1)
    r2 = (d**2).sum(-1)
    return (np.maximum(d @ n, 0) * np.abs(d @ area) / r2**2).mean()


def mean_and_error(integrator, scene, samples, seed=0):
    """Mean over the picture and its standard error, from 16 renders."""
    means = [np.asarray(sr.render(scene, integrator, samples=samples, seed=seed + k)).mean() for k in range(16)]
    return np.mean(means), np.std(means, ddof=1) / 4


# --- polygons -------------------------------------------------------------------------------------------------------

ARVO = [((0, -1, 0), 0.7522746885), ((1, -1, 0), 0.5666451120), ((0, 0, 0), 1.7408395027)]


@pytest.mark.parametrize(("p", "expected"), ARVO)
def test_polygon_irradiance(p, expected):
    """The square [-1, 1]² at y = 1 facing down, as a light, and as two glowing triangles of a mesh."""
    corners = np.array([[-1, 1, -1], [1, 1, -1], [1, 1, 1], [-1, 1, 1]])
    mesh = sr.Mesh(vertices=corners, faces=[[0, 1, 2], [0, 2, 3]], material=sr.Emitter())
    for light in (SQUARE, mesh):
        np.testing.assert_allclose(at_point(sr.AnalyticDirect(), light, p=p), expected, rtol=2e-7)
    np.testing.assert_allclose(
        at_point(sr.AnalyticDirect(), SQUARE.replace(edge_u=(0, 0, 2), edge_v=(2, 0, 0)), p=p), 0
    )


@pytest.mark.parametrize("n", [(1, 0.5, 0), (0.2, 0.1, 1), (1, -0.4, 0.7), (-1, -0.2, 0.1), (0, -1, 0.2)])
@pytest.mark.parametrize("corners", [3, 4])
def test_polygons_are_clipped_at_the_horizon(n, corners):
    q = np.array([[-1, 1, -1], [1, 1.2, -0.8], [0.8, 1.4, 1.2], [-1.2, 1.2, 1]])  # a parallelogram
    q = q[[0, 1, 3]] if corners == 3 else q
    p = np.array([0.7, 0, 0.2])
    material = sr.Emitter(radiance=(1, 2, 3))
    light = (
        sr.Triangle(a=q[0], b=q[1], c=q[2], material=material)
        if corners == 3
        else sr.Rectangle(corner=q[0], edge_u=q[1] - q[0], edge_v=q[3] - q[0], material=material)
    )
    expected = quadrature(q, p, np.array(n) / np.linalg.norm(n))
    np.testing.assert_allclose(
        at_point(sr.AnalyticDirect(), light, p=p, n=n), expected * np.array([1, 2, 3]), rtol=2e-4, atol=1e-6
    )


def test_other_lights_are_sampled_or_exact():
    lamp = sr.PointLight(position=(1, 2, 0), intensity=3)
    np.testing.assert_allclose(at_point(sr.AnalyticDirect(), lamp), 3 * 2 / 5**1.5, rtol=1e-6)
    disk = sr.DiskLight(center=(0, 1, 0), radius=1, radiance=1)
    assert at_point(sr.AnalyticDirect(), disk, samples=256)[0] == pytest.approx(math.pi / 2, rel=1e-2)


def test_analytic_light_with_ratio_shadows():
    """A screen over half of the light: exact where all or nothing is seen, near the truth in between."""
    half = sr.Rectangle(corner=(0, 0.5, -3), edge_u=(3, 0, 0), edge_v=(0, 0, 6))
    shaded = sr.AnalyticDirect(shadows=True)
    one = {"p": (-2, 0, 0), "seed": 3}
    np.testing.assert_allclose(at_point(shaded, SQUARE, half, **one), at_point(sr.AnalyticDirect(), SQUARE, **one))
    assert at_point(shaded, SQUARE, half, p=(1.5, 0, 0)).max() == 0
    assert at_point(sr.AnalyticDirect(), SQUARE, half, p=(1.5, 0, 0)).min() > 0.1
    many = shaded.replace(shadow_rays=1024)
    np.testing.assert_allclose(at_point(many, SQUARE, half, samples=64), 1.7408395027 / 2, rtol=5e-3)


# --- three ways of sampling -----------------------------------------------------------------------------------------


def glossy_room(*more, **camera):
    """Veach's setting: a matte floor and a glossy wall, lights of several sizes."""
    return sr.Scene(
        sr.Plane(point=(0, 0, 0), normal=(0, 1, 0), material=sr.Lambert(albedo=0.6)),
        sr.Plane(point=(0, 0, -2), normal=(0, 0, 1), material=sr.Phong(diffuse=0.2, specular=0.7, shininess=300)),
        sr.SphereLight(center=(0, 1, -1), radius=0.3, radiance=5, grid=1),
        sr.RectangleLight(corner=(-1, 2, -1), edge_u=(2, 0, 0), edge_v=(0, 0, 2), radiance=2, grid=1),
        sr.Sphere(center=(1.5, 0.5, 0), radius=0.1, material=sr.Emitter(radiance=20)),
        *more, background=0.1, camera=sr.PerspectiveCamera(eye=(0, 1, 3), target=(0, 0.7, -1), vfov=50, **TINY),
    )  # fmt: skip


@pytest.mark.parametrize("lights", [sr.PointLight(position=(-1, 1.5, 0.5)), sr.DirectionalLight(direction=(1, -2, -1))])
def test_strategies_have_one_expectation(lights):
    """Each way finds what a path of one bounce finds, with different noise."""
    scene = glossy_room(lights)
    truth, error = mean_and_error(sr.PathTracer(max_depth=1), scene, 256)
    noise = {}
    for strategy in ("light", "material", "both"):
        for every in (True, False):
            integrator = sr.DirectLighting(strategy=strategy, every_light=every, max_depth=0)
            mean, own = mean_and_error(integrator, scene, 256, seed=50)
            assert abs(mean - truth) < 4 * math.hypot(own, error), (strategy, every)
        noise[strategy] = own
    assert noise["both"] < 1.2 * min(noise["light"], noise["material"])


def test_strategies_agree_behind_mirrors_and_glass():
    scene = glossy_room(
        sr.Sphere(center=(-1, 0.6, 0), radius=0.6, material=sr.Mirror(reflectance=0.8)),
        sr.Sphere(center=(0.5, 0.5, 1), radius=0.5, material=sr.Glass(ior=1.5, absorption=(0.5, 1, 0.2))),
    )
    found = [mean_and_error(sr.DirectLighting(strategy=s), scene, 256, seed=k) for k, s in enumerate(("light", "both"))]
    assert abs(found[0][0] - found[1][0]) < 4 * math.hypot(found[0][1], found[1][1])
    shallow = mean_and_error(sr.DirectLighting(max_depth=0), scene, 64)
    assert found[0][0] > shallow[0] + 4 * shallow[1]


def test_more_light_samples_mean_less_noise():
    light = SQUARE.replace(grid=1)
    one, many = (
        [at_point(sr.DirectLighting(strategy="light", light_samples=n), light, seed=k)[0] for k in range(32)]
        for n in (1, 64)
    )
    assert np.std(many) < 0.3 * np.std(one)
    assert abs(np.mean(many) - 1.7408395027) < 4 * np.std(many) / math.sqrt(32)


def test_fog_dims_direct_light():
    """Bouguer and Beer: fog of absorption s leaves exp(-s d) of what is seen through it."""
    fog = sr.HomogeneousMedium(absorption=(0.3, 0.6, 1.2))
    scene = sr.Scene(
        sr.Sphere(center=(0, 0, 0), radius=2, material=sr.Emitter(two_sided=True)), medium=fog,
        camera=sr.PerspectiveCamera(eye=(0, 0, 0), target=(0, 0, 1), vfov=30, **TINY),
    )  # fmt: skip
    image = np.asarray(sr.render(scene, sr.DirectLighting()))
    np.testing.assert_allclose(image[3, 3], np.exp(-2 * np.array([0.3, 0.6, 1.2])), rtol=1e-6)


# --- the switches of the course's path tracer -----------------------------------------------------------------------


def matte_room(*lights):
    return sr.Scene(
        sr.Box(lower=(-1, 0, -1), upper=(1, 2, 1), material=sr.Phong(diffuse=0.4, specular=0.3, shininess=10, mirror=0)),
        *lights, camera=sr.PerspectiveCamera(eye=(0.1, 0.8, 0.9), target=(0, 0.6, -1), vfov=70, **TINY),
    )  # fmt: skip


@pytest.mark.parametrize("roulette", [False, True])
def test_switches_of_the_course_change_only_the_noise(roulette):
    light = sr.RectangleLight(corner=(-0.6, 1.9, -0.5), edge_u=(1.2, 0, 0), edge_v=(0, 0, 1.2), radiance=4, grid=1)
    scene = matte_room(light, sr.PointLight(position=(0.5, 1, 0), intensity=0.3))
    truth, error = mean_and_error(sr.PathTracer(max_depth=3), scene, 256)
    noise = {}
    for search in ("on", "off", "mis"):
        for way in ("hemisphere", "cosine", "brdf"):
            integrator = sr.CoursePathTracer(
                next_event_estimation=search, importance_sampling=way, russian_roulette=roulette, max_depth=3
            )
            mean, own = mean_and_error(integrator, scene, 256, seed=70)
            assert abs(mean - truth) < 4 * math.hypot(own, error), (search, way)
            noise[search, way] = own
    assert noise["on", "brdf"] < 0.7 * noise["off", "brdf"] < 0.7 * noise["off", "hemisphere"]


def test_unbounded_walks_fill_a_furnace():
    """Emission 1, reflectance 1/2 everywhere: 2, once nothing but chance ends a walk."""
    scene = sr.Scene(
        sr.Sphere(material=sr.Lambert(albedo=0.5, emission=1)),
        camera=sr.PerspectiveCamera(eye=(0.3, -0.2, 0.1), target=(0, 1, 0.5), up=(0, 0, 1), vfov=70, **TINY),
    )
    integrator = sr.CoursePathTracer(russian_roulette=True, importance_sampling="cosine", max_depth=-1)
    mean, error = mean_and_error(integrator, scene, 64)
    assert abs(mean - 2) < 4 * error
    np.testing.assert_allclose(
        np.asarray(sr.render(scene, integrator.replace(russian_roulette=False, max_depth=3))), 1.875, rtol=1e-6
    )


# --- openness -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("cosine", "expected"), [(True, 1 - 0.5), (False, math.sqrt(0.5))])
def test_a_disk_overhead(cosine, expected):
    """Howell B-12: a disk of radius 1 at height 1 hides r² / (r² + h²), or 1 - cos 45° of all directions."""
    disk = sr.Disk(center=(0, 1, 0), normal=(0, 1, 0), radius=1)
    found = at_point(sr.AmbientOcclusion(cosine=cosine), disk, samples=4096) / math.pi
    np.testing.assert_allclose(found, expected, atol=4e-3)


@pytest.mark.parametrize("cosine", [True, False])
def test_a_wall_within_reach(cosine):
    """An infinite wall at distance h hides what meets it sooner than at distance D: the cap of cosines above h / D."""
    wall = sr.Plane(point=(-0.6, 0, 0), normal=(1, 0, 0))
    c = 0.6
    hidden = (math.acos(c) - c * math.sqrt(1 - c * c)) / math.pi if cosine else (1 - c) / 2
    found = at_point(sr.AmbientOcclusion(cosine=cosine, distance=1), wall, samples=4096) / math.pi
    np.testing.assert_allclose(found, 1 - hidden, atol=4e-3)
    np.testing.assert_allclose(
        at_point(sr.AmbientOcclusion(cosine=cosine), wall, samples=4096) / math.pi, 0.5, atol=4e-3
    )


def test_openness_needs_no_light_and_is_white_where_nothing_is():
    ball = sr.Sphere(material=sr.Emitter(radiance=7))
    camera = sr.PerspectiveCamera(eye=(0, 0, 4), vfov=60, width=16, height=16)
    assert np.asarray(sr.render(sr.Scene(ball, camera=camera), sr.AmbientOcclusion(), samples=4)).min() == 1
    inside = sr.PerspectiveCamera(eye=(0, 0, 0.5), vfov=60, width=16, height=16)
    assert np.asarray(sr.render(sr.Scene(ball, camera=inside), sr.AmbientOcclusion(), samples=4)).max() == 0
