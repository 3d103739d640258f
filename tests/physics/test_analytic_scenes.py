"""Scenes whose picture is known: every integrator, with every sampler, and every light.

The closed sphere is M. Pharr's and G. Humphreys's analytic scene (pbrt's tests): in a sphere of radius 1 and reflectance
1/2 all points see one another alike, so light that was reflected once is the same everywhere.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import sightray as sr
from sightray.registry import members

TINY = {"width": 8, "height": 8}
WALL = sr.Lambert(albedo=0.5)
CAMERA = sr.PerspectiveCamera(eye=(0.3, -0.2, 0.1), target=(0, 1, 0.5), up=(0, 0, 1), vfov=70, **TINY)
ROOF = {"corner": (-0.3, 0.5, -0.3), "edge_u": (0.6, 0, 0), "edge_v": (0, 0, 0.6)}

# What each integrator makes of the sphere with a point light of intensity pi at its centre, and of one that glows with
# radiance 1/2. All light is 1 + 0: 1/2 of it comes straight from the lamp or by one bounce off what glows.
INTEGRATORS = {
    "PathTracer": (sr.PathTracer(max_depth=40), 1, 1),
    "SharedPathTracer": (sr.SharedPathTracer(max_depth=40), 1, 1),
    "SimplePathTracer": (sr.SimplePathTracer(max_depth=25), 0, 1),
    "CoursePathTracer": (sr.CoursePathTracer(next_event_estimation="mis", russian_roulette=True, max_depth=-1), 1, 1),
    "DirectLighting": (sr.DirectLighting(), 0.5, 0.75),
    "AnalyticDirect": (sr.AnalyticDirect(shadows=True), 0.5, 0.5),
    "Whitted": (sr.Whitted(), 0.5, 0.5),
    "AmbientOcclusion": (sr.AmbientOcclusion(), 0, 0),
    "PhasorTracer": (sr.PhasorTracer(frequency=1e-6, max_depth=40), 2 / 3, 0),  # cosine 1, sine 0, light 1; lamps alone
}
# Each light within the sphere, and its flux, W; None for lights from outside, of which nothing may get in.
LIGHTS = {
    "PointLight": (sr.PointLight(position=(0.2, 0.1, -0.3), intensity=math.pi), 4 * math.pi**2),
    "SpotLight": (sr.SpotLight(position=(0.2, 0.1, 0), target=(0, -1, 0), angle=80, blend=0, intensity=3),
                  6 * math.pi * (1 - math.cos(math.radians(40)))),
    "RectangleLight": (sr.RectangleLight(**ROOF, radiance=9, visible=False), math.pi * 9 * 0.36),
    "DiskLight": (sr.DiskLight(center=(0, 0.4, 0), radius=0.3, radiance=9, visible=False), math.pi**2 * 9 * 0.09),
    "SphereLight": (sr.SphereLight(center=(-0.3, 0, 0), radius=0.2, radiance=2, visible=False), 8 * math.pi**2 * 0.04),
    "DirectionalLight": (sr.DirectionalLight(direction=(1, -2, 0.5), irradiance=5), None),
    "EnvironmentLight": (sr.EnvironmentLight(), None),
    "SunSky": (sr.SunSky(), None),
}  # fmt: skip


def own_members(family):
    return {name for name, cls in members(family).items() if cls.__module__.startswith("sightray.")}


def means(scene, integrator, samples=32, runs=16, **options):
    """Mean of the picture and its standard error, from independent renders."""
    found = [
        np.asarray(sr.render(scene, integrator, samples=samples, seed=100 + k, **options)).mean() for k in range(runs)
    ]
    return np.mean(found), np.std(found, ddof=1) / math.sqrt(runs)


def test_nothing_is_left_out():
    assert set(INTEGRATORS) == own_members("integrators")
    assert set(LIGHTS) | {"ProjectorLight"} == own_members("lights")  # a projector's flux is tested with its picture


@pytest.mark.parametrize("sampler", sorted(own_members("samplers")))
@pytest.mark.parametrize("name", INTEGRATORS)
def test_closed_sphere(name, sampler):
    integrator, by_lamp, by_glow = INTEGRATORS[name]
    lamp = sr.Scene(sr.Sphere(material=WALL), sr.PointLight(position=(0, 0, 0), intensity=math.pi), camera=CAMERA)
    glow = sr.Scene(sr.Sphere(material=WALL.replace(emission=0.5)), camera=CAMERA)
    for scene, expected in ((lamp, by_lamp), (glow, by_glow)):
        mean, error = means(scene, integrator, sampler=members("samplers")[sampler]())
        assert abs(mean - expected) < 4.5 * error + 1e-6
        assert error < 0.02


@pytest.mark.parametrize("tracer", [sr.PathTracer(max_depth=40), INTEGRATORS["CoursePathTracer"][0]])
@pytest.mark.parametrize("name", LIGHTS)
def test_every_light_fills_the_sphere_by_its_flux(name, tracer):
    """What was reflected once or more is rho²/(1 - rho) flux / (4 pi²); the rest is direct light."""
    light, flux = LIGHTS[name]
    scene = sr.Scene(sr.Sphere(material=WALL), light, camera=CAMERA)
    full, error = means(scene, tracer, samples=64)
    if flux is None:
        assert full == 0
        return
    direct, own = means(scene, sr.DirectLighting(strategy="light"), samples=64)
    assert abs(full - direct - flux * 0.5 / (4 * math.pi**2)) < 4 * math.hypot(error, own)
    assert error < 0.02 * full


# --- scales and leaks -----------------------------------------------------------------------------------------------

SCALES = [1e-3, 1.0, 1e5]
PLACES = [(0, 0, 0), (1000, -300, 200)]


def closed_box(scale, place):
    """A box in a bright world, with a bright lamp just outside and a ball inside; the eye is in the box."""
    at = np.array(place, float) * scale
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * scale + at
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [tri for a, b, c, d in sides for tri in ((a, b, c), (a, c, d))]
    return sr.Scene(
        sr.Mesh(vertices=corners, faces=faces, material=sr.Lambert(albedo=0.9)),
        sr.Sphere(center=at + scale * np.array([0.2, -0.7, 0.1]), radius=0.3 * scale, material=sr.Lambert(albedo=0.9)),
        sr.Sphere(center=at - scale * np.array([0.5, 0.6, -0.4]), radius=0.4 * scale, material=sr.Glass()),
        sr.PointLight(position=at + scale * np.array([0, 1.001, 0]), intensity=1e3 * scale**2),
        sr.RectangleLight(corner=at + scale * np.array([-5, 1.5, -5]), edge_u=(10 * scale, 0, 0),
                          edge_v=(0, 0, 10 * scale), radiance=1e3),
        background=1e3, camera=sr.PerspectiveCamera(eye=at + scale * np.array([-0.9, 0.9, 0.9]), target=at, vfov=80,
                                                    width=64, height=64),
    )  # fmt: skip


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("name", sorted(INTEGRATORS))
def test_no_light_leaks_into_a_closed_box(name, scale, place):
    integrator = INTEGRATORS[name][0]
    if name == "CoursePathTracer":
        integrator = integrator.replace(max_depth=8)
    image = np.asarray(sr.render(closed_box(scale, place), integrator, samples=8))
    assert image.max() == 0


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("name", sorted(INTEGRATORS))
def test_pictures_do_not_depend_on_scale(name, scale, place):
    """The same room, built larger or elsewhere, is the same picture but for single rays at edges."""

    def room(s, at):
        at = np.array(at, float) * s
        return sr.Scene(
            sr.Plane(point=at, normal=(0, 1, 0), material=sr.Lambert(albedo=0.7)),
            sr.Sphere(center=at + s * np.array([0, 0.5, 0]), radius=0.5 * s, material=sr.Lambert(albedo=0.5)),
            sr.Box(lower=at + s * np.array([0.6, 0, -0.5]), upper=at + s * np.array([1, 1.2, 0.3])),
            sr.RectangleLight(corner=at + s * np.array([-1, 3, 0]), edge_u=(s, 0, 0), edge_v=(0, 0, s), radiance=9),
            sr.PointLight(position=at + s * np.array([2, 2, 2]), intensity=5 * s * s), background=0.2,
            camera=sr.PerspectiveCamera(eye=at + s * np.array([0, 1, 4]), target=at + s * np.array([0, 0.5, 0]),
                                        vfov=40, width=48, height=48),
        )  # fmt: skip

    integrator = INTEGRATORS[name][0]
    first, other = (np.asarray(sr.render(room(*a), integrator, samples=4)) for a in ((1.0, (0, 0, 0)), (scale, place)))
    different = (np.abs(first - other) > 1e-4 * (1 + first)).any(axis=-1)
    assert first.max() > 0.1
    assert different.mean() < 0.02


@pytest.mark.parametrize("name", INTEGRATORS)
def test_pictures_do_not_depend_on_threads(name):
    scene = closed_box(1.0, (0, 0, 0)).replace(camera=sr.PerspectiveCamera(eye=(3, 1.2, 5), width=70, height=40))
    one, four = (np.asarray(sr.render(scene, INTEGRATORS[name][0], samples=2, threads=n)) for n in (1, 4))
    assert (one == four).all()
    assert one.max() > 0
