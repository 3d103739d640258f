"""Snell and Fresnel against closed forms and measured constants, through the kernels that render."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sightray._jit import kernel, native
from sightray.materials.base import local
from sightray.materials.glass import Glass
from sightray.mathlib.frame import fresnel, reflect, refract
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_put, vec3_at, vec3_put
from sightray.mathlib.vec import Vec3, dot
from sightray.scene.compile import Tables
from sightray.textures.base import anywhere

MEDIA = {  # n, R(0), Brewster's angle, critical angle, R(45), R(75)
    "water": (1.333, 0.02037319, 53.12323, 48.60663, 0.02789836, 0.21237758),
    "glass": (1.5, 0.04, 56.30993, 41.81031, 0.05023991, 0.25306056),
    "BK7": (1.5168, 0.04216456, 56.60383, 41.24519, 0.05259507, 0.25614389),
    "diamond": (2.4175, 0.17203986, 67.52754, 24.43436, 0.18118366, 0.33052122),
}


@kernel
def interface(material: Table, cos_view: f64, out: Table) -> i64:
    """Shares and eta of a material at an angle."""
    answer = local(material, anywhere(0.0, 0.0, Vec3(0.0, 0.0, 0.0)), cos_view)
    f64_put(out, 0, answer.mirror.x)
    f64_put(out, 1, answer.transmission.x)
    f64_put(out, 2, answer.eta)
    return 0


@kernel
def bend(rays: Table, eta: f64) -> i64:
    """Refract the direction at word 0 at the normal at word 4; results at 8 and, mirrored, at 12."""
    d, n = vec3_at(rays, 0), vec3_at(rays, 4)
    vec3_put(rays, 8, refract(d, n, eta))
    vec3_put(rays, 12, reflect(d, n))
    f64_put(rays, 16, fresnel(-dot(d, n), eta))
    return 0


def at_interface(ior: float, degrees: float, inside: bool = False, **options) -> tuple[float, float, float]:
    """Mirror share, transmitted share and eta at an angle of incidence, by machine code."""
    tables = Tables()
    row = tables.row_of(Glass(ior=ior, **options))
    tables.prepare(interface)
    out = np.zeros(3)
    cosine = math.cos(math.radians(degrees))
    native(interface)(row, -cosine if inside else cosine, Table(out))
    return tuple(out.tolist())


def bent(d, n, eta: float) -> tuple[np.ndarray, np.ndarray]:
    """Refracted and mirrored direction, by machine code."""
    rays = np.zeros(20)
    rays[:3], rays[4:7] = d, n
    native(bend)(Table(rays), eta)
    return rays[8:11], rays[12:15]


def incident(degrees: float) -> np.ndarray:
    """A direction that falls on the plane with normal +y at an angle of incidence."""
    return np.array([math.sin(math.radians(degrees)), -math.cos(math.radians(degrees)), 0])


UP = np.array([0.0, 1.0, 0.0])


@pytest.mark.parametrize("medium", MEDIA)
def test_fresnel_reflectance(medium):
    n, r0, _, _, r45, r75 = MEDIA[medium]
    for degrees, expected in ((0, r0), (45, r45), (75, r75)):
        mirror, passed, eta = at_interface(n, degrees)
        assert mirror == pytest.approx(expected, abs=5e-9)
        assert mirror + passed == pytest.approx(1, abs=1e-15)
        assert eta == 1 / n
    assert at_interface(n, 0)[0] == pytest.approx(((n - 1) / (n + 1)) ** 2, rel=1e-13)


@pytest.mark.parametrize("medium", MEDIA)
def test_brewster_angle_reflects_one_polarisation_only(medium):
    """There R = r_s²/2, the mirrored and the refracted ray are at right angles, and tan of the angle is n."""
    n, _, brewster, *_ = MEDIA[medium]
    assert math.degrees(math.atan(n)) == pytest.approx(brewster, abs=5e-6)
    angle = math.degrees(math.atan(n))
    refracted, mirrored = bent(incident(angle), UP, 1 / n)
    assert abs(refracted @ mirrored) < 1e-15
    r_s = (1 - n * n) / (1 + n * n)
    assert at_interface(n, angle)[0] == pytest.approx(r_s**2 / 2, rel=1e-12)


@pytest.mark.parametrize("medium", MEDIA)
def test_total_internal_reflection_begins_at_the_critical_angle(medium):
    n, _, _, critical, *_ = MEDIA[medium]
    assert math.degrees(math.asin(1 / n)) == pytest.approx(critical, abs=5e-6)
    exact = math.degrees(math.asin(1 / n))
    for degrees in (exact + 1e-6, 60 if exact < 60 else 80, 89.999):
        assert at_interface(n, degrees, inside=True) == (1, 0, n)
    mirror, passed, _ = at_interface(n, exact - 1e-3, inside=True)
    assert 0.8 < mirror < 1
    assert mirror + passed == pytest.approx(1, abs=1e-15)


@pytest.mark.parametrize("medium", MEDIA)
@pytest.mark.parametrize("degrees", [0, 20, 45, 75, 89])
def test_reflectance_is_the_same_from_both_sides(medium, degrees):
    """Stokes' relations: at the angles that belong together, R from outside is R from inside."""
    n = MEDIA[medium][0]
    within = math.degrees(math.asin(math.sin(math.radians(degrees)) / n))
    assert at_interface(n, within, inside=True)[0] == pytest.approx(at_interface(n, degrees)[0], rel=1e-9)


