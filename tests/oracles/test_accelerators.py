"""Every accelerator finds what asking everything finds; what each costs is counted, and says what the books say."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest

import sightray as sr
from sightray._jit import kernel, native
from sightray.accelerators.base import accelerator_named
from sightray.accelerators.primitives import _OverPrimitives
from sightray.engine.heat import heat, paint
from sightray.engine.survey import camera_rays, count_costs, survey, trace_rays
from sightray.errors import SceneError
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, f64_put, i64_put
from sightray.mathlib.tally import COUNTS, NODES, TESTS, counting
from sightray.mathlib.vec import Vec3
from sightray.registry import members
from sightray.scene.compile import Compiled
from sightray.scene.world import find_closest, is_blocked

sys.path.insert(0, str(Path(__file__).parents[1] / "families"))
from shape_examples import EXAMPLES, mesh_example

OURS = {name: cls for name, cls in members("accelerators").items() if cls.__module__.startswith("sightray.")}
VARIANTS = [
    *(cls() for name, cls in OURS.items() if name != "Brute"),
    sr.Bounds(volume="sphere"), sr.Bvh2(leaf_size=1, bins=4), sr.Bvh2(traversal_cost=0), sr.Grid(rule="woo"),
    sr.Grid(resolution=3), sr.Octree(max_depth=2), sr.Octree(leaf_size=1, growth=8, max_depth=4),
    sr.KdTree(empty_bonus=0.8), sr.Bsp(normals="axes"), sr.Bsp(traversal_cost=0),
]  # fmt: skip
CLASSIC = [v for v in VARIANTS if isinstance(v, _OverPrimitives)]
every = pytest.mark.parametrize("accelerator", VARIANTS, ids=repr)
classic = pytest.mark.parametrize("accelerator", CLASSIC, ids=repr)


@kernel
def ask(world: Table, rays: Table, n: i64, t_min: f64, t_max: f64, t: Table, hits: Table) -> None:
    """The nearest hit of each ray: t, u, v; item, primitive, and whether the ray is blocked."""
    for i in range(n):
        o = Vec3(f64_at(rays, 6 * i), f64_at(rays, 6 * i + 1), f64_at(rays, 6 * i + 2))
        d = Vec3(f64_at(rays, 6 * i + 3), f64_at(rays, 6 * i + 4), f64_at(rays, 6 * i + 5))
        hit = find_closest(world, o, d, t_min, t_max)
        f64_put(t, 3 * i, hit.t)
        f64_put(t, 3 * i + 1, hit.u)
        f64_put(t, 3 * i + 2, hit.v)
        i64_put(hits, 3 * i, hit.item)
        i64_put(hits, 3 * i + 1, hit.prim)
        i64_put(hits, 3 * i + 2, 1 if is_blocked(world, o, d, t_min, t_max) else 0)


def answers(scene, accelerator, rays, t_min=0.0, t_max=math.inf):
    compiled = Compiled(scene, accelerator)
    compiled.tables.prepare(ask)
    rays = np.ascontiguousarray(rays, np.float64)
    t, hits = np.empty((len(rays), 3)), np.empty((len(rays), 3), np.int64)
    native(ask)(compiled.world, Table(rays), len(rays), t_min, t_max, Table(t), Table(hits))
    return t, hits


_asked: dict = {}


def agree(key, scene, accelerator, rays, t_min=0.0, t_max=math.inf):
    """Assert that an accelerator finds the hits of `Brute`; t and items of those. Answers of `Brute` are kept by key."""
    if key not in _asked:
        _asked[key] = answers(scene, sr.Brute(), rays, t_min, t_max)
    (t0, hits0), (t, hits) = _asked[key], answers(scene, accelerator, rays, t_min, t_max)
    wrong = np.flatnonzero(~np.isclose(t[:, 0], t0[:, 0], rtol=1e-12, atol=1e-12))
    assert len(wrong) == 0, (len(wrong), rays[wrong[0]], t0[wrong[0]], t[wrong[0]], hits0[wrong[0]], hits[wrong[0]])
    # At the same t there may be several: then any will do.
    other = (hits[:, :2] != hits0[:, :2]).any(axis=1)
    assert ((hits[:, 0] >= 0) == (hits0[:, 0] >= 0)).all()
    np.testing.assert_allclose(t[~other, 1:], t0[~other, 1:], rtol=0, atol=1e-9)
    assert (hits[:, 2] == np.isfinite(t[:, 0])).all(), "any hit is there if there is a nearest one"
    return t[:, 0], other


def around(rng, n, size=4.0):
    """Rays of all kinds about the origin: a quarter each at random, along axes, in planes of axes, and from afar."""
    o, d = rng.uniform(-size, size, (n, 3)), rng.normal(size=(n, 3))
    k = n // 4
    d[:k] = np.eye(3)[rng.integers(0, 3, k)] * rng.choice([-1.0, 1.0, 1e-3, -50.0], (k, 1))
    d[np.arange(k, 2 * k), rng.integers(0, 3, k)] = rng.choice([0.0, -0.0], k)
    far = 10.0 ** rng.uniform(2, 6, (k, 1)) * size
    to = rng.uniform(-size, size, (k, 3))
    o[2 * k : 3 * k] = to - far * d[2 * k : 3 * k] / np.linalg.norm(d[2 * k : 3 * k], axis=1, keepdims=True)
    return np.concatenate([o, d], axis=1)


def zoo(rng):
    """All shapes as they are and moved, instances of groups, planes."""
    things = [sr.Plane(point=(0, -5, 0), normal=(0.1, 1, 0)), sr.Plane(point=(0, 0, -6), normal=(0, 0, 1))]
    for example in [e for group in EXAMPLES.values() for e in group]:
        turn = sr.Transform.rotate(rng.normal(size=3), rng.uniform(0, 360))
        place = sr.Transform.translate(*rng.uniform(-4, 4, 3)) @ turn @ sr.Transform.scale(*rng.uniform(0.3, 0.9, 3))
        things += [example.shape, sr.Instance(of=example.shape, transform=place)]
    pair = sr.Group(objects=[mesh_example(normals=1).shape, sr.Sphere(center=(1, 2, 0), radius=0.4)])
    for k in range(6):
        things.append(sr.Instance(of=pair, transform=sr.Transform.translate(k - 2, 2, -k) @ sr.Transform.scale(0.3)))
    return sr.Scene(*things)


@pytest.fixture(scope="module")
def all_shapes():
    rng = np.random.default_rng(1)
    scene, rays = zoo(rng), around(rng, 1200)
    t, hits = answers(scene, sr.Brute(), rays)
    # And from the surfaces that these met.
    on = np.isfinite(t[:, 0])
    o = rays[on, :3] + t[on, :1] * rays[on, 3:]
    assert len(np.unique(hits[:, 0])) > 40
    return scene, np.concatenate([rays, np.concatenate([o, rng.normal(size=o.shape)], axis=1)])


@every
def test_all_shapes_instances_and_planes(all_shapes, accelerator):
    scene, rays = all_shapes
    t, other = agree("zoo", scene, accelerator, rays, t_min=1e-9)  # whether a ray meets its own origin is rounding
    assert 0.3 < np.isfinite(t).mean() < 1.0
    assert other.mean() < 0.03  # two of the meshes coincide
    agree("zoo near", scene, accelerator, rays[:600], t_min=0.5, t_max=2.0)


def soup(rng, n, thin=1.0):
    corners = rng.uniform(-3, 3, (n, 1, 3)) + rng.normal(size=(n, 3, 3)) * [[[1.0], [1.0], [thin]]]
    return sr.Mesh(vertices=corners.reshape(-1, 3), faces=np.arange(3 * n).reshape(-1, 3))


def thin(rng):
    """Triangles a thousand times as long as wide."""
    n = 300
    a, along = rng.uniform(-3, 3, (n, 3)), rng.normal(size=(n, 3))
    corners = np.stack([a, a + 3 * along, a + 3 * along + 3e-3 * rng.normal(size=(n, 3))], axis=1)
    return sr.Mesh(vertices=corners.reshape(-1, 3), faces=np.arange(3 * n).reshape(-1, 3))


def lattice(rng):
    """Boxes, rectangles and triangles with whole coordinates: they touch, coincide and lie in one plane."""
    things = []
    for _ in range(60):
        corner = rng.integers(-3, 4, 3).astype(float)
        things.append(sr.Box(lower=corner, upper=corner + rng.integers(1, 3, 3)))
        u, v = np.eye(3)[rng.permutation(3)[:2]]
        things.append(sr.Rectangle(corner=corner, edge_u=u, edge_v=v))
        things.append(sr.Triangle(a=corner, b=corner + u, c=corner + v))
    p = rng.integers(-3, 4, (200, 3, 3)).astype(float)
    p = p[np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1) > 0]
    return sr.Scene(*things, sr.Mesh(vertices=p.reshape(-1, 3), faces=np.arange(p.size // 3).reshape(-1, 3)))


def sheet(rng):
    """A plane field of triangles, thousands in one plane."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(31.0), np.arange(31.0)))
    a = (np.arange(30)[:, None] * 31 + np.arange(30)).ravel()
    faces = np.concatenate([np.stack([a, a + 1, a + 31], 1), np.stack([a + 1, a + 32, a + 31], 1)])
    return sr.Mesh(vertices=np.stack([x * 0.2 - 3, 0 * x, y * 0.2 - 3], axis=1), faces=faces)


