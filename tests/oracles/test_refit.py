"""Refitted trees find what trees find that are built anew, however the vertices have moved."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import trimesh
from hypothesis import example, given, settings
from hypothesis import strategies as st

import sightray as sr
from sightray._jit import native
from sightray.bvh.binned_sah import unit_frame
from sightray.bvh.bvh8 import CHILDREN, LEAF
from sightray.bvh.refit import expected_cost, refit, refit_mesh
from sightray.bvh.triangles import build_mesh
from sightray.mathlib.table import Table, no_table

DEFORMATIONS = ("same", "bent", "noise", "blown up", "far", "flat", "shuffled")


def ball(subdivisions):
    shape = trimesh.creation.icosphere(subdivisions=subdivisions)
    return np.asarray(shape.vertices), np.asarray(shape.faces)


def deformed(v, kind, rng):
    if kind == "bent":
        angle = 2.0 * v[:, 2:]
        turned = np.concatenate([v[:, :1] * np.cos(angle) - v[:, 1:2] * np.sin(angle),
                                 v[:, :1] * np.sin(angle) + v[:, 1:2] * np.cos(angle), v[:, 2:]], axis=1)  # fmt: skip
        return turned + 0.3 * v[:, 2:] ** 2
    if kind == "noise":
        return v + rng.uniform(0.01, 0.3) * rng.normal(size=v.shape)
    if kind == "blown up":
        return v * np.exp(rng.uniform(-2, 2, (len(v), 1)))
    if kind == "far":
        return v * 1e-3 + 1e6
    if kind == "flat":
        return v * (1, 1, 1e-6)
    return rng.permutation(v) if kind == "shuffled" else v.copy()


def rays(rng, v, f, n=1500):
    """From all around, a third each: at corners, at edges, anywhere."""
    center, size = v.mean(axis=0), np.ptp(v, axis=0).max()
    corner = v[f[rng.integers(0, len(f), n)]]
    weights = rng.dirichlet((1, 1, 1), n)
    weights[: n // 3] = (1, 0, 0)
    weights[n // 3 : 2 * n // 3, 2] = 0
    o = center + size * rng.normal(size=(n, 3))
    return o, (corner * weights[..., None]).sum(axis=1) - o


def moved(mesh, v):
    """The mesh over other vertices, by refitting, whatever that makes of its tree."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return mesh.with_vertices(v)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.sampled_from(DEFORMATIONS), st.integers(0, 3), st.booleans())
