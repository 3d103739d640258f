"""Light by the length of its way, against closed forms, images, and a quadrature that knows nothing of rays."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

import sightray as sr

LIGHT = 299_792_458.0
AHEAD = sr.Transform.rotate((1, 0, 0), 180)  # a camera that looks along -z, x to the right


def camera(focal=4000.0, size=1, pose=AHEAD):
    return sr.PinholeCamera(fx=focal, cx=size / 2, cy=size / 2, width=size, height=size, pose=pose)


def phasor(scene, frequency, samples=64, **options):
    """Mean of the picture as a complex number, and the plain sum of light."""
    pixels = np.asarray(sr.render(scene, sr.PhasorTracer(frequency=frequency, **options), samples=samples), float)
    c, s, light = pixels.reshape(-1, 3).mean(axis=0)
    return complex(c, s), light


def wall(z: float, albedo: float = 0.5, **options) -> sr.Rectangle:
    return sr.Rectangle(corner=(-9, -9, -z), edge_u=(18, 0, 0), edge_v=(0, 18, 0), material=sr.Lambert(albedo=albedo),
                        **options)  # fmt: skip


@pytest.mark.parametrize("bounces", [1, 2, 4])
def test_the_inside_of_a_sphere_is_a_geometric_series_of_chords(bounces):
    """Between points of a sphere light is spread evenly, so each bounce brings rho times the mean of exp(ik chord).

    Chords have the density l / 2r² on 0 to 2r.
    """
    r, rho, intensity, frequency = 2.0, 0.6, 3.0, 30e6
    k = 2 * math.pi * frequency / LIGHT
    chords = (cmath.exp(2j * k * r) * (1 - 2j * k * r) - 1) / (2 * k**2 * r**2)
    direct = rho / math.pi * intensity / r**2
    expected = direct * cmath.exp(2j * k * r) * sum((rho * chords) ** n for n in range(bounces))
    ball = sr.Sphere(radius=r, material=sr.Lambert(albedo=rho))
    inside = sr.Scene(ball, sr.PointLight(position=(0, 0, 0), intensity=intensity), camera=camera(16, 16))
    found, light = phasor(inside, frequency, samples=256, max_depth=bounces)
    assert abs(found - expected) < 1e-3 * direct
    assert light == pytest.approx(direct * sum(rho**n for n in range(bounces)), rel=1e-6)


def test_glass_counts_with_its_index():
    """A pane between the eye and a wall that a lamp lights from this side of the wall: (n - 1) d is added."""
    frequency, n, d = 60e6, 1.5, 0.4
    pane = sr.Box(lower=(-5, -5, -1.0), upper=(5, 5, -1.0 + d), material=sr.Glass(ior=n))
    lamp = sr.PointLight(position=(0, 0, -1.5), intensity=7)
    k = 2 * math.pi * frequency / LIGHT
    for things, way in (((pane,), 3 + (n - 1) * d + 1.5), ((), 4.5)):
        found, light = phasor(sr.Scene(wall(3.0), lamp, *things, camera=camera()), frequency, max_depth=3)
        assert cmath.phase(found * cmath.exp(-1j * k * way)) == pytest.approx(0, abs=1e-5)
        passed = 1 if not things else (1 - ((n - 1) / (n + 1)) ** 2) ** 2
        assert light == pytest.approx(passed * 0.5 / math.pi * 7 / 1.5**2, rel=0.05 if things else 1e-4)


def test_a_mirror_is_the_method_of_images():
    """A mirror at 45 degrees; the wall stands to the side."""
    mirror = sr.Rectangle(corner=(-1, -1, -3), edge_u=(2, 0, 2), edge_v=(0, 2, 0), material=sr.Mirror())  # z = x - 2
    side = sr.Rectangle(corner=(-4, -9, -9), edge_u=(0, 0, 18), edge_v=(0, 18, 0), material=sr.Lambert(albedo=0.5))
    lamp = np.array([-3.0, 0.5, -1.0])
    scene = sr.Scene(mirror, side, sr.PointLight(position=lamp, intensity=3), camera=camera())
    seen = np.array([-4.0, 0, -2.0])
    way = 2 + 4 + np.linalg.norm(seen - lamp)
    frequency = 45e6
    found, light = phasor(scene, frequency, max_depth=2)
    turn = cmath.exp(-2j * math.pi * frequency / LIGHT * way)
    assert cmath.phase(found * turn) == pytest.approx(0, abs=1e-5)
    assert light == pytest.approx(abs(found), rel=1e-6)


def test_lamps_with_an_area_are_seen_and_what_is_steady_is_not():
    frequency, k = 25e6, 2 * math.pi * 25e6 / LIGHT
    lamp = sr.RectangleLight(corner=(1, -1, -2), edge_u=(-2, 0, 0), edge_v=(0, 2, 0), radiance=3, two_sided=True)
    found, light = phasor(sr.Scene(lamp, wall(4.0), camera=camera()), frequency, max_depth=0)
    assert found == pytest.approx(3 * cmath.exp(2j * k), abs=1e-6)
    assert light == pytest.approx(3)
    glowing = sr.Rectangle(corner=(-9, -9, -3), edge_u=(18, 0, 0), edge_v=(0, 18, 0), material=sr.Emitter(radiance=4))
    steady = sr.Scene(glowing, sr.DirectionalLight(direction=(0, 0, -1)), camera=camera(), background=2.0)
    assert phasor(steady, frequency) == (0, 0)
    steady = sr.Scene(wall(3.0), sr.DirectionalLight(direction=(0, 0, -1), irradiance=9), camera=camera())
    assert phasor(steady, frequency) == (0, 0)


def test_one_bounce_in_a_corner_is_the_integral_over_the_other_wall():
    """Two half-planes at right angles, x >= 0 (y = 0) and y >= 0 (x = 0), eye and lamp apart; by the midpoint rule."""
    rho, intensity, frequency = 0.8, 5.0, 80e6
    k = 2 * math.pi * frequency / LIGHT
    eye, lamp, p = np.array([1.2, 1.5, 0.0]), np.array([0.9, 1.6, 0.3]), np.array([0.7, 0.0, 0.1])
    floor = sr.Rectangle(corner=(0, 0, 6), edge_u=(6, 0, 0), edge_v=(0, 0, -12), material=sr.Lambert(albedo=rho))
    side = sr.Rectangle(corner=(0, 0, -6), edge_u=(0, 6, 0), edge_v=(0, 0, 12), material=sr.Lambert(albedo=rho))
    view = sr.PerspectiveCamera(eye=eye, target=p, vfov=0.01, width=2, height=2)
    scene = sr.Scene(floor, side, sr.PointLight(position=lamp, intensity=intensity), camera=view)

    def lit(point, normal):
        to = lamp - point
        r = np.linalg.norm(to, axis=-1)
        return intensity * np.maximum(to @ normal, 0) / r**3, r

    e, r = lit(p, np.array([0.0, 1, 0]))
    home = np.linalg.norm(eye - p)
    direct = rho / math.pi * e * cmath.exp(1j * k * (r + home))
    y, z = np.meshgrid((np.arange(1200) + 0.5) / 200, (np.arange(1200) + 0.5) / 100 - 6, indexing="ij")
    q = np.stack([np.zeros_like(y), y, z], axis=-1)
    e, r = lit(q, np.array([1.0, 0, 0]))
    way = p - q
    step = np.linalg.norm(way, axis=-1)
    form = way[..., 0] * -way[..., 1] / step**4  # both cosines over the squared distance
    once = (rho / math.pi) ** 2 * (e * form * np.exp(1j * k * (r + step + home))).sum() / 200 / 100
    found, _ = phasor(scene, frequency, samples=65536, max_depth=2)
    assert abs(direct + once - found) < 2e-3 * abs(once)
    assert abs(once) > 0.05 * abs(direct)