def spheres(rng):
    sizes = 10.0 ** rng.uniform(-4, 0, 200)
    return sr.Scene(*(sr.Sphere(center=c, radius=r) for c, r in zip(rng.normal(size=(200, 3)), sizes, strict=True)))


TURNED = sr.Transform.rotate((1, 2, 3), 40) @ sr.Transform.scale(1, 0.2, 1.5)
SCENES = {
    "soup": lambda rng: sr.Scene(soup(rng, 500)),
    "needles": lambda rng: sr.Scene(thin(rng)),
    "lattice": lattice,
    "sheet": lambda rng: sr.Scene(sheet(rng)),
    "turned sheet": lambda rng: sr.Scene(sr.Instance(of=sheet(rng), transform=TURNED)),
    "sheet far from the origin": lambda rng: sr.Scene(
        sr.Instance(of=sheet(rng), transform=sr.Transform.translate(1e5, -2e5, 3e5) @ TURNED)),
    "spheres of all sizes": spheres,
    "coincident": lambda rng: sr.Scene(
        *[sr.Sphere(radius=0.5)] * 40, sr.Mesh(vertices=np.eye(3), faces=np.tile([[0, 1, 2]], (90, 1)))),
}  # fmt: skip


def adversarial(rng, name, thing):
    """Rays about a scene, rays along lattice lines, and rays at corners of triangles and from them."""
    rays = around(rng, 800)
    whole = np.concatenate([rng.integers(-4, 5, (400, 3)), rng.integers(-1, 2, (400, 3))], axis=1).astype(float)
    whole = whole[whole[:, 3:].any(axis=1)]
    rays = np.concatenate([rays, whole])
    if "far" in name:
        rays[:, :3] += (1e5, -2e5, 3e5)
    if name == "needles":  # aim, or none would be met
        corners = thing.vertices.reshape(-1, 3, 3)[rng.integers(0, len(thing.faces), 800)]
        rays[:800, 3:] = np.einsum("nk,nkd->nd", rng.dirichlet((1, 1, 1), 800), corners) - rays[:800, :3]
    return rays


