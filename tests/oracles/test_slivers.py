"""Slivers that are cut before a tree is built over them: the same hits, through boxes of less surface."""

from __future__ import annotations

import numpy as np
import pytest

import sightray as sr
from sightray._jit import native
from sightray.bvh import slivers
from sightray.bvh.refit import expected_cost
from sightray.bvh.triangles import MeshTree, build_mesh
from sightray.mathlib.table import Table, aligned


def needles(n: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of length 1 and width 0.002 in all directions, within a box of two."""
    rng = np.random.default_rng(seed)
    middle, along = rng.uniform(-1, 1, (n, 3)), rng.normal(size=(n, 3))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(along, rng.normal(size=(n, 3)))
    across *= 0.002 / np.linalg.norm(across, axis=1, keepdims=True)
    vertices = np.stack([middle - along / 2, middle + along / 2, middle + along / 2 + across], 1).reshape(-1, 3)
    return vertices, np.arange(3 * n, dtype=np.int32).reshape(-1, 3)


def closed_needles(n: int, seed: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Long thin tetrahedra in all directions, closed, facing outwards."""
    rng = np.random.default_rng(seed)
    along = rng.normal(size=(n, 1, 3))
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    base = np.array([[0, 0, 0], [0.02, 0, 0], [0, 0.02, 0], [0, 0, 0.02]])
    corners = rng.uniform(-1, 1, (n, 1, 3)) + base[None]
    corners[:, 3:] += along
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    a, b, c, d = corners.transpose(1, 0, 2)
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) < 0
    turned = np.where(inwards[:, None, None], faces[None, :, ::-1], faces[None])
    return corners.reshape(-1, 3), (turned + 4 * np.arange(n)[:, None, None]).reshape(-1, 3).astype(np.int32)


@pytest.fixture
def whole(monkeypatch):
    """A function that makes a mesh whose triangles stay whole."""

    def make(vertices: np.ndarray, faces: np.ndarray) -> sr.Mesh:
        with monkeypatch.context() as patch:
            patch.setattr(slivers, "FEWEST", 1 << 30)
            mesh = sr.Mesh(vertices=vertices, faces=faces)
            assert mesh.tree().cuts is None
        return mesh

    return make


