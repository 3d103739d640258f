"""Irradiance of lights against closed forms: inverse square, Lambert's polygons, disks, spheres, cones."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sightray._jit import kernel, native
from sightray.lights.base import cells, illuminate
from sightray.lights.directional import DirectionalLight
from sightray.lights.disk import DiskLight
from sightray.lights.point import PointLight
from sightray.lights.rectangle import RectangleLight
from sightray.lights.sphere import SphereLight
from sightray.lights.spot import SpotLight
from sightray.mathlib.rng import uniform
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_put, vec3_at
from sightray.mathlib.vec import dot
from sightray.scene.compile import Tables


@kernel
def irradiances(light: Table, receiver: Table, jitter: f64, trials: i64, out: Table) -> i64:
    """Irradiance of a receiver (its point and normal), once per trial; without jitter samples stand mid-cell."""
    p, n = vec3_at(receiver, 0), vec3_at(receiver, 4)
    count = cells(light)
    for trial in range(trials):
        total = 0.0
        for cell in range(count):
            u = 0.5 + jitter * (uniform(trial, 2 * cell) - 0.5)
            v = 0.5 + jitter * (uniform(trial, 2 * cell + 1) - 0.5)
            sample = illuminate(light, p, cell, u, v)
            total += sample.irradiance.x * max(0.0, dot(n, sample.direction))
        f64_put(out, trial, total)
    return count


def measured(light, point, normal=(0, 1, 0), trials: int = 1) -> np.ndarray:
    """Irradiance in `trials` independent jittered estimates; a single one takes the middle of each cell."""
    tables = Tables()
    row = tables.row_of(light)
    tables.prepare(irradiances)
    n = np.array(normal) / np.linalg.norm(normal)
    out = np.zeros(trials)
    native(irradiances)(row, Table(np.array([*point, 0, *n, 0], float)), float(trials > 1), trials, Table(out))
    return out


def lambert_polygon(vertices: np.ndarray, p, n) -> float:
    """E/L of a polygon wholly above the receiver's horizon: half the sum of angle times cosine of each wedge."""
    d = vertices - p
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    following = np.roll(d, -1, axis=0)
    wedge = np.cross(d, following)
    wedge /= np.linalg.norm(wedge, axis=1, keepdims=True)
    return abs(0.5 * np.sum(np.arccos((d * following).sum(axis=1)) * (wedge @ n)))


def agrees(light, expected: float, *where, trials: int = 400) -> None:
    """Z-test: the mean of jittered estimates lies within four standard errors of what is expected."""
    e = measured(light, *where, trials=trials)
    error = e.std(ddof=1) / math.sqrt(trials)
    assert error < 0.02 * expected
    assert abs(e.mean() - expected) < 4 * error + 1e-12 * expected


# --- points, suns and spots ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("x", "expected"), [(0, 0.25), (1, 0.1788854382), (2, 0.0883883476)])
def test_point_light_over_a_floor(x, expected):
    assert measured(PointLight(position=(0, 2, 0)), (x, 0, 0))[0] == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize("attenuation", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.5, 0.25, 2)])
@pytest.mark.parametrize("r", [0.5, 1.0, 7.0])
def test_attenuation_divides_by_a_polynomial_of_distance(attenuation, r):
    c, linear, q = attenuation
    expected = 3 / (c + linear * r + q * r * r)
    point = PointLight(position=(0, r, 0), intensity=3, attenuation=attenuation)
    spot = SpotLight(position=(0, r, 0), target=(0, 0, 0), intensity=3, attenuation=attenuation)
    assert measured(point, (0, 0, 0))[0] == pytest.approx(expected, rel=1e-14)
    assert measured(spot, (0, 0, 0))[0] == pytest.approx(expected, rel=1e-14)


def test_directional_light_travels_along_its_direction():
    noon = DirectionalLight(direction=(0, -3, 0), irradiance=2)
    evening = DirectionalLight(direction=(math.sqrt(3), -1, 0), irradiance=2)  # 60 degrees from the vertical
    assert measured(noon, (5, 5, 5))[0] == 2
    assert measured(evening, (5, 5, 5))[0] == pytest.approx(1, rel=1e-14)
    assert measured(noon, (5, 5, 5), (0, -1, 0))[0] == 0


def at_angle(spot_angle: float, blend: float, degrees: float) -> float:
    """Irradiance at distance 1 of a spot that shines down, `degrees` off its axis, facing it."""
    d = np.array([math.sin(math.radians(degrees)), -math.cos(math.radians(degrees)), 0])
    spot = SpotLight(position=(0, 0, 0), target=(0, -7, 0), intensity=1, angle=spot_angle, blend=blend)
    return measured(spot, d, -d)[0]


def test_spot_is_full_inside_dark_outside_and_smooth_between():
    assert [at_angle(60, 0.5, a) for a in (0, 10, 14.99)] == pytest.approx([1, 1, 1], rel=1e-14)
    assert [at_angle(60, 0.5, a) for a in (30.01, 60, 120, 180)] == [0, 0, 0, 0]
    halfway = math.degrees(math.acos((math.cos(math.radians(15)) + math.cos(math.radians(30))) / 2))
    assert at_angle(60, 0.5, halfway) == pytest.approx(0.5, rel=1e-9)
    fading = [at_angle(60, 0.5, a) for a in np.linspace(15, 30, 50)]
    assert (np.diff(fading) < 0).all()
    assert fading[1] > 0.99  # level at both ends, as smoothstep is
    assert fading[-2] < 0.01