@every
@pytest.mark.parametrize("name", SCENES)
def test_adversarial_scenes(name, accelerator):
    rng = np.random.default_rng(7)
    scene = SCENES[name](rng)
    t, _ = agree(name, scene, accelerator, adversarial(rng, name, scene.objects[0]))
    assert np.isfinite(t).sum() > 15


@every
def test_rays_at_vertices_and_edges_of_a_closed_mesh_do_not_pass(accelerator):
    rng = np.random.default_rng(3)
    mesh = mesh_example().shape
    chosen = mesh.faces[rng.integers(0, len(mesh.faces), 400)]
    a, b = mesh.vertices[chosen[:, 0]], mesh.vertices[chosen[:, 1]]
    to = np.where(rng.random((400, 1)) < 0.5, a, a + (b - a) * rng.random((400, 1)))
    o = 0.2 * rng.normal(size=(400, 3))
    t, _ = agree("closed mesh", sr.Scene(mesh), accelerator, np.concatenate([o, to - o], axis=1))
    np.testing.assert_allclose(t, 1, atol=1e-9)


@every
def test_empty_scenes_single_items_and_planes_only(accelerator):
    rays = around(np.random.default_rng(4), 200, size=1.5)
    senseless = np.array(
        [[0, 0, 0, 0, 0, 0], [0, 0, 0, np.nan, 1, 0], [np.inf, 0, 0, 1, 0, 0], [0, 2, 0, 0, -1e-200, 0]]
    )
    for name, things in {
        "nothing": [], "ball": [sr.Sphere()], "plane": [sr.Plane()], "triangle": [mesh_example().shape],
        "moved plane": [sr.Plane(transform=TURNED), sr.Sphere(center=(1, 1, 1))],
    }.items():  # fmt: skip
        t, _ = agree(name, sr.Scene(*things), accelerator, rays)
        assert np.isfinite(t).any() == bool(things)
        agree(f"{name} senseless", sr.Scene(*things), accelerator, senseless[:3])