@example(1, "shuffled", 3, True)
def test_hits_are_those_of_a_tree_built_anew(seed, kind, subdivisions, again):
    rng = np.random.default_rng(seed)
    v, f = ball(subdivisions)
    old = sr.Mesh(vertices=v, faces=f)
    w = deformed(v, kind, rng)
    refitted = moved(old, w)
    if again:  # the tree of a tree, on another way to the same place
        refitted = moved(moved(old, deformed(v, "noise", rng)), w)
    fresh, scene = sr.Scene(sr.Mesh(vertices=w, faces=f)), sr.Scene(refitted)
    o, d = rays(rng, w, f)
    a, b = scene.intersect(o, d), fresh.intersect(o, d)
    assert b.hit.mean() > 0.3
    for name in ("t", "primitive", "uv", "normal", "position"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    np.testing.assert_array_equal(scene.occluded(o, d), fresh.occluded(o, d))
    few = slice(0, 300)
    np.testing.assert_array_equal(scene.count(o[few], d[few]), fresh.count(o[few], d[few]))
    np.testing.assert_array_equal(scene.closest_point(o[few]).distance, fresh.closest_point(o[few]).distance)
    single = [sr.Sphere(center=(1e9, 0, k), radius=1) for k in range(5)]  # so many items are asked ray by ray
    np.testing.assert_array_equal(sr.Scene(refitted, *single).intersect(o, d).t, b.t)


def test_the_old_mesh_stays_and_topology_is_shared():
    v, f = ball(3)
    old = sr.Mesh(vertices=v, faces=f, uvs=v[:, :2], name="ball")
    nodes, blocks = old.tree().tree.nodes.copy(), old.tree().blocks.copy()
    new = old.with_vertices(2 * v + 1)
    np.testing.assert_array_equal(old.tree().tree.nodes, nodes)
    np.testing.assert_array_equal(old.tree().blocks, blocks)
    assert new.tree().numbers is old.tree().numbers
    assert new.tree().tree.order is old.tree().tree.order
    assert new.faces is old.faces
    assert (new.name, new.uvs is old.uvs) == ("ball", True)
    np.testing.assert_array_equal(new.bounds(), ((v * 2 + 1).min(axis=0), (v * 2 + 1).max(axis=0)))


def test_triangles_that_lose_their_area_keep_their_numbers():
    v, f = ball(2)
    mesh = sr.Mesh(vertices=v, faces=f)
    w = v.copy()
    w[f[7, 1]] = w[f[7, 0]]  # folds two triangles into lines
    with pytest.warns(UserWarning, match="2 triangles without area were dropped"):
        fresh = sr.Scene(sr.Mesh(vertices=w, faces=f))
    kept = np.flatnonzero([len({tuple(p) for p in w[face]}) == 3 for face in f])
    o, d = rays(np.random.default_rng(1), w, f)
    a, b = sr.Scene(moved(mesh, w)).intersect(o, d), fresh.intersect(o, d)
    np.testing.assert_array_equal(a.t, b.t)
    np.testing.assert_array_equal(a.primitive[b.hit], kept[b.primitive[b.hit]])


def test_vertices_that_no_face_names_are_left_out():
    v, f = ball(1)
    loose = np.concatenate([v, [(1e9, 0, 0)]])
    refitted = sr.Mesh(vertices=loose, faces=f).with_vertices(loose * 3)
    assert refitted.tree().tree.scale == sr.Mesh(vertices=v * 3, faces=f).tree().tree.scale
    o, d = rays(np.random.default_rng(2), 3 * v, f)
    expected = sr.Scene(sr.Mesh(vertices=3 * v, faces=f)).intersect(o, d).t
    np.testing.assert_array_equal(sr.Scene(refitted).intersect(o, d).t, expected)


def test_normals_move_too():
    v, f = ball(2)
    mesh = sr.Mesh(vertices=v, faces=f, normals=v)
    hits = sr.Scene(mesh.with_vertices(v * (1, 1, 2), normals=-v)).intersect((0.1, 0.2, 9), (0, 0, -1))
    assert hits.shading_normal[2] < -0.9
    assert hits.normal[2] > 0.9


def test_cost_and_quality():
    """The cost is the sum of surfaces in the nodes; motion as a whole keeps the quality, a shuffle ruins it."""
    v, f = ball(4)
    mesh = sr.Mesh(vertices=v, faces=f)
    nodes = mesh.tree().tree.nodes
    e = nodes[:, :48].reshape(-1, 3, 2, 8)
    there = nodes.view(np.int32)[:, CHILDREN : CHILDREN + 8] > 0
    x, y, z = np.where(there[:, None], e[:, :, 1] - e[:, :, 0], 0.0).astype(float).transpose(1, 0, 2)
    low, high = e[0, :, 0].min(axis=1), e[0, :, 1].max(axis=1)
    a, b, c = (high - low).astype(float)
    assert expected_cost(mesh.tree()) == pytest.approx((x * y + y * z + z * x).sum() / (a * b + b * c + c * a), rel=1e-6)

    assert mesh.tree_quality == 1
    assert mesh.with_vertices(v).tree_quality == 1
    assert mesh.with_vertices(100 * v + (5, 6, 7)).tree_quality == pytest.approx(1, abs=1e-3)
    rng = np.random.default_rng(3)
    worse = mesh.with_vertices(v + 0.02 * rng.normal(size=v.shape))
    assert 0.5 < worse.tree_quality < 0.99
    with pytest.warns(UserWarning, match=r"with_vertices: the tree .* has 0\.\d+ of its quality.*builds another"):
        ruined = worse.with_vertices(rng.permutation(v))
    assert ruined.tree_quality < 0.1
    assert ruined.with_vertices(v).tree_quality == pytest.approx(1)  # the yardstick is the tree that was built


def test_a_tree_refitted_to_its_own_vertices_is_the_same():
    v, f = ball(3)
    built = build_mesh(v, f.astype(np.int32))
    again = refit_mesh(built, v)
    np.testing.assert_array_equal(again.tree.nodes, built.tree.nodes)
    np.testing.assert_array_equal(again.blocks, built.blocks)


def test_boxes_hold_what_is_below_them():
    v, f = ball(2)
    built, w = build_mesh(v, f.astype(np.int32)), deformed(v, "blown up", np.random.default_rng(4))
    tree = refit_mesh(built, w)
    corners = ((w - tree.tree.center) * tree.tree.scale)[f]
    nodes, children = tree.tree.nodes, tree.tree.nodes.view(np.int32)[:, CHILDREN:]

    def below(child):
        """The triangles of a leaf, or of all children of a node, whose boxes are looked at in passing."""
        if child >= LEAF:
            return [k for k in tree.numbers[child - LEAF] if k >= 0]
        found = []
        for lane in np.flatnonzero(children[child, :8] > 0):
            inside = below(children[child, lane])
            box = nodes[child, :48].reshape(3, 2, 8)[:, :, lane]
            np.testing.assert_allclose(box[:, 0], corners[inside].min(axis=(0, 1)), atol=1e-7)
            np.testing.assert_allclose(box[:, 1], corners[inside].max(axis=(0, 1)), atol=1e-7)
            found += inside
        return found

    assert sorted(below(0)) == list(range(len(f)))
    a, b, c = (tree.blocks[:, k : k + 12].reshape(-1, 3, 4).transpose(0, 2, 1) for k in (0, 12, 24))
    there, number = tree.numbers >= 0, tree.numbers
    np.testing.assert_allclose(a[there], corners[number[there], 0], atol=1e-7)
    np.testing.assert_allclose((a + b)[there], corners[number[there], 1], atol=3e-7)
    np.testing.assert_allclose((a + c)[there], corners[number[there], 2], atol=3e-7)


def test_python_and_machine_code_agree():
    v, f = ball(2)
    built, w = build_mesh(v, f.astype(np.int32)), v * (1, 2, 3) + 7
    center, _half, scale = unit_frame(w.min(axis=0), w.max(axis=0))
    found = []
    for run in (refit, native(refit)):
        nodes, blocks = built.tree.nodes.copy(), built.blocks.copy()
        tables = Table(w), Table(built.faces), Table(np.array([*center, scale])), Table(built.numbers)
        run(*tables, no_table(), no_table(), Table(nodes), len(nodes), Table(blocks))
        found.append((nodes, blocks))
    for a, b in zip(*found, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(
    ("vertices", "normals", "message"),
    [
        (np.zeros((4, 3)), None, r"with_vertices: vertices: got 4 rows; allowed: one for each of the 12 vertices"),
        (np.zeros((12, 2)), None, r"with_vertices: vertices: "),
        (np.full((12, 3), np.nan), None, r"with_vertices: vertices: "),
        (np.zeros((12, 3)), np.zeros((12, 3)), r"with_vertices: normals: given, and the mesh has none; .replace"),
    ],
)
def test_bad_vertices_are_told(vertices, normals, message):
    v, f = ball(0)
    with pytest.raises(sr.SceneError, match=message):
        sr.Mesh(vertices=v, faces=f).with_vertices(vertices, normals)
    with pytest.raises(sr.SceneError, match="with_vertices: normals: missing, and the mesh has some"):
        sr.Mesh(vertices=v, faces=f, normals=v).with_vertices(v)