def rays(n: int, seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.uniform(-1.2, 1.2, (n, 3)), rng.normal(size=(n, 3))


def pieces_of(mesh: MeshTree) -> np.ndarray:
    """How often each triangle stands in a leaf."""
    return np.bincount(mesh.numbers[mesh.numbers >= 0], minlength=len(mesh.faces))


def test_slivers_are_cut_within_the_budget_and_save_surface(whole):
    v, f = needles(4000)
    cut, plain = sr.Mesh(vertices=v, faces=f).tree(), whole(v, f).tree()
    times = pieces_of(cut)
    assert times.min() >= 1
    assert 1.95 * len(f) < times.sum() <= slivers.GROWTH * len(f)
    assert (times == cut.cuts.counts).all()
    assert expected_cost(cut) < 0.8 * expected_cost(plain)


def test_compact_triangles_stay_whole():
    rng = np.random.default_rng(5)
    a = rng.uniform(-1, 1, (2000, 3))
    v = (a[:, None] + rng.uniform(-0.05, 0.05, (2000, 3, 3))).reshape(-1, 3)
    v[:6] = [[-1, -1, -1], [1, -1, -1], [-1, 1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1]]  # a floor, along axes
    tree = build_mesh(v, np.arange(len(v), dtype=np.int32).reshape(-1, 3))
    assert tree.cuts is None or pieces_of(tree).sum() < 1.01 * 2000
    assert pieces_of(tree)[:2].tolist() == [1, 1]


def test_a_few_giants_among_small_triangles_are_cut_finely():
    rng = np.random.default_rng(6)
    small = (rng.uniform(-1, 1, (5000, 1, 3)) + rng.uniform(-0.02, 0.02, (5000, 3, 3))).reshape(-1, 3)
    giants, _ = needles(10)
    v = np.concatenate([4 * giants, small])
    tree = build_mesh(v, np.arange(len(v), dtype=np.int32).reshape(-1, 3))
    times = pieces_of(tree)
    assert times[:10].min() >= 8
    assert times[10:].max() <= 4


def test_pieces_cover_their_triangles_and_have_a_part_of_the_surface():
    v, f = needles(300)
    frame, counts = np.array([0.0, 0.0, 0.0, 0.5]), np.full(300, 7, np.int32)
    edges = np.arange(300, dtype=np.int32) % 3
    pieces = slivers.cut_pieces(v, f, frame, counts, edges)
    assert (np.bincount(pieces.triangle) == 7).all()
    low, high = pieces.boxes[:, :3].astype(float), -pieces.boxes[:, 4:7].astype(float)

    rng = np.random.default_rng(7)
    w = rng.dirichlet((1, 1, 1), (300, 50))
    points = np.einsum("tpc,tcx->tpx", w, v[f]) * 0.5
    beyond_low = points[:, :, None] >= low.reshape(300, 1, 7, 3) - 1e-6
    below_high = points[:, :, None] <= high.reshape(300, 1, 7, 3) + 1e-6
    assert (beyond_low & below_high).all(axis=3).any(axis=2).all()

    def surface(e):
        return e[..., 0] * e[..., 1] + e[..., 1] * e[..., 2] + e[..., 2] * e[..., 0]

    one = surface(np.ptp(v[f], axis=1) * 0.5)
    assert np.median(surface(high - low).reshape(300, 7).sum(1) / one) < 0.2
    assert np.allclose(low.reshape(300, 7, 3).min(1), v[f].min(1) * 0.5, atol=1e-6)
    assert np.allclose(high.reshape(300, 7, 3).max(1), v[f].max(1) * 0.5, atol=1e-6)


@pytest.mark.parametrize("n", [5000, 60_000])  # one by one, and in packets
def test_hits_are_those_of_whole_triangles(whole, n):
    v, f = needles(3000)
    cut, plain = sr.Scene(sr.Mesh(vertices=v, faces=f)), sr.Scene(whole(v, f))
    o, d = rays(n)
    a, b = cut.intersect(o, d), plain.intersect(o, d)
    assert (a.t == b.t).all()
    assert (a.primitive == b.primitive).all()
    assert 0.05 < np.isfinite(a.t).mean() < 0.95
    assert (cut.occluded(o, d) == plain.occluded(o, d)).all()


def test_layers_and_counts_meet_each_triangle_once(whole):
    v, f = needles(2000)
    cut, plain = sr.Scene(sr.Mesh(vertices=v, faces=f)), sr.Scene(whole(v, f))
    o, d = rays(20_000)
    d[:500] = v[f[:500, 1]] - v[f[:500, 0]]  # along edges
    o[:500] = v[f[:500, 0]] - 0.3 * d[:500]
    a, b = cut.intersect_all(o, d), plain.intersect_all(o, d)
    for name in ("t", "primitive", "entering", "ray"):
        assert np.array_equal(getattr(a, name), getattr(b, name)), name
    assert (cut.count(o, d) == plain.count(o, d)).all()
    assert cut.count(o, d).max() > 2


def test_slivers_in_one_place_are_all_counted(whole):
    v, f = needles(1000)
    f = np.repeat(f, 3, axis=0)
    cut, plain = sr.Scene(sr.Mesh(vertices=v, faces=f)), sr.Scene(whole(v, f))
    o, d = rays(5000)
    assert (cut.count(o, d) == plain.count(o, d)).all()
    assert cut.count(o, d).max() >= 3


def test_points_inside_of_closed_needles_are_told(whole):
    v, f = closed_needles(400)
    cut, plain = sr.Scene(sr.Mesh(vertices=v, faces=f)), sr.Scene(whole(v, f))
    rng = np.random.default_rng(8)
    within = np.einsum("npc,ncx->npx", rng.dirichlet((1, 1, 1, 1), (400, 5)), v.reshape(400, 4, 3)).reshape(-1, 3)
    points = np.concatenate([within, rng.uniform(-1, 1, (3000, 3))])
    assert cut.contains(within).all()
    assert (cut.contains(points) == plain.contains(points)).all()
    assert np.array_equal(cut.signed_distance(points), plain.signed_distance(points))
    assert sum(mesh.tree().cuts is not None for mesh in cut.objects) == 1


def test_moved_slivers_are_met_where_they_are(whole):
    v, f = needles(2000)
    w = v + 0.3 * np.sin(3 * v[:, [1, 2, 0]])
    mesh = sr.Mesh(vertices=v, faces=f)
    moved, plain = mesh.with_vertices(w), whole(w, f)
    assert moved.tree().cuts is not None
    o, d = rays(40_000)
    a, b = sr.Scene(moved).intersect(o, d), sr.Scene(plain).intersect(o, d)
    assert (a.t == b.t).all()
    assert (a.primitive == b.primitive).all()
    assert (sr.Scene(moved).count(o[:5000], d[:5000]) == sr.Scene(plain).count(o[:5000], d[:5000])).all()
    assert expected_cost(moved.tree()) < 0.9 * expected_cost(whole(v, f).with_vertices(w).tree())
    assert np.array_equal(mesh.with_vertices(v).tree().tree.nodes, mesh.tree().tree.nodes)


def test_triangles_of_next_to_no_area_take_no_more_than_the_budget():
    v, f = needles(500)
    v[f[:, 2]] = v[f[:, 1]] + 1e-30
    boxes = aligned((500, 8), np.float32)
    boxes[:, :3], boxes[:, 4:7] = v[f].min(1), -v[f].max(1)
    counts = slivers.share_out(boxes, np.zeros(500, np.float32))
    assert 1.9 * len(f) < counts.sum() <= slivers.GROWTH * len(f)


def test_python_and_machine_code_agree():
    v, f = needles(200)
    frame, counts, edges = np.array([0.1, 0.2, 0.3, 0.5]), np.arange(200, dtype=np.int32) % 9 + 1, np.arange(200) % 3
    found = []
    for run in (slivers.cut_triangles, native(slivers.cut_triangles)):
        boxes = aligned((counts.sum(), 8), np.float32)
        tables = Table(counts), Table(edges.astype(np.int32)), Table(boxes)
        run(Table(v), Table(f), Table(frame), 200, *tables)
        found.append(boxes)
    np.testing.assert_array_equal(*found)