@classic
def test_python_and_machine_code_find_and_count_the_same(accelerator):
    rng = np.random.default_rng(5)
    scene = sr.Scene(soup(rng, 60), sr.Sphere(), sr.Plane(point=(0, -3, 0)))
    rays = np.ascontiguousarray(around(rng, 40))
    machine = count_costs(scene, accelerator, rays)
    compiled = Compiled(scene, accelerator)
    compiled.tables.prepare(trace_rays, compiled=False)
    t, hits, costs = np.empty(40), np.empty((40, 2), np.int64), np.empty((40, 2), np.int64)
    trace_rays(compiled.world, Table(rays), 40, COUNTS, Table(t), Table(hits), Table(costs))
    np.testing.assert_allclose(t, machine.t, rtol=1e-12)
    np.testing.assert_array_equal(hits, machine.hits)
    np.testing.assert_array_equal(costs, np.stack([machine.nodes, machine.tests], axis=1))
    assert machine.nodes.sum() > 40


def test_costs_of_rays_sum_to_the_tally_and_usual_builds_count_nothing():
    scene = sr.load("whitted")
    scene = scene.replace(camera=scene.camera.resized(40, 30))
    costs = count_costs(scene, sr.KdTree())
    assert COUNTS.view(np.int64)[NODES] == costs.nodes.sum() > 0
    assert COUNTS.view(np.int64)[TESTS] == costs.tests.sum() > 0
    with counting():
        pass
    answers(scene, sr.KdTree(), camera_rays(scene))
    assert not COUNTS.view(np.int64).any()


def test_a_plain_list_asks_everything():
    """Grids of one cell and leaves without end count what can be reckoned."""
    scene = sr.Scene(*(sr.Sphere(center=(x, 0, 0), radius=0.1) for x in range(10)))
    rays = np.array([[-1.0, 0, 0, 1, 0, 0], [-1.0, 5, 0, 1, 0, 0]])
    one_leaf = count_costs(scene, sr.Octree(leaf_size=10), rays)
    assert one_leaf.tests.tolist() == [10, 10]
    assert one_leaf.nodes.tolist() == [1, 1]
    cells = count_costs(scene, sr.Grid(resolution=46), rays)
    assert cells.nodes.tolist() == [1, 0]  # the first ball fills the first cell, and the other ray misses the grid
    assert cells.tests.tolist() == [1, 0]


