"""Meshes of few triangles, asked all at once, against the tree over the same triangles: hits are the same to the bit."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sightray._jit import kernel, native
from sightray.bvh.few import FEW_WORDS, MOST, SIXTEENS, any_in_mesh, closest_in_mesh, few_ray, pack_few
from sightray.bvh.triangles import any_triangle, build_mesh, closest_triangle, pack_mesh
from sightray.mathlib.hit import Hit
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Space, Table, f64_at, f64_put, is_null, table_at
from sightray.mathlib.vec import Vec3

RAYS = 4000


@kernel
def note(out: Table, at: i64, hit: Hit, blocked: bool) -> None:
    f64_put(out, at, hit.t)
    f64_put(out, at + 1, float(hit.prim))
    f64_put(out, at + 2, hit.u)
    f64_put(out, at + 3, hit.v)
    f64_put(out, at + 4, 1.0 if blocked else 0.0)


@kernel
def trace_both(mesh: Table, rays: Table, n: i64, out: Table) -> i64:
    """What both find, ten numbers a ray; the number of rays for which no tree was walked."""
    fitting = 0
    for i in range(n):
        o = Vec3(f64_at(rays, 8 * i), f64_at(rays, 8 * i + 1), f64_at(rays, 8 * i + 2))
        d = Vec3(f64_at(rays, 8 * i + 3), f64_at(rays, 8 * i + 4), f64_at(rays, 8 * i + 5))
        t_min, t_max = f64_at(rays, 8 * i + 6), f64_at(rays, 8 * i + 7)
        note(out, 10 * i, closest_in_mesh(mesh, o, d, t_min, t_max), any_in_mesh(mesh, o, d, t_min, t_max))
        note(out, 10 * i + 5, closest_triangle(mesh, o, d, t_min, t_max), any_triangle(mesh, o, d, t_min, t_max))
        fitting += 1 if few_ray(mesh, o, d, t_min, t_max).fits else 0
    return fitting


def packed(vertices, faces):
    space = Space()
    row = space.row(FEW_WORDS)
    mesh = build_mesh(np.asarray(vertices, np.float64), np.asarray(faces, np.int32))
    pack_mesh(space, row, mesh)
    pack_few(space, row, mesh)
    return space, row


def compare(vertices, faces, o, d, t_min=0.0, t_max=math.inf):
    """Assert that both find the same; shares of rays that met something, and for which no tree was walked."""
    _space, row = packed(vertices, faces)
    assert not is_null(table_at(row, SIXTEENS))
    rays = np.column_stack([*np.broadcast_arrays(o, d), *np.broadcast_arrays(t_min, t_max, np.zeros(len(o)))[:2]])
    out = np.empty((len(rays), 10))
    fitting = native(trace_both)(row, Table(np.ascontiguousarray(rays)), len(rays), Table(out))
    np.testing.assert_array_equal(out[:, :5], out[:, 5:])
    return np.isfinite(out[:, 0]).mean(), fitting / len(rays)


def soup(rng, n, size=0.3):
    centers = rng.uniform(-1, 1, (n, 1, 3))
    return (centers + size * rng.normal(size=(n, 3, 3))).reshape(-1, 3), np.arange(3 * n).reshape(-1, 3)


def room():
    """A box seen from inside, two triangles a side, shared vertices; off the origin."""
    corners = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij"), axis=-1).reshape(-1, 3) * [5.5, 5.6, 5.4] + [
        3,
        -7,
        40,
    ]
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def on_edges(rng, vertices, faces, n):
    """Vertices and points of edges."""
    w = np.eye(3)[rng.integers(0, 3, n)]
    edge = rng.random(n) < 0.7
    w[edge] = np.roll(
        np.column_stack([rng.random((edge.sum(), 1)), np.zeros((edge.sum(), 2))]), rng.integers(3), axis=1
    )
    missing = np.roll(w[edge], 1, axis=1) > 0
    w[edge] += missing * (1 - w[edge].sum(axis=1, keepdims=True))
    return np.einsum("nk,nkd->nd", w, vertices[faces[rng.integers(0, len(faces), n)]])


@pytest.mark.parametrize("count", [1, 15, 16, 17, 40, MOST])
def test_random_triangles_from_inside_and_outside(count):
    rng = np.random.default_rng(count)
    vertices, faces = soup(rng, count)
    o, d = rng.uniform(-3, 3, (RAYS, 3)), rng.normal(size=(RAYS, 3))
    d[::2] = on_edges(rng, vertices, faces, RAYS)[::2] - o[::2] + 0.05 * d[::2]
    d *= 10 ** rng.uniform(-9, 9, (RAYS, 1))
    hits, fitting = compare(vertices, faces, o, d)
    assert hits > 0.02
    assert fitting > 0.2  # from around a small triangle most come from too far away


def test_through_edges_and_vertices_of_a_room():
    rng = np.random.default_rng(2)
    vertices, faces = room()
    o = vertices.mean(axis=0) + rng.uniform(-2, 2, (RAYS, 3))
    hits, fitting = compare(vertices, faces, o, on_edges(rng, vertices, faces, RAYS) - o)
    assert hits == 1.0
    assert fitting == 1.0


def test_from_surfaces_and_between_them():
    """Rays that begin on a triangle, as those of paths do, and end just before, on and just behind another."""
    rng = np.random.default_rng(3)
    vertices, faces = room()
    o, p = (on_edges(rng, vertices, faces, RAYS) for _ in range(2))
    inside = rng.random((RAYS, 1)) < 0.5
    o = np.where(inside, 0.5 * (o + on_edges(rng, vertices, faces, RAYS)), o)
    t_max = 1.0 + rng.choice([-1e-3, -1e-9, -1e-15, 0.0, 1e-15, 1e-9, 1e-3], RAYS)
    hits, _ = compare(vertices, faces, o, p - o, rng.choice([0.0, 1e-12, 1e-9], RAYS), t_max)
    assert 0.3 < hits < 0.999


def test_slivers_and_triangles_at_one_place():
    """Needles as thin as a triangle may be; some triangles twice, of which the lower number is named."""
    rng = np.random.default_rng(4)
    vertices, faces = soup(rng, 30)
    vertices = vertices.reshape(-1, 3, 3)
    vertices[:10, 2] = vertices[:10, 1] + 10.0 ** rng.uniform(-12, -4, (10, 1)) * rng.normal(size=(10, 3))
    vertices[20:25] = vertices[10:15]
    points = np.einsum("nk,nkd->nd", rng.dirichlet((1, 1, 1), RAYS), vertices[rng.integers(0, 30, RAYS)])
    o = rng.uniform(-2, 2, (RAYS, 3))
    hits, _ = compare(vertices.reshape(-1, 3), faces, o, points - o)
    assert hits > 0.7


def test_zeros_in_directions_and_rays_in_planes():
    rng = np.random.default_rng(5)
    vertices, faces = room()
    d = np.eye(3)[rng.integers(0, 3, RAYS)] * rng.choice([-1.0, 1.0], (RAYS, 1))
    o = vertices.mean(axis=0) + rng.choice([-2.8, -2.75, -2.7, 0.0, 2.7, 2.8], (RAYS, 3))
    hits, _ = compare(vertices, faces, o, d)
    assert 0.1 < hits < 1.0


def test_rays_that_do_not_fit_walk_the_tree():
    rng = np.random.default_rng(6)
    vertices, faces = room()
    far = vertices.mean(axis=0) + 1e4 * rng.normal(size=(RAYS, 3))
    hits, fitting = compare(vertices, faces, far, on_edges(rng, vertices, faces, RAYS) - far)
    assert hits > 0.3
    assert fitting < 0.001
    o, d = (
        np.tile(vertices.mean(axis=0), (6, 1)),
        np.array([(0, 0, 0), (1, 0, math.nan), (1e40, 0, 0), (1e-40, 0, 0), (math.inf, 1, 0), (0, 1, 0)]),
    )
    _, fitting = compare(vertices, faces, o, d, t_min=[0, 0, 0, 0, 0, math.nan])
    assert fitting == 0.0
    compare(vertices, faces, np.tile([math.nan, 0, 0], (4, 1)), np.ones((4, 3)))


def test_one_triangle_more_has_a_tree():
    vertices, faces = soup(np.random.default_rng(7), MOST + 1)
    _space, row = packed(vertices, faces)
    assert is_null(table_at(row, SIXTEENS))