def test_a_bubble_is_the_medium_inside_out():
    for degrees in (0, 30, 48):
        assert at_interface(1 / 1.333, degrees) == pytest.approx(at_interface(1.333, degrees, inside=True), rel=1e-13)
    assert at_interface(1 / 1.333, 48.61) == (1, 0, 1.333)


def test_glass_as_its_surroundings_is_invisible_and_grazing_light_is_mirrored():
    assert at_interface(1, 60) == (0, 1, 1)
    assert at_interface(1.5, 90 - 1e-7)[0] == pytest.approx(1, abs=1e-7)
    assert at_interface(1.5, 45, tint=0.25)[1] == pytest.approx(0.25 * (1 - 0.05023991), abs=1e-8)


@pytest.mark.parametrize(("degrees", "expected"), [(30, 19.47122), (45, 28.12551), (60, 35.26439)])
def test_snell_refraction_into_glass(degrees, expected):
    refracted, mirrored = bent(incident(degrees), UP, at_interface(1.5, degrees)[2])
    assert math.degrees(math.acos(-refracted[1])) == pytest.approx(expected, abs=5e-6)
    np.testing.assert_allclose(np.linalg.norm(refracted), 1, rtol=1e-15)
    np.testing.assert_allclose(mirrored, incident(degrees) * (1, -1, 1), atol=1e-15)


def test_snell_in_space_and_back():
    """n1 sin i = n2 sin t in the plane of incidence; the way back is the way there."""
    rng = np.random.default_rng(0)
    for _ in range(50):
        n, d = rng.normal(size=(2, 3))
        n, d = n / np.linalg.norm(n), d / np.linalg.norm(d)
        n = -n if n @ d > 0 else n
        refracted, mirrored = bent(d, n, 1 / 1.5)
        np.testing.assert_allclose(np.cross(refracted, n), np.cross(d, n) / 1.5, atol=1e-14)
        np.testing.assert_allclose(np.cross(mirrored, n), np.cross(d, n), atol=1e-14)
        np.testing.assert_allclose(bent(-refracted, -n, 1.5)[0], -d, atol=1e-13)


def deviation(degrees: float, n: float, apex: float = 60) -> float:
    """Angle in degrees by which a prism turns a ray that meets its first face at an angle of incidence."""
    half = math.radians(apex / 2)
    first, second = np.array([-math.cos(half), math.sin(half), 0]), np.array([math.cos(half), math.sin(half), 0])
    along = np.array([math.sin(half), math.cos(half), 0])  # up the first face
    d = -first * math.cos(math.radians(degrees)) + along * math.sin(math.radians(degrees))
    inside, _ = bent(d, first, at_interface(n, degrees)[2])
    out, _ = bent(inside, -second, at_interface(n, math.degrees(math.acos(inside @ second)), inside=True)[2])
    return math.degrees(math.acos(np.clip(d @ out, -1, 1)))


def test_minimum_deviation_of_a_60_degree_prism():
    """BK7, n = 1.5168: 38.6467 degrees, where the ray passes symmetrically."""
    symmetric = math.degrees(math.asin(1.5168 * math.sin(math.radians(30))))
    assert deviation(symmetric, 1.5168) == pytest.approx(38.6467, abs=5e-5)
    assert deviation(symmetric, 1.5168) == pytest.approx(2 * symmetric - 60, abs=1e-9)
    for off in (-10, -1, -0.1, 0.1, 1, 10):
        assert deviation(symmetric + off, 1.5168) > deviation(symmetric, 1.5168)