def test_a_teapot_in_a_stadium_defeats_the_grid():
    scene = sr.load("teapot-in-stadium")
    scene = scene.replace(camera=scene.camera.resized(16, 12))
    found = survey(scene, sr.Grid())
    assert found.primitives > 50_000
    assert found.bytes > 1e6
    tree, kd, octree = (count_costs(scene, a) for a in (sr.Bvh2(), sr.KdTree(), sr.Octree()))
    for other in (tree, kd, octree):
        assert np.isfinite(other.t).sum() == found.hits
        assert found.tests_per_ray > 500 * other.tests.mean()
    assert tree.tests.mean() < 10
    assert tree.nodes.mean() < 50


def test_structures_rank_as_the_books_say():
    """Costs of cuts pay: fewer nodes and tests than halving at the median, and spheres fit worse than boxes."""
    rng = np.random.default_rng(6)
    scene, rays = sr.Scene(soup(rng, 2000, thin=0.1)), around(rng, 1000)
    bvh, bounds, balls = (count_costs(scene, a, rays) for a in (sr.Bvh2(), sr.Bounds(), sr.Bounds(volume="sphere")))
    assert bvh.nodes.sum() < 0.6 * bounds.nodes.sum()
    assert bounds.tests.sum() < balls.tests.sum()


def test_colours_of_the_heat_map_are_in_perceptual_order():
    colors = heat(np.linspace(0, 1, 256))
    luminance = colors @ [0.2126729, 0.7151522, 0.0721750]
    lightness = 116 * np.cbrt(np.maximum(luminance, (6 / 29) ** 3)) - 16
    steps = np.diff(lightness[20:])
    assert (steps > 0.5 * steps.mean()).all()
    assert (steps < 1.5 * steps.mean()).all()
    assert np.abs(np.diff(colors, axis=0)).max() < 0.06
    picture = paint(np.arange(12.0).reshape(3, 4))
    assert picture.shape[1:] == (4, 3)
    np.testing.assert_allclose(picture[:3].reshape(-1, 3), heat(np.arange(12) / 11))


def test_accelerators_by_name():
    assert isinstance(accelerator_named("kdtree"), sr.KdTree)
    assert isinstance(accelerator_named("BVH"), sr.Bvh)
    grid = sr.Grid()
    assert accelerator_named(grid) is grid
    with pytest.raises(SceneError, match="unknown accelerator 'kdtre'"):
        accelerator_named("kdtre")


@every
def test_of_hits_at_the_same_place_the_lower_number_counts(accelerator):
    """Shapes that lie in one another, and quads stated twice: the same one is seen whatever the structure."""
    quad = {
        "vertices": [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)],
        "faces": [(0, 1, 2), (0, 2, 3), (0, 1, 2), (1, 2, 3)],
    }
    scene = sr.Scene(
        sr.Sphere(center=(0, 0, -9)), sr.Rectangle(corner=(-1, -1, 0), edge_u=(2, 0, 0), edge_v=(0, 2, 0)),
        sr.Rectangle(corner=(-1, -1, 0), edge_u=(2, 0, 0), edge_v=(0, 2, 0)), sr.Sphere(center=(3, 0, 0)),
        sr.Sphere(center=(3, 0, 0)), sr.Instance(of=sr.Mesh(**quad), transform=sr.Transform.translate(0, 3, 0)),
    )  # fmt: skip
    rng = np.random.default_rng(4)
    o = np.concatenate([rng.uniform(-0.99, 0.99, (300, 2)) + move for move in ((0, 0), (3, 0), (0, 3))])
    rays = np.concatenate([o, np.full((900, 1), 5.0), np.tile([0.0, 0, -1], (900, 1))], axis=1)
    _, hits = answers(scene, accelerator, rays)
    _, expected = answers(scene, sr.Brute(), rays)
    assert (hits == expected).all()
    assert set(hits[:300, 0]) == {1}
    assert set(hits[300:600, 0]) <= {3, -1}
    assert 2 not in hits[600:, 1]  # a copy of triangle 0
