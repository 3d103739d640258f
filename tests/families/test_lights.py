"""Lights: what every one promises."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from sightray._jit import kernel, native
from sightray.errors import SceneError
from sightray.lights.area import _AreaLight
from sightray.lights.base import cells, direction_density, illuminate, sky
from sightray.lights.directional import DirectionalLight
from sightray.lights.disk import DiskLight, concentric
from sightray.lights.environment import EnvironmentLight
from sightray.lights.point import PointLight
from sightray.lights.projector import ProjectorLight
from sightray.lights.rectangle import RectangleLight
from sightray.lights.sphere import SphereLight
from sightray.lights.spot import SpotLight
from sightray.lights.sunsky import SunSky
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, f64_at, f64_put, vec3_at, vec3_put
from sightray.mathlib.transform import Transform
from sightray.mathlib.vec import Vec3
from sightray.registry import members
from sightray.scene.compile import Tables
from sightray.shapes.base import intersect

PICTURE = np.random.default_rng(5).uniform(0, 1, (9, 14, 3)) ** 4
PICTURE[2, 3] = 30
PICTURE[5:7, 8:11] = 0
TURN = Transform.rotate((1, 2, -0.5), 70)
SLANTED = {"corner": (-1, 3, 0.5), "edge_u": (2, 0.3, 0), "edge_v": (0.5, 0.2, 2)}
EXAMPLES = {
    "PointLight": [PointLight(position=(1, 2, 3)), PointLight(position=(0, 0, 9), attenuation=(1, 0.5, 0.1))],
    "DirectionalLight": [DirectionalLight(direction=(1, -2, 0.5), irradiance=(1, 2, 3)), DirectionalLight()],
    "SpotLight": [
        SpotLight(position=(0, 3, 0), target=(0, 0, 0), angle=90, blend=0.5),
        SpotLight(position=(1, 1, 1), target=(-1, 0, 0), angle=180, blend=0, intensity=(3, 2, 1)),
    ],
    "RectangleLight": [
        RectangleLight(**SLANTED, grid=3),
        RectangleLight(**SLANTED, radiance=2, two_sided=True),
        RectangleLight(corner=(-2, 1, -1), edge_u=(4, 0, 1), edge_v=(0, 3, 0), two_sided=True),
    ],
    "DiskLight": [
        DiskLight(center=(0, 2, 0), radius=0.7),
        DiskLight(center=(1, 2, 3), normal=(-1, -3, 2), two_sided=True, grid=5, radiance=(3, 0, 1)),
    ],
    "SphereLight": [SphereLight(center=(0, 2, 0)), SphereLight(center=(3, -1, 2), radius=1.7, grid=7)],
    "EnvironmentLight": [
        EnvironmentLight(radiance=(1, 0.5, 2)),
        EnvironmentLight(image=PICTURE, radiance=0.5, transform=TURN, grid=3),
    ],
    "SunSky": [
        SunSky(scale=0.01, sun_radius=6, ground=(0.1, 0.3, 0.2)),
        SunSky(time="2024-06-21T15:30+02:00", latitude=52.5, longitude=13.4, turbidity=6, sky_scale=0.5, grid=2),
    ],
    "ProjectorLight": [
        ProjectorLight(image=PICTURE, eye=(0, 8, 1), vfov=80),
        ProjectorLight(image=PICTURE[:, :, :1], eye=(7, 1, 2), vfov=120, filter="nearest", intensity=(3, 2, 1)),
    ],
}
EVERY = [pytest.param(x, id=f"{name}-{i}") for name, all_of in EXAMPLES.items() for i, x in enumerate(all_of)]
AREA = [p for p in EVERY if isinstance(p.values[0], _AreaLight)]
SKIES = [p for p in EVERY if p.values[0].infinite]


@kernel
def ask(light: Table, count: i64, points: Table, samples: Table) -> i64:
    """`illuminate` for many points, each p, u, v in 6 words of 8; the cell is the point's number, round and round."""
    total = cells(light)
    for i in range(count):
        x = illuminate(light, vec3_at(points, 8 * i), i % total, f64_at(points, 8 * i + 4), f64_at(points, 8 * i + 5))
        vec3_put(samples, 8 * i, x.direction)
        vec3_put(samples, 8 * i + 4, x.irradiance)
        f64_put(samples, 8 * i + 3, x.distance)
    return total


@kernel
def meet(shape: Table, count: i64, samples: Table, points: Table, distances: Table) -> i64:
    """Where the rays towards the samples meet a shape."""
    for i in range(count):
        hit = intersect(shape, vec3_at(points, 8 * i), vec3_at(samples, 8 * i), 0.0, math.inf)
        f64_put(distances, i, hit.t)
    return count


