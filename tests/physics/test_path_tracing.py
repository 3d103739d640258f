"""Path tracing against closed forms, against its plain twin, and against Whitted where they must agree."""

from __future__ import annotations

import math

import numpy as np
import pytest

import sightray as sr
from sightray._jit import kernel
from sightray.integrators.shading import frame_about, into, out_of
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, vec3_at, vec3_put

TINY = {"width": 8, "height": 8}
TRACERS = [sr.SimplePathTracer, sr.PathTracer]


def mean_and_error(scene, integrator, samples, seed=0):
    """Mean of the picture's luminance, and its standard error from 16 independent renders."""
    means = [np.asarray(sr.render(scene, integrator, samples=samples, seed=seed + k)).mean() for k in range(16)]
    return np.mean(means), np.std(means, ddof=1) / 4


def inside_unit_sphere(material, *more):
    camera = sr.PerspectiveCamera(eye=(0.3, -0.2, 0.1), target=(0, 1, 0.5), up=(0, 0, 1), vfov=70, **TINY)
    return sr.Scene(sr.Sphere(material=material), *more, camera=camera)


@pytest.mark.parametrize("tracer", TRACERS)
@pytest.mark.parametrize(("albedo", "radiosity"), [(0.5, 2.0), (0.8, 5.0)])
def test_closed_furnace(tracer, albedo, radiosity):
    """Emission 1 and reflectance rho everywhere: radiance 1 / (1 - rho)."""
    scene = inside_unit_sphere(sr.Lambert(albedo=albedo, emission=1))
    mean, error = mean_and_error(scene, tracer(max_depth=300), 16)
    assert mean == pytest.approx(radiosity, rel=1e-6) or abs(mean - radiosity) < 4 * error


@pytest.mark.parametrize("bounces", [0, 1, 3])
def test_furnace_after_a_few_bounces(bounces):
    """After k bounces the sum of rho^i is seen: without noise by the plain tracer, to which all paths are alike."""
    scene = inside_unit_sphere(sr.Lambert(albedo=0.5, emission=1))
    expected = sum(0.5**k for k in range(bounces + 1))
    plain = np.asarray(sr.render(scene, sr.SimplePathTracer(max_depth=bounces), samples=2))
    np.testing.assert_allclose(plain, expected, rtol=1e-6)
    mean, error = mean_and_error(scene, sr.PathTracer(max_depth=bounces), 64)
    assert abs(mean - expected) < 4 * error + 1e-6


def test_point_light_in_a_closed_sphere():
    """Analytic scene: albedo 1/2 and a point light of intensity pi in the middle make radiance 1 everywhere."""
    scene = inside_unit_sphere(sr.Lambert(albedo=0.5), sr.PointLight(position=(0, 0, 0), intensity=math.pi))
    mean, error = mean_and_error(scene, sr.PathTracer(max_depth=200), 64)
    assert abs(mean - 1) < 4 * error
    assert error < 0.01


@pytest.mark.parametrize("light", [
    sr.RectangleLight(corner=(-0.6, 1.9, -0.5), edge_u=(1, 0, 0), edge_v=(0, 0, 1), radiance=4),
    sr.DiskLight(center=(0, 1.9, 0), radius=0.6, radiance=4),
    sr.SphereLight(center=(0.2, 1.2, 0), radius=0.4, radiance=4),
])  # fmt: skip
@pytest.mark.parametrize("material", [sr.Lambert(albedo=0.7), sr.Phong(diffuse=0.3, specular=0.6, shininess=40)])
def test_looking_for_lights_changes_no_expectation(light, material):
    """PathTracer and its plain twin estimate the same picture: next-event estimation and weights are unbiased."""
    scene = sr.Scene(
        sr.Box(lower=(-1, 0, -1), upper=(1, 2, 1), material=material), light,
        camera=sr.PerspectiveCamera(eye=(0.1, 0.8, 0.9), target=(0, 0.6, -1), vfov=70, **TINY),
    )  # fmt: skip
    clever, error = mean_and_error(scene, sr.PathTracer(max_depth=4), 64)
    plain, plain_error = mean_and_error(scene, sr.SimplePathTracer(max_depth=4), 1024, seed=100)
    assert abs(clever - plain) < 4 * math.hypot(error, plain_error)
    assert error < 3.5 * plain_error  # with 16 times fewer samples, equal efficiency would be 4


def test_invisible_lights_are_found_all_the_same():
    floor = sr.Plane(point=(0, 0, 0), normal=(0, 1, 0), material=sr.Lambert(albedo=0.5))
    light = sr.RectangleLight(corner=(-0.5, 2, -0.5), edge_u=(1, 0, 0), edge_v=(0, 0, 1), radiance=4)
    camera = sr.PerspectiveCamera(eye=(0, 1, 3), target=(0, 0, 0), vfov=20, **TINY)
    seen, hidden = (
        mean_and_error(sr.Scene(floor, light.replace(visible=v), camera=camera), sr.PathTracer(max_depth=1), 64)
        for v in (True, False)
    )
    assert abs(seen[0] - hidden[0]) < 4 * math.hypot(seen[1], hidden[1])


