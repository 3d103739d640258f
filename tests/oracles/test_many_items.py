"""Scenes of many items: large batches go through the tree in packets and in turns, small ones ray by ray.

Both find the same to the last bit, whatever stands in the scene and whatever the rays.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh

import sightray as sr
from sightray.scene import queries
from sightray.scene.many_kernels import any_of_many, closest_of_many
from sightray.scene.queries import asked

T = sr.Transform
MANY = 2048  # rays that count as many here


@pytest.fixture(autouse=True)
def few_are_many(monkeypatch):
    monkeypatch.setattr(queries, "MANY_RAYS", MANY)


def bumpy_mesh(subdivisions, **options):
    ball = trimesh.creation.icosphere(subdivisions=subdivisions)
    n = np.asarray(ball.vertices)
    return sr.Mesh(vertices=n * (1 + 0.2 * np.sin(5 * n[:, :1])), faces=np.asarray(ball.faces), **options)


def somewhere(rng, size):
    """A place in a box of 20 m, turned, of about that size; mirrored half of the time."""
    scale = size * rng.uniform(0.5, 2.0, 3) * [1, 1, rng.choice([-1, 1])]
    return T.translate(*rng.uniform(-8, 8, 3)) @ T.rotate(rng.normal(size=3), 360 * rng.random()) @ T.scale(*scale)


def crowd():
    """Meshes moved and not, of which small ones are put together; other shapes; twins in the same place; a plane."""
    rng = np.random.default_rng(1)
    fine, coarse = bumpy_mesh(3), bumpy_mesh(0)
    things = [sr.Instance(of=fine if k % 3 else coarse, transform=somewhere(rng, 0.7)) for k in range(60)]
    things += [sr.Sphere(center=c, radius=rng.uniform(0.1, 0.8)) for c in rng.uniform(-8, 8, (60, 3))]
    things += [sr.Box(transform=somewhere(rng, 1.0)) for _ in range(20)]
    corner = rng.uniform(-8, 8, (20, 1, 3)) + rng.normal(size=(20, 3, 3))
    things += [sr.Mesh(vertices=c, faces=[(0, 1, 2)]) for c in corner]
    things += [sr.Plane(point=(0, 0, -9), normal=(0, 0, 1)), sr.Plane(point=(9, 0, 0), normal=(-1, 0.1, 0))]
    things += [sr.Instance(of=coarse, motion=[(0.0, T.translate(0, 0, 3)), (1.0, T.translate(1, 0, 3))])]
    twins = [*things[:12], *things[60:72]]  # in the same place: of two the one with the lower number counts
    order = rng.permutation(len(things) + len(twins))
    both = [*things, *twins]
    return sr.Scene(*[both[k] for k in order])


def spheres_alone():
    """No mesh, no plane, nothing in between."""
    rng = np.random.default_rng(2)
    return sr.Scene(*[sr.Sphere(center=c, radius=0.5) for c in rng.uniform(-8, 8, (300, 3))])


def planes_alone():
    """Nothing that has bounds: there is no tree."""
    return sr.Scene(*[sr.Plane(point=(0, 0, -k), normal=(0.1 * k, 0, 1)) for k in range(6)])


SCENES = {"crowd": crowd, "spheres": spheres_alone, "planes": planes_alone}


@pytest.fixture(scope="module", params=SCENES)
def scene(request):
    return SCENES[request.param]()


def seen_from(eye, width, side=64):
    """Rays of an eye that looks at the middle, in tiles of 8 x 8; `width` is the tangent of the whole picture's angle."""
    tile, inside = np.divmod(np.arange(side * side), 64)
    (row, column), (y, x) = np.divmod(tile, side // 8), np.divmod(inside, 8)
    forward = -np.asarray(eye) / np.linalg.norm(eye)
    right = np.cross(forward, (1, -0.5, 0.2))
    right /= np.linalg.norm(right)
    d = forward + (((column * 8 + x + 0.5) / side - 0.5) * width)[:, None] * right
    d += (((row * 8 + y + 0.5) / side - 0.5) * width)[:, None] * np.cross(right, forward)
    return np.broadcast_to(eye, d.shape).astype(float), d


def ways(kind):
    """Rays of one kind: origins and directions."""
    rng = np.random.default_rng(4)
    if kind == "coherent":
        parts = [seen_from((-5.0, 1.0, 28.0), 1.0), seen_from((0.3, 0.2, 0.1), 2.0), seen_from((2.0, 1.0, 9.0), 0.05)]
        return (np.concatenate(part) for part in zip(*parts, strict=True))
    o, d = rng.uniform(-10, 10, (6001, 3)), rng.normal(size=(6001, 3)) * rng.uniform(0.01, 100, (6001, 1))
    if kind == "mixed":  # some go their own way among those that go together
        together = seen_from((-5.0, 1.0, 28.0), 0.8)
        alone = rng.random(len(together[0])) < np.repeat(rng.choice([0.0, 0.02, 0.5], len(together[0]) // 64), 64)
        return (np.where(alone[:, None], a[: len(alone)], b) for a, b in zip((o, d), together, strict=True))
    if kind == "far":
        o, d = seen_from((-5e6, 1e6, 28e6), 6e-7)
        return o, d / np.linalg.norm(d, axis=1, keepdims=True) * 1e3
    if kind == "zeros":
        o, d = seen_from((-5.0, 1.0, 28.0), 1.0)
        d[np.arange(len(d)), rng.integers(0, 3, len(d))] = rng.choice([0.0, -0.0], len(d))
        d[: len(d) // 2] = (0.0, -0.0, -2.0)
    return o, d


def assert_same(scene, o, d, t_max=math.inf, t_min=0.0):
    """All at once finds what few at a time find; what is found."""
    o, d, t_max = np.broadcast_arrays(o, d, np.asarray(t_max)[..., None])
    t_max, n = t_max[..., 0], 2 * MANY // 3
    hits, dark = scene.intersect(o, d, t_max, t_min=t_min), scene.occluded(o, d, t_max, t_min=t_min)
    for first in range(0, len(o), n):
        part = slice(first, first + n)
        single = scene.intersect(o[part], d[part], t_max[part], t_min=t_min)
        for name in ("t", "item", "shape", "primitive"):
            np.testing.assert_array_equal(getattr(hits, name)[part], getattr(single, name))
        np.testing.assert_array_equal(dark[part], single.hit)
        np.testing.assert_array_equal(dark[part], scene.occluded(o[part], d[part], t_max[part], t_min=t_min))
    assert {closest_of_many, any_of_many} <= set(asked(scene)._kernels)
    return hits


@pytest.mark.parametrize("kind", ["coherent", "diffuse", "mixed", "far", "zeros"])
def test_many_rays_find_what_few_find(scene, kind):
    o, d = ways(kind)
    hits = assert_same(scene, o, d)
    assert hits.hit.any()
    ends = np.random.default_rng(5).uniform(0, 2, len(o)) * np.where(hits.hit, hits.t, 1.0)
    some = assert_same(scene, o, d, ends, t_min=0.1 * float(np.median(ends)))
    assert 0.05 < some.hit.sum() / hits.hit.sum() < 0.95
    again = assert_same(scene, o, d, hits.t)  # what ends at a hit does not meet it
    assert not (again.t == hits.t)[hits.hit].any()
    assert_same(scene, o, d, 3.0, t_min=-50.0)  # rays may begin behind their origin


def test_single_precision_and_other_layouts_are_read_alike(scene):
    o, d = (a.astype(np.float32) for a in ways("coherent"))
    rows = assert_same(scene, o, d)
    for name, other in (("t", scene.intersect(np.asfortranarray(o), d.astype(float))), ("item", scene.intersect(o, d))):
        np.testing.assert_array_equal(getattr(rows, name), getattr(other, name))


def test_what_is_no_ray_meets_nothing_and_disturbs_nobody(scene):
    rng = np.random.default_rng(6)
    o, d = ways("coherent")
    bad = rng.random(len(o)) < 0.1
    which, axis = np.flatnonzero(bad), rng.integers(0, 3, bad.sum())
    o[which[::3], axis[::3]] = rng.choice([math.nan, math.inf, -math.inf], len(which[::3]))
    d[which[1::3], axis[1::3]] = rng.choice([math.nan, math.inf], len(which[1::3]))
    d[which[2::3]] = 0.0
    o[which[-40:]], d[which[-40:]] = rng.choice([0.0, 1e160], (40, 3)), (0, 0, -1e60)  # too far for their squares
    o[which[-40:], 2] = 1e160
    hits = assert_same(scene, o, d)
    assert not hits.hit[bad].any()
    clean = scene.intersect(*ways("coherent"))
    np.testing.assert_array_equal(hits.t[~bad], clean.t[~bad])


def test_threads_do_not_change_what_is_found(scene):
    o, d = (np.tile(a, (4, 1)) for a in ways("mixed"))
    one, two = scene.intersect(o, d, threads=1), scene.intersect(o, d, threads=2)
    for name in ("t", "item", "primitive"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
    np.testing.assert_array_equal(scene.occluded(o, d, threads=1), scene.occluded(o, d, threads=2))


def test_twins_in_the_same_place_are_told_by_their_number():
    balls = [sr.Sphere(center=(3 * k, 0, 0)) for k in range(4)]
    scene = sr.Scene(*reversed(balls), *balls, *[sr.Box(lower=(-1, 4, -1), upper=(1, 5 + k, 1)) for k in range(4)])
    o, d = seen_from((0.0, -9.0, 1.0), 1.2)
    o += (4.5, 0, 0)
    hits = assert_same(scene, o, d)
    assert set(np.unique(hits.item)) >= {-1, 0, 1, 2, 3, 8}
    assert not np.isin(hits.item, [4, 5, 6, 7]).any()


def test_python_finds_what_machine_code_finds(monkeypatch):
    from sightray.scene import columns

    scene = crowd()
    o, d = (a[::37] for a in ways("mixed"))
    fast = scene.intersect(o, d)
    monkeypatch.setattr(queries, "MANY_RAYS", 0)
    monkeypatch.setattr(queries, "native", lambda function: function)
    monkeypatch.setattr(columns, "_PYTHON", True)
    slow = crowd()
    hits = slow.intersect(o, d)
    np.testing.assert_array_equal(hits.item, fast.item)
    np.testing.assert_array_equal(hits.primitive, fast.primitive)
    np.testing.assert_allclose(hits.t, fast.t, rtol=1e-9)
    np.testing.assert_array_equal(slow.occluded(o, d), hits.hit)