def test_spot_with_a_hard_edge():
    assert [at_angle(60, 0, a) for a in (29.99, 30.01)] == pytest.approx([1, 0])
    assert [at_angle(180, 0, a) for a in (89.9, 90.1)] == pytest.approx([1, 0])


# --- lights with an area -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("grid", [1, 3])
def test_a_near_panel_leaves_only_the_noise_of_the_receivers_cosine(grid):
    """Solid angles in place of areas (Urena et al. 2013): ORACLES' square, seen from its middle at half its width."""
    panel = RectangleLight(corner=(-1, 1, -1), edge_u=(2, 0, 0), edge_v=(0, 0, 2), grid=grid)
    e = measured(panel, (0, 0, 0), trials=4000)
    expected = lambert_polygon(np.array([(-1, 1, -1), (1, 1, -1), (1, 1, 1), (-1, 1, 1)], float), np.zeros(3), (0, 1, 0))
    assert expected == pytest.approx(1.7408395027, abs=1e-9)
    assert abs(e.mean() - expected) < 4 * e.std() / math.sqrt(len(e))
    assert e.std() < 0.15 / grid * expected  # areas would give 0.50 for a single cell

SQUARE = {"corner": (-1, 1, -1), "edge_u": (2, 0, 0), "edge_v": (0, 0, 2)}  # [-1, 1]² at y = 1, shines down
CORNERS = np.array([(-1, 1, -1), (1, 1, -1), (1, 1, 1), (-1, 1, 1)], float)
LAMBERT = [((0, -1, 0), 0.7522746885), ((1, -1, 0), 0.5666451120), ((0, 0, 0), 1.7408395027)]


@pytest.mark.parametrize(("point", "expected"), LAMBERT)
def test_lambert_polygon_irradiance_of_a_square(point, expected):
    assert lambert_polygon(CORNERS, np.array(point, float), (0, 1, 0)) == pytest.approx(expected, abs=1e-10)
    agrees(RectangleLight(**SQUARE, radiance=1, grid=8), expected, point)
    agrees(RectangleLight(**SQUARE, radiance=3, grid=1), 3 * expected, point, trials=4000)
    assert measured(RectangleLight(**SQUARE, grid=64), point)[0] == pytest.approx(expected, rel=2e-4)


@pytest.mark.parametrize(("point", "expected"), LAMBERT)
def test_jittered_cells_converge_faster_than_random_points(point, expected):
    """With n² cells the error falls as n^-2 (random points: n^-1): by 16 from n = 4 to 16, of which 8 is asked."""
    coarse, fine = (measured(RectangleLight(**SQUARE, grid=n), point, trials=200).std() for n in (4, 16))
    assert coarse / fine > 8


def test_lambert_polygon_irradiance_of_a_slanted_parallelogram():
    q, u, v = np.array([-1, 3, 0.5]), np.array([2, 0.3, 0]), np.array([0.5, 0.2, 2])
    n = np.array([0.3, 1, -0.2]) / np.linalg.norm([0.3, 1, -0.2])
    expected = lambert_polygon(np.array([q, q + u, q + u + v, q + v]), np.array([0.4, 0, 0.3]), n)
    agrees(RectangleLight(corner=q, edge_u=u, edge_v=v), expected, (0.4, 0, 0.3), n)


@pytest.mark.parametrize(("radius", "height"), [(1, 1), (0.5, 3), (2, 0.5)])
def test_disk_on_its_axis(radius, height):
    light = DiskLight(center=(0, height, 0), radius=radius, radiance=2, grid=8)
    agrees(light, 2 * math.pi * radius**2 / (radius**2 + height**2), (0, 0, 0))


@pytest.mark.parametrize(("radius", "distance"), [(1, 3), (0.5, 0.6), (1e-3, 5), (2, 100)])
@pytest.mark.parametrize("tilt", [0, 40])
def test_sphere_facing_and_tilted(radius, distance, tilt):
    """E = pi L (R/d)² cos(tilt), as long as the whole sphere is above the horizon."""
    if math.degrees(math.asin(radius / distance)) + tilt > 90:
        tilt = 30
    light = SphereLight(center=(0, distance, 0), radius=radius, radiance=2, grid=8)
    normal = (math.sin(math.radians(tilt)), math.cos(math.radians(tilt)), 0)
    expected = 2 * math.pi * (radius / distance) ** 2 * math.cos(math.radians(tilt))
    agrees(light, expected, (0, 0, 0), normal)
    assert measured(light, (0, 0, 0), normal)[0] == pytest.approx(expected, rel=2e-2)


def test_small_lights_of_every_form_are_point_lights_from_afar():
    """Radiance times projected area is radiant intensity."""
    side, r, h = 0.01, 0.01, 5.0
    square = RectangleLight(corner=(-side / 2, h, -side / 2), edge_u=(side, 0, 0), edge_v=(0, 0, side), radiance=1000)
    for light, area in (
        (square, side**2),
        (DiskLight(center=(0, h, 0), radius=r, radiance=1000), math.pi * r * r),
        (SphereLight(center=(0, h, 0), radius=r, radiance=1000), math.pi * r * r),
    ):
        point = PointLight(position=(0, h, 0), intensity=1000 * area)
        assert measured(light, (0, 0, 0))[0] == pytest.approx(measured(point, (0, 0, 0))[0], rel=1e-4)