def samples_of(light, points: np.ndarray, compiled: bool = True) -> tuple[int, np.ndarray]:
    """Number of cells, and (n, 8): direction, distance, irradiance, of points (n, 8): p, 0, u, v."""
    tables = Tables()
    row = tables.row_of(light)
    tables.prepare(ask, compiled=compiled)
    out = np.zeros((len(points), 8))
    total = (native(ask) if compiled else ask)(row, len(points), Table(points), Table(out))
    return total, out


def met(shape, samples: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Distances at which rays from the points in the samples' directions meet a shape."""
    tables = Tables()
    row = tables.row_of(shape)
    tables.prepare(meet)
    distances = np.zeros(len(points))
    native(meet)(row, len(points), Table(samples), Table(points), Table(distances))
    return distances


def random_points(count: int = 200, seed: int = 0, spread: float = 6.0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    points = np.zeros((count, 8))
    points[:, :3] = rng.uniform(-spread, spread, (count, 3))
    points[:, 4:6] = rng.uniform(0, 1, (count, 2))
    return points


def at(*places) -> np.ndarray:
    points = np.zeros((len(places), 8))
    points[:, :3] = places
    points[:, 4:6] = 0.5
    return points


def test_no_light_lacks_an_example():
    assert set(EXAMPLES) == {n for n, cls in members("lights").items() if cls.__module__.startswith("sightray.")}


@pytest.mark.parametrize("light", EVERY)
def test_machine_code_answers_as_python_does(light):
    points = random_points()
    total, expected = samples_of(light, points, compiled=False)
    found_total, found = samples_of(light, points)
    assert total == found_total == getattr(light, "grid", 1) ** 2
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("light", EVERY)
def test_directions_are_unit_and_light_is_finite_and_not_negative(light):
    _, samples = samples_of(light, random_points())
    np.testing.assert_allclose(np.linalg.norm(samples[:, :3], axis=1), 1, rtol=1e-14)
    assert (samples[:, 3] > 0).all()
    assert (samples[:, 4:7] >= 0).all()
    assert np.isfinite(samples[:, 4:7]).all()
    assert samples[:, 4:7].any()


@pytest.mark.parametrize("light", EVERY)
def test_light_is_proportional_to_its_colour(light):
    (name,) = {"intensity", "irradiance", "radiance", "scale"} & set(light.fields)
    points = random_points()
    white = samples_of(light.replace(**{name: 1}), points)[1][:, 4:7]
    coloured = samples_of(light.replace(**{name: (0, 0.5, 40)}), points)[1][:, 4:7]
    np.testing.assert_allclose(coloured, white * (0, 0.5, 40), rtol=1e-12)


@pytest.mark.parametrize("light", EVERY)
def test_plain_values_make_the_same_light(light):
    plain = {name: light.fields[name].plain(value) for name, value in light.values().items()}
    if "image" in plain and plain["image"] is not None:
        plain["image"] = np.asarray(plain["image"], float)
    again = type(light)(**plain).values()
    for name, value in light.values().items():
        assert np.array_equal(again[name], value)
    assert repr(light.replace()) == repr(light)


@kernel
def densities(light: Table, count: i64, points: Table, samples: Table, out: Table) -> i64:
    """Radiance of the sky in the samples' directions, and with which density `illuminate` chooses them."""
    for i in range(count):
        p, d = vec3_at(points, 8 * i), vec3_at(samples, 8 * i)
        vec3_put(out, 4 * i, sky(light, Vec3(d.x, d.y, d.z)))
        f64_put(out, 4 * i + 3, direction_density(light, p, d, f64_at(samples, 8 * i + 3)))
    return count


def radiance_and_density(light, points: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """(n, 4): radiance of the sky, and density of the directions of `samples`, as `samples_of` gives them."""
    tables = Tables()
    row = tables.row_of(light)
    tables.prepare(densities)
    out = np.zeros((len(points), 4))
    native(densities)(row, len(points), Table(points), Table(samples), Table(out))
    return out


@pytest.mark.parametrize("light", AREA + SKIES)
def test_what_arrives_is_radiance_over_density(light):
    points = random_points(2000)
    total, samples = samples_of(light, points)
    found = radiance_and_density(light, points, samples)
    radiance = found[:, :3] if light.infinite else np.broadcast_to(light.radiance, (len(points), 3))
    lit = samples[:, 4:7].any(axis=1)
    assert lit.sum() > 200
    np.testing.assert_allclose((samples[:, 4:7] * total * found[:, 3:])[lit], radiance[lit], rtol=1e-6, atol=1e-9)


SAMPLED = [pytest.param(*p.values, q, id=f"{p.id}-{k}") for p in AREA + SKIES
           for k, q in enumerate([(0.1, 0.5, -0.2), (2.5, 1.1, 0.7)])
           if p.id != "SunSky-1" and (p.values[0].infinite or k == 0 or p.id != "SphereLight-1")]  # fmt: skip


@pytest.mark.parametrize(("light", "p"), SAMPLED)
def test_directions_follow_their_density_by_a_chi_square_test(light, p):
    """Counts of sampled directions in 200 pieces of the sphere, against the mean density over random directions."""
    count = 400_000
    points = random_points(count, seed=3)
    points[:, :3] = p
    samples = samples_of(light, points)[1]

    rng = np.random.default_rng(4)
    even = np.zeros((4 * count, 8))
    even[:, :3] = rng.normal(size=(len(even), 3))
    even[:, :3] /= np.linalg.norm(even[:, :3], axis=1, keepdims=True)
    even[:, 3] = np.inf
    around = np.zeros((len(even), 8))
    around[:, :3] = p
    if not light.infinite:
        even[:, 3] = met(light.shape(), even, around)
    seen = light.infinite | np.isfinite(even[:, 3])
    density = np.where(seen, radiance_and_density(light, around, even)[:, 3], 0.0)

    def pieces(d, weights):
        angle = np.arctan2(d[:, 0], d[:, 2])
        return np.histogram2d(d[:, 1], angle, (10, 20), ((-1, 1), (-math.pi, math.pi)), weights=weights)[0].ravel()

    share = 4 * math.pi / len(even)
    found, expected = pieces(samples, np.full(count, 1 / count)), pieces(even, density * share)
    variance = expected / count + pieces(even, (density * share) ** 2)
    well_known = expected * count > 30
    z = ((found - expected) / np.sqrt(np.where(variance > 0, variance, 1)))[well_known]
    assert 1 - stats.chi2.cdf((z**2).sum(), len(z)) > 1e-4
    assert found[expected == 0].sum() < 20 / count

    # Over all directions that see the light, densities sum up to 1.
    whole, error = density.mean() * 4 * math.pi, density.std() * 4 * math.pi / math.sqrt(len(even))
    assert error < 0.05
    assert abs(whole - 1) < 4 * error + 1e-9


# --- lights with an area -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("light", AREA)
def test_samples_lie_on_the_shape_that_is_seen(light):
    points = random_points()
    _, samples = samples_of(light, points)
    distances = met(light.shape(), samples, points)
    lit = samples[:, 4:7].any(axis=1)
    assert lit.sum() > 20
    np.testing.assert_allclose(distances[lit], samples[lit, 3], rtol=1e-6)


@pytest.mark.parametrize("light", AREA)
def test_the_shape_glows_with_the_lights_radiance(light):
    assert light.shape().material.radiance == light.radiance
    assert light.shape().material.two_sided == getattr(light, "two_sided", False)
    assert light.replace(visible=False).shape() is None


@pytest.mark.parametrize("light", [p for p in EVERY if p not in AREA])
def test_lights_without_an_area_are_not_seen(light):
    assert light.shape() is None


def test_a_one_sided_light_is_dark_behind_and_the_shape_shines_to_the_lit_side():
    below, above = (0.2, 0, 0.1), (0.2, 4, 0.1)
    down = {"corner": (-1, 2, -1), "edge_u": (2, 0, 0), "edge_v": (0, 0, 2)}  # x cross z is down
    for light in (RectangleLight(**down), DiskLight(center=(0, 2, 0), normal=(0, -5, 0))):
        _, (lit, dark) = samples_of(light, at(below, above))
        assert lit[4] > 0
        assert not dark[4:7].any()
        assert 0 < dark[3] < 10
        _, (a, b) = samples_of(light.replace(two_sided=True), at(below, above))
        assert a[4] > 0
        assert b[4] > 0
        assert np.dot(light.shape().values().get("normal", (0, -1, 0)), (0, -1, 0)) > 0


@pytest.mark.parametrize(("light", "places"), [
    (RectangleLight(corner=(0, 0, 0), edge_u=(1, 0, 0), edge_v=(0, 1, 0), grid=1), [(0.5, 0.5, 0), (9, 9, 0)]),
    (DiskLight(center=(0, 0, 0), normal=(0, 0, 1), grid=1), [(0, 0, 0), (0.5, 0.5, 0), (3, 0, 0)]),
    (SphereLight(center=(1, 0, 0), radius=1, grid=1), [(1, 0, 0), (0, 0, 0), (1.5, 0, 0)]),
    (SpotLight(position=(0, 0, 0), target=(1, 0, 0)), [(0, 0, 0)]),
])  # fmt: skip
def test_points_on_and_in_a_light_get_nothing_from_it(light, places):
    _, samples = samples_of(light, at(*places))
    assert not samples[:, 4:7].any()
    assert np.isfinite(samples).all()
    np.testing.assert_allclose(np.linalg.norm(samples[:, :3], axis=1), 1, rtol=1e-14)


@kernel
def fold(count: i64, points: Table) -> i64:
    """Send points of the unit square through the concentric map, in place."""
    for i in range(count):
        vec3_put(points, 4 * i, concentric(f64_at(points, 4 * i), f64_at(points, 4 * i + 1)))
    return count


def test_shirley_chiu_concentric_map_keeps_areas():
    """Even points of the square are even in r² and phi, by a chi-square test over 10 x 24 pieces of equal area."""
    points = np.random.default_rng(0).uniform(0, 1, (100_000, 4))
    native(fold)(len(points), Table(points))
    x, y = points[:, 0], points[:, 1]
    pieces = np.histogram2d(x * x + y * y, np.arctan2(y, x), (10, 24), ((0, 1), (-math.pi, math.pi)))[0]
    assert pieces.sum() == len(points)
    assert stats.chisquare(pieces.ravel()).pvalue > 1e-3

    # Neighbours stay neighbours, also across the diagonals, where the map changes its formula.
    near = np.random.default_rng(1).uniform(0, 0.99, (10_000, 4))
    moved = near + (1e-5, 1e-5, 0, 0) * np.random.default_rng(2).choice([-1, 0, 1], (10_000, 4))
    near[:, 1] = np.where(np.arange(10_000) % 2, near[:, 0], 1 - near[:, 0])
    moved[:, 1] = near[:, 1]
    native(fold)(len(near), Table(near))
    native(fold)(len(moved), Table(moved))
    assert np.linalg.norm(near[:, :2] - moved[:, :2], axis=1).max() < 4e-5

    centre = np.array([[0.5, 0.5, 1, 1]])
    native(fold)(1, Table(centre))
    assert centre[0, :2].tolist() == [0, 0]


def test_cells_share_the_square_without_overlap():
    light = RectangleLight(corner=(0, 0, 0), edge_u=(4, 0, 0), edge_v=(0, 4, 0), grid=4)
    points = random_points(1600)
    points[:, :3] = 1, 2, 30  # so far away that areas count, not solid angles
    total, samples = samples_of(light, points)
    q = points[:, :3] + samples[:, :3] * samples[:, 3:4]
    cell = np.floor(q[:, 0]).astype(int) + 4 * np.floor(q[:, 1]).astype(int)
    np.testing.assert_array_equal(cell, np.arange(1600) % total)


@pytest.mark.parametrize(("make", "message"), [
    (lambda: DirectionalLight(direction=(0, 0, 0)), r"DirectionalLight\.direction: .*not all zero"),
    (lambda: DirectionalLight(irradiance=-1), r"DirectionalLight\.irradiance"),
    (lambda: SpotLight(position=(1, 2, 3), target=(1, 2, 3)), r"SpotLight: position and target are the same point"),
    (lambda: SpotLight(position=(1, 2, 3), target=(0, 0, 0), angle=181), r"SpotLight\.angle: got 181; .*<= 180"),
    (lambda: SpotLight(position=(1, 2, 3), target=(0, 0, 0), blend=2), r"SpotLight\.blend: got 2"),
    (lambda: SpotLight(position=(1, 2, 3), target=(0, 0, 0), attenuation=(0, 0, 0)), r"attenuation: .*not all zero"),
    (lambda: RectangleLight(corner=(0, 0, 0), edge_u=(1, 2, 3), edge_v=(2, 4, 6)), r"RectangleLight: .* parallel"),
    (lambda: RectangleLight(corner=(0, 0, 0), edge_u=(1, 2, 3)), r"RectangleLight\.edge_v: missing"),
    (lambda: DiskLight(center=(0, 0, 0), radius=0), r"DiskLight\.radius: got 0; .*> 0"),
    (lambda: DiskLight(center=(0, 0, 0), grid=0), r"DiskLight\.grid: got 0; .*>= 1"),
    (lambda: SphereLight(center=(0, 0, 0), grid=2.5), r"SphereLight\.grid: got 2\.5; allowed: a whole number"),
    (lambda: SphereLight(centre=(0, 0, 0)), r"SphereLight: unknown field 'centre'; did you mean 'center'\?"),
])  # fmt: skip
def test_errors_say_where_what_and_what_is_allowed(make, message):
    with pytest.raises(SceneError, match=message):
        make()
