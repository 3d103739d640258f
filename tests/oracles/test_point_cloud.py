"""Clouds of points measured on a sphere: how fast their surface converges to it, and how well normals are found."""

from __future__ import annotations

import numpy as np
import pytest

import sightray as sr
from sightray.bvh.neighbours import neighbours


def norm(a):
    return np.linalg.norm(a, axis=-1)


def sphere_points(n, rng=None):
    """By the golden angle: as evenly as can be; or at random."""
    if rng is not None:
        p = rng.normal(size=(n, 3))
        return p / norm(p)[:, None]
    z, angle = 1 - (2 * np.arange(n) + 1) / n, np.pi * (1 + 5**0.5) * np.arange(n)
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1)


def rays_at_sphere(n, rng):
    """From outside to points well inside the unit sphere."""
    o = 3 * sphere_points(n, rng)
    return o, 0.6 * sphere_points(n, rng) * rng.uniform(0, 1, (n, 1)) - o


def root_mean_square(a):
    return float(np.sqrt((a**2).mean()))


@pytest.mark.parametrize("given", [True, False], ids=["normals given", "normals estimated"])
def test_hits_converge_as_the_square_of_the_spacing(given):
    """The slope of log error over log spacing is 2, for even sampling from 300 to 20,000 points."""
    rng = np.random.default_rng(5)
    o, d = rays_at_sphere(2000, rng)
    spacings, errors, tilts = [], [], []
    for n in (300, 1200, 5000, 20000):
        points = sphere_points(n)
        cloud = sr.PointCloud(points=points, normals=points if given else None)
        hits = sr.Scene(cloud).intersect(o, d)
        assert hits.hit.all()
        spacings.append(cloud.fit().spacing)
        errors.append(root_mean_square(norm(hits.position) - 1))
        tilts.append(norm(np.cross(hits.normal, hits.position)).max())
        assert ((hits.normal * hits.position).sum(-1) > 0.9).all()
    slope = np.polyfit(np.log(spacings), np.log(errors), 1)[0]
    assert slope == pytest.approx(2, abs=0.1)
    assert errors[-1] < 1e-3
    assert tilts[-1] < 0.1


def test_random_sampling_converges_too():
    """Points at random have holes and crowds: the surface is closed, and errors still fall about as the square."""
    rng = np.random.default_rng(6)
    o, d = rays_at_sphere(1500, rng)
    errors, sizes = [], (2000, 32000)
    for n in sizes:
        hits = sr.Scene(sr.PointCloud(points=sphere_points(n, rng))).intersect(o, d)
        assert hits.hit.mean() > 0.995
        errors.append(np.median(np.abs(norm(hits.position[hits.hit]) - 1)))
    slope = np.log(errors[0] / errors[1]) / np.log(np.sqrt(sizes[1] / sizes[0]))
    assert 1.7 < slope < 2.4


def test_planes_are_met_exactly():
    rng = np.random.default_rng(7)
    points = np.column_stack([rng.uniform(-1, 1, (3000, 2)), np.zeros(3000)])
    o = np.column_stack([rng.uniform(-0.8, 0.8, (500, 2)), np.ones(500)])
    d = np.column_stack([rng.uniform(-0.1, 0.1, (500, 2)), -np.ones(500)])
    for kind in ("smooth", "splats"):
        hits = sr.Scene(sr.PointCloud(points=points, surface=kind)).intersect(o, d)
        assert hits.hit.mean() > (0.995 if kind == "smooth" else 0.9)
        np.testing.assert_allclose(hits.t[hits.hit], 1, atol=1e-12)
        np.testing.assert_allclose(np.abs(hits.normal[hits.hit]), np.broadcast_to((0, 0, 1), (hits.hit.sum(), 3)),
                                   atol=1e-7)  # fmt: skip


def test_layers_enter_and_leave():
    rng = np.random.default_rng(8)
    o, d = rays_at_sphere(300, rng)
    layers = sr.Scene(sr.PointCloud(points=sphere_points(3000))).intersect_all(o, d)
    assert (np.diff(layers.offsets) == 2).all()
    assert (layers.entering == np.tile([True, False], 300)).all()


def test_neighbours_are_those_of_brute_force():
    rng = np.random.default_rng(9)
    points = np.concatenate([rng.normal(size=(400, 3)), 1e-3 * rng.normal(size=(100, 3)), np.ones((5, 3))])
    _, distances = neighbours(points, 7)
    every = norm(points[:, None] - points[None])
    np.fill_diagonal(every, np.inf)
    np.testing.assert_allclose(distances, np.sort(every, axis=1)[:, :7], rtol=1e-12, atol=1e-15)


def test_a_line_through_more_balls_than_there_is_room_for():
    """A ray along a plane of 40,000 points meets more balls than its list holds, and still only what is there."""
    side = np.linspace(-1, 1, 200)
    x, y = np.meshgrid(side, side)
    sheet = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    cloud = sr.PointCloud(points=sheet, normals=np.tile([0.0, 0, 1], (len(sheet), 1)), radius=0.06)
    o, d = np.array([[-3.0, 0.3, 0.03]]), np.array([[1.0, 0, -0.01]])
    assert sr.Scene(cloud).intersect(o, d).t == pytest.approx([3.0], abs=1e-9)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"points": np.zeros((0, 3))}, "PointCloud.points"),
        ({"points": np.eye(3)}, "at least 4"),
        ({"points": np.ones((9, 3)), "normals": np.zeros((9, 3))}, "PointCloud.normals"),
        ({"points": np.ones((9, 3)), "radius": np.ones(8)}, "PointCloud.radius"),
        ({"points": np.ones((9, 3)), "radius": -1}, "PointCloud.radius: .*allowed: a finite number > 0"),
    ],
)
def test_senseless_clouds_are_refused(values, message):
    with pytest.raises(sr.SceneError, match=message):
        sr.PointCloud(**values)