def test_path_tracer_is_whitted_on_specular_scenes():
    """Mirrors, glass with absorption, and emitters: the tree of rays and the random walk see the same light."""
    scene = sr.Scene(
        sr.Sphere(center=(-0.7, 0, 0), radius=0.6, material=sr.Glass(ior=1.5, absorption=(0.1, 0.5, 0.2))),
        sr.Sphere(center=(0.7, 0, 0), radius=0.6, material=sr.Mirror(reflectance=(0.9, 0.8, 0.7))),
        sr.Sphere(center=(0, 0, 0), radius=9, material=sr.Lambert(albedo=0, emission=(0.4, 0.6, 1))),
        sr.Sphere(center=(0, 2, 0), radius=0.5, material=sr.Emitter(radiance=7)),
        camera=sr.PerspectiveCamera(eye=(0, 0.4, 4), vfov=40, **TINY),
    )
    exact = np.asarray(sr.render(scene, sr.Whitted(max_depth=12, cutoff=1e-9), samples=1024)).mean()
    mean, error = mean_and_error(scene, sr.PathTracer(max_depth=12), 1024)
    assert abs(mean - exact) < 4 * error + 1e-3


def test_more_shadow_rays_from_the_first_surface_leave_less_noise_of_direct_light_and_the_same_mean():
    """Sixteen even samples of a panel of which half is hidden: far less than a sixteenth of the variance of one."""
    floor = sr.Rectangle(corner=(-1, 0, 1), edge_u=(2, 0, 0), edge_v=(0, 0, -2), material=sr.Lambert(albedo=0.5))
    lamp = sr.RectangleLight(corner=(-1, 2, -1), edge_u=(2, 0, 0), edge_v=(0, 0, 2), radiance=3, visible=False)
    card = sr.Rectangle(corner=(0, 1, 1), edge_u=(2, 0, 0), edge_v=(0, 0, -2), material=sr.Lambert(albedo=0.0))
    camera = sr.PerspectiveCamera(eye=(0, 0.8, 3), target=(0, 0, 0), vfov=20, width=24, height=24)
    scene = sr.Scene(floor, lamp, card, camera=camera, ambient=0)

    def noise(count):
        tracer = sr.PathTracer(max_depth=1, light_samples=count)
        pictures = [np.asarray(sr.render(scene, tracer, samples=1, seed=k), float)[14:, :, 0] for k in range(40)]
        return np.mean(pictures), np.std(pictures, axis=0).mean() / np.sqrt(40 * 240), np.var(pictures, axis=0).mean()

    (one, error, spread), (many, error_of_many, less) = noise(1), noise(16)
    assert abs(one - many) < 4 * np.hypot(error, error_of_many)
    assert less < spread / 40


def test_roulette_and_clamp():
    scene = inside_unit_sphere(sr.Lambert(albedo=0.7), sr.PointLight(position=(0, 0, 0), intensity=1))
    plain, early = (
        mean_and_error(scene, sr.PathTracer(max_depth=100, roulette_depth=k), 64, seed=50 * k) for k in (100, 1)
    )
    assert abs(plain[0] - early[0]) < 4 * math.hypot(plain[1], early[1])
    clamped = np.asarray(sr.render(scene, sr.PathTracer(clamp=0.01, max_depth=100), samples=16))
    assert clamped.mean() < plain[0] * 0.9


def test_clamp_counts_turns_in_media():
    """Fog alone: with a clamp of nearly nothing, light that was scattered more than once is gone."""
    fog = sr.HomogeneousMedium(scattering=0.5, absorption=0.2)
    camera = sr.PerspectiveCamera(eye=(0, 0, 3), target=(0, 0, 0), vfov=60, width=16, height=16)
    scene = sr.Scene(sr.Sphere(center=(0, 0, 50)), sr.PointLight(position=(0, 2, 0), intensity=5), camera=camera,
                     medium=fog, ambient=0)  # fmt: skip
    free, once = (np.asarray(sr.render(scene, sr.PathTracer(clamp=c), samples=64), float) for c in (None, 1e-9))
    assert once.mean() < 0.8 * free.mean()
    assert (once > 0).all()


@kernel
def turn_about(numbers: Table, out: Table) -> f64:
    frame = frame_about(vec3_at(numbers, 0))
    vec3_put(out, 0, out_of(frame, into(frame, vec3_at(numbers, 4))))
    vec3_put(out, 4, into(frame, vec3_at(numbers, 0)))
    return 0.0


def test_frames_are_orthonormal():
    rng = np.random.default_rng(5)
    for _ in range(50):
        n = rng.normal(size=3)
        numbers, out = np.zeros(8), np.zeros(8)
        numbers[:3], numbers[4:7] = n / np.linalg.norm(n), rng.normal(size=3)
        turn_about(Table(numbers), Table(out))
        np.testing.assert_allclose(out[:3], numbers[4:7], atol=1e-14)
        np.testing.assert_allclose(out[4:7], [0, 0, 1], atol=1e-14)
