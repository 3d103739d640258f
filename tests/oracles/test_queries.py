"""Batched queries against brute force in NumPy, closed forms and trimesh; what arrays they take; what must never happen."""

from __future__ import annotations

import doctest
import os
import signal
import subprocess
import sys
import threading
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import trimesh

import sightray as sr
from sightray.scene import parallel, queries

INF = np.inf


@pytest.fixture(autouse=True)
def by_packets(monkeypatch):
    """Few rays go by packets as well, whatever is compiled already."""
    monkeypatch.setattr(queries, "FEW_RAYS", 0)


def norm(a):
    return np.linalg.norm(a, axis=-1)


def blob(subdivisions=3, seed=0.0):
    """A bumpy ball: vertices and faces."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions)
    n = np.asarray(ball.vertices)
    r = 1 + 0.2 * np.sin(5 * n[:, :1] + seed) * np.cos(4 * n[:, 1:2]) + 0.1 * np.sin(9 * n[:, 2:])
    return n * r, np.asarray(ball.faces)


def mesh(vertices, faces, **options):
    return sr.Mesh(vertices=vertices, faces=faces, **options)


def random_rays(rng, n, spread=2.0):
    o = spread * rng.normal(size=(n, 3))
    return o, 0.7 * rng.normal(size=(n, 3)) - o


def triangle_hits(vertices, faces, o, d):
    """t of all rays with all triangles, (rays, triangles), infinite where they pass (Möller and Trumbore)."""
    a, e1, e2 = vertices[faces[:, 0]], *(vertices[faces[:, k]] - vertices[faces[:, 0]] for k in (1, 2))
    p = np.cross(d[:, None], e2)
    det = (p * e1).sum(-1)
    s = o[:, None] - a
    q = np.cross(s, e1)
    u, v, t = (s * p).sum(-1) / det, (d[:, None] * q).sum(-1) / det, (q * e2).sum(-1) / det
    return np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), t, INF)


@pytest.fixture(scope="module")
def ball():
    return sr.Scene(mesh(*blob(3)))


@pytest.fixture(scope="module")
def big():
    return sr.Scene(mesh(*blob(5)))


# --------------------------------------------------------------------------------------------------------- brute force


def test_mixed_scene_against_brute_force():
    """Two meshes, one of them moved, spheres and a plane: nearest, any, all and their number."""
    rng = np.random.default_rng(1)
    (v, f), (w, g) = blob(1), blob(2, 1.0)
    move = sr.Transform.translate(2, 0.5, 0) @ sr.Transform.rotate((1, 2, 3), 50) @ sr.Transform.scale(0.5, 1, -0.7)
    centers, radii = rng.uniform(-2, 2, (5, 3)), rng.uniform(0.2, 0.6, 5)
    spheres = [sr.Sphere(center=c, radius=r) for c, r in zip(centers, radii, strict=True)]
    scene = sr.Scene(mesh(v, f), sr.Group(objects=spheres), sr.Plane(point=(0, -2, 0)), mesh(w, g, transform=move))
    o, d = random_rays(rng, 600)
    found = [(0, triangle_hits(v, f, o, d)), (3, triangle_hits(move.point(w), g, o, d))]
    with np.errstate(all="ignore"):
        c = o[:, None] - centers
        b, a = (c * d[:, None]).sum(-1), (d * d).sum(-1)[:, None]
        root = np.sqrt(b * b - a * ((c * c).sum(-1) - radii**2))
        near = np.concatenate([(-b - root) / a, (-b + root) / a], axis=1)
        found.append((1, np.where(near > 0, near, INF)))
        t = ((-2 - o[:, 1]) / d[:, 1])[:, None]
        found.append((2, np.where(t > 0, t, INF)))
    t = np.concatenate([t for _, t in found], axis=1)
    shapes = np.concatenate([np.full(t.shape[1], shape) for shape, t in found])

    hits = scene.intersect(o, d)
    np.testing.assert_allclose(hits.t, t.min(axis=1), rtol=1e-9)
    np.testing.assert_array_equal(hits.shape, np.where(np.isfinite(t.min(axis=1)), shapes[t.argmin(axis=1)], -1))
    np.testing.assert_array_equal(scene.occluded(o, d), hits.hit)
    np.testing.assert_array_equal(scene.occluded(o, d, 0.6), t.min(axis=1) < 0.6)

    layers, number = scene.intersect_all(o, d), np.isfinite(t).sum(axis=1)
    np.testing.assert_array_equal(scene.count(o, d), number)
    np.testing.assert_array_equal(np.diff(layers.offsets), number)
    np.testing.assert_array_equal(layers.ray, np.repeat(np.arange(len(o)), number))
    order = np.argsort(t, axis=1)
    for i in range(len(o)):
        rows, expected = layers.of_ray(i), order[i, : number[i]]
        np.testing.assert_allclose(layers.t[rows], t[i, expected], rtol=1e-9)
        np.testing.assert_array_equal(layers.shape[rows], shapes[expected])


def test_details_of_hits(ball):
    rng = np.random.default_rng(2)
    v, f = blob(3)
    o, d = random_rays(rng, 2000)
    hits = ball.intersect(o, d)
    assert hits.hit.any()
    assert not hits.hit.all()
    miss = ~hits.hit
    for name in ("uv", "normal", "shading_normal", "position"):
        assert np.isnan(getattr(hits, name)[miss]).all()
    assert (hits.primitive[miss] == -1).all()
    assert (hits.item == hits.shape).all()
    corners = v[f[hits.primitive[hits.hit]]]
    u, w = hits.uv[hits.hit].T
    p = np.einsum("nk,nkd->nd", np.stack([1 - u - w, u, w], axis=1), corners)
    np.testing.assert_allclose(hits.position[hits.hit], p, atol=1e-14)
    np.testing.assert_allclose((o + hits.t[:, None] * d)[hits.hit], p, atol=1e-13)
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    np.testing.assert_allclose(hits.normal[hits.hit], n / norm(n)[:, None], atol=1e-12)
    sphere = sr.Scene(sr.Sphere(center=(1, 2, 3), radius=2)).intersect((1, 2, 13), (0, 0, -4))
    assert (sphere.t, sphere.shape, sphere.t.shape) == (2, 0, ())
    np.testing.assert_allclose(sphere.normal, (0, 0, 1))
    np.testing.assert_allclose(sphere.position, (1, 2, 5))


# -------------------------------------------------------------------------------------------------------------- arrays


def layouts(a):
    """The same numbers in every memory layout that NumPy knows."""
    padded = np.zeros((len(a), 7), a.dtype)
    padded[:, 2:5] = a
    twice = np.zeros((2 * len(a), 3), a.dtype)
    twice[::2] = a
    packed = np.zeros(len(a), np.dtype([("flag", "i1"), ("p", a.dtype, 3)]))  # unaligned
    packed["p"] = a
    rows = np.zeros((6, 2 * len(a)), a.dtype)
    rows[::2, ::2] = a.T
    return [a, np.asfortranarray(a), padded[:, 2:5], twice[::2], a[::-1].copy()[::-1], a[:, ::-1].copy()[:, ::-1],
            packed["p"], a.astype(a.dtype.newbyteorder()), a.tolist(), rows[::2, ::2].T]  # fmt: skip


def test_every_layout_and_type_gives_the_same(ball):
    rng = np.random.default_rng(3)
    o, d = (np.round(4 * x) for x in random_rays(rng, 3000))  # whole numbers: the same in every type
    expected = ball.intersect(o, d)
    assert 0 < np.count_nonzero(expected.hit) < len(o)
    for dtype in (np.float16, np.float32, np.float64, np.longdouble, np.int8, np.int32, np.int64):
        for a, b in zip(layouts(o.astype(dtype)), layouts(d.astype(dtype))[::-1], strict=True):
            hits = ball.intersect(a, b)
            np.testing.assert_array_equal(hits.t, expected.t)
            np.testing.assert_array_equal(hits.primitive, expected.primitive)
    np.testing.assert_array_equal(ball.intersect(o.astype(np.uint8), d).t, ball.intersect(o % 256, d).t)
    for dtype in (np.float32, np.float64):  # planes of x, y, z, as pictures are often kept, whole and in part
        planes = [np.moveaxis(np.ascontiguousarray(x.T.astype(dtype)).reshape(3, 50, 60), 0, -1) for x in (o, d)]
        for part in (np.s_[:, :], np.s_[:, 7:50], np.s_[::3, 5:6]):
            hits = ball.intersect(*(plane[part] for plane in planes))
            np.testing.assert_array_equal(hits.t, expected.t.reshape(50, 60)[part])
            blocked = ball.occluded(*(plane[part] for plane in planes))
            np.testing.assert_array_equal(blocked, expected.hit.reshape(50, 60)[part])
    frozen = o.copy()
    frozen.flags.writeable = False
    np.testing.assert_array_equal(ball.intersect(frozen, d).t, expected.t)


def test_broadcasting_gives_the_broadcast_shape(ball):
    rng = np.random.default_rng(4)
    o, d = random_rays(rng, 60)
    o, d = o.reshape(3, 4, 5, 3), d.reshape(3, 4, 5, 3)
    t_max = rng.uniform(0.3, 1.2, (3, 4, 5))
    pairs = [(o, d), (o[0, 0, 0], d), (o, d[0, 0, 0]), (o[:, :1], d), (o[0], d), (o[:, :, 0, None], d[0, None, :, :]),
             (o.transpose(2, 0, 1, 3), d.transpose(2, 0, 1, 3)), (o[0, 0, 0], d[0, 0, 0])]  # fmt: skip
    for a, b in pairs:
        full_a, full_b = np.broadcast_arrays(a, b)
        shape = full_a.shape[:-1]
        for end in (INF, 0.8, t_max[..., :1] if shape == (3, 4, 5) else 1.0, t_max if shape == (3, 4, 5) else 1.0):
            hits = ball.intersect(a, b, end)
            flat_end = np.broadcast_to(end, shape).ravel()
            flat = ball.intersect(full_a.reshape(-1, 3), full_b.reshape(-1, 3), flat_end)
            assert hits.t.shape == hits.shape.shape == hits.hit.shape == shape
            assert hits.normal.shape == (*shape, 3)
            np.testing.assert_array_equal(hits.t.ravel(), flat.t)
            np.testing.assert_array_equal(hits.position.reshape(-1, 3), flat.position)
            np.testing.assert_array_equal(ball.occluded(a, b, end).ravel(), flat.hit)
            assert ball.count(a, b, end).shape == shape
    many = ball.intersect(o[0, 0, 0], d[0, 0, 0], np.linspace(0, 2, 50))
    assert many.t.shape == (50,)
    np.testing.assert_array_equal(ball.intersect(o, d, t_max.astype(np.float32)).t,
                                  ball.intersect(o, d, t_max.astype(np.float32).astype(float)).t)  # fmt: skip


def test_empty_batches(ball):
    for o, d, shape in ((np.zeros((0, 3)), (0, 0, 1), (0,)), (np.zeros((4, 0, 3)), np.zeros((0, 3)), (4, 0))):
        hits = ball.intersect(o, d)
        assert hits.t.shape == hits.primitive.shape == ball.occluded(o, d).shape == ball.count(o, d).shape == shape
        assert hits.normal.shape == (*shape, 3)
        layers = ball.intersect_all(o, d)
        assert (layers.offsets.tolist(), layers.t.shape, layers.entering.dtype) == ([0], (0,), np.bool_)
    assert ball.closest_point(np.zeros((0, 3))).distance.shape == ball.contains(np.zeros((0, 3))).shape == (0,)
    nothing = sr.Scene()
    assert nothing.intersect((0, 0, 0), (0, 0, 1)).t == INF
    assert nothing.closest_point((0, 0, 0)).shape == -1
    assert not nothing.contains((0, 0, 0))


def test_rays_that_are_none_miss():
    scene = sr.Scene(mesh(*blob(2)), sr.Sphere(radius=3), sr.Plane())
    good, nan = np.array([0.1, 0.2, 0.3]), np.nan
    bad = [(nan, 0, 0), (0, INF, 0), (0, 0, -INF), (1e200, 0, 0)]
    o = np.array([*bad, *[good] * 9])
    d = np.array([*[good] * 4, *bad, (0, 0, 0), (-0.0, 0, 0), good, good, good])
    t_max = np.array([INF] * 10 + [0, -1, nan])
    hits = scene.intersect(o, d, t_max)
    assert not hits.hit.any()
    assert (hits.t == INF).all()
    assert (hits.shape == -1).all()
    assert not scene.occluded(o, d, t_max).any()
    assert not scene.count(o, d, t_max).any()
    assert len(scene.intersect_all(o, d, t_max).t) == 0
    assert scene.intersect(good, good, 5, t_min=5).t == scene.intersect(good, good, t_min=nan).t == INF


def test_limits_are_strict(ball):
    o, d = np.array([0.1, 0.2, 5]), np.array([0, 0, -1.0])
    t = ball.intersect(o, d).t
    assert ball.intersect(o, d, t).t == INF
    assert ball.intersect(o, d, np.nextafter(t, INF)).t == t
    assert ball.intersect(o, d, t_min=np.nextafter(t, 0)).t == t
    assert ball.intersect(o, d, t_min=float(t)).t > t
    assert ball.intersect(o, 2 * d).t == t / 2
    assert ball.intersect(o, d, t_min=-INF).t == t


def test_rays_may_begin_behind_their_origin(ball):
    o, d = random_rays(np.random.default_rng(8), 3000, spread=0.5)  # within the mesh's box, most of them
    ahead, moved = ball.intersect(o, d, t_min=-2), ball.intersect(o - 2 * d, d)
    assert np.count_nonzero(ahead.t < 0) > 500
    np.testing.assert_array_equal(ahead.primitive, moved.primitive)
    np.testing.assert_allclose(ahead.t, moved.t - 2, atol=1e-12)
    np.testing.assert_array_equal(ball.occluded(o, d, 0, t_min=-2), ahead.t < 0)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda s: s.intersect(np.zeros((4, 2)), (0, 0, 1)),
            r"intersect: origins: got shape \(4, 2\) of float64; allowed",
        ),
        (lambda s: s.intersect((0, 0, 0), np.zeros(4)), r"intersect: directions: got shape \(4,\)"),
        (lambda s: s.occluded((0, 0, 0), "up"), r"occluded: directions: got 'up'; allowed: an array of numbers"),
        (lambda s: s.intersect((0, 0, 0), [(0, 0, 1), (0, 1)]), r"intersect: directions: got \[\(0, 0, 1\)"),
        (lambda s: s.count(np.zeros((4, 3), complex), (0, 0, 1)), "count: origins: got shape .* of complex128"),
        (lambda s: s.count(np.zeros((4, 3), bool), (0, 0, 1)), "count: origins: got shape .* of bool"),
        (
            lambda s: s.intersect(np.zeros((4, 3)), np.zeros((5, 3))),
            r"got shapes origins \(4,\), directions \(5,\)",
        ),
        (lambda s: s.intersect((0, 0, 0), (0, 0, 1), None), "intersect: t_max: got None; allowed: a number"),
        (lambda s: s.intersect((0, 0, 0), (0, 0, 1), t_min=[0]), r"intersect: t_min: got \[0\]; allowed: a number"),
        (lambda s: s.intersect((0, 0, 0), (0, 0, 1), precision="half"), "precision: got 'half'; allowed: exact, fast"),
        (lambda s: s.intersect((0, 0, 0), (0, 0, 1), threads=0), "threads: got 0; allowed: a whole number from 1"),
        (lambda s: s.closest_point((0, 0)), r"closest_point: points: got \(0, 0\); allowed"),
    ],
)
def test_bad_arguments_are_told(ball, call, message):
    with pytest.raises(sr.SceneError, match=message):
        call(ball)


# -------------------------------------------------------------------------------------------------- layers, watertight


def edge_targets(rng, vertices, faces, n):
    """Points exactly on shared edges and vertices, half of each."""
    ends = vertices[faces[rng.integers(0, len(faces), n)][:, :2]]
    s = rng.uniform(0, 1, n)
    s[: n // 2] = 0
    return ends[:, 0] + s[:, None] * (ends[:, 1] - ends[:, 0])


def closed_bodies():
    v, f = blob(4)
    box = trimesh.creation.box()
    yield "blob", v, f
    yield "box", np.asarray(box.vertices), np.asarray(box.faces)
    yield "far", v * 1e-3 + 1e6, f  # features of 1e-3 at coordinates of 1e6
    yield "flat", v * (1, 1, 1e-4), f


def check_watertight(n):
    """Rays to edges and vertices from outside and inside hit; they enter and leave in turn, and end outside."""
    rng = np.random.default_rng(11)
    for name, v, f in closed_bodies():
        scene, center, size = sr.Scene(mesh(v, f)), v.mean(axis=0), np.ptp(v, axis=0)
        aim = edge_targets(rng, v, f, n)
        for scale in (3.0, 0.05):  # from outside, from the middle
            away = rng.normal(size=(n, 3))
            o = center + size * (2 * away / norm(away)[:, None] if scale > 1 else scale * away)
            d = aim - o
            hits, layers, number = scene.intersect(o, d), scene.intersect_all(o, d), scene.count(o, d)
            # From outside, a target on the outline may be touched or passed; from inside, nothing ever passes.
            inside = scale < 1
            assert (hits.hit | (number == 0)).all(), name
            if inside:
                assert hits.hit.all(), name
                assert scene.occluded(o, d).all(), name
            facing = hits.hit & (number > 0)
            assert facing.mean() > (0.95 if inside or name == "blob" else 0.5), name
            assert (number % 2 == (1 if inside else 0)).all(), name
            np.testing.assert_array_equal(np.diff(layers.offsets), number)
            assert (np.diff(layers.t)[np.diff(layers.ray) == 0] >= 0).all()
            last = layers.offsets[1:][number > 0] - 1
            from_end = last[np.cumsum(np.concatenate([[0], np.diff(layers.ray) != 0]))] - np.arange(len(layers.t))
            assert (layers.entering == (from_end % 2 == 1)).all(), name


def test_watertight_and_in_turn():
    check_watertight(13_000)


@pytest.mark.slow
def test_watertight_a_million():
    check_watertight(130_000)


def test_rays_along_faces_and_edges_of_a_box():
    """Exactly along an edge, in a face, through corners: as often in as out."""
    box = trimesh.creation.box()
    scene = sr.Scene(mesh(box.vertices, box.faces))
    grid = np.array(np.meshgrid(*[[-2, -0.5, 0, 0.25, 0.5, 2]] * 3)).reshape(3, -1).T
    d = np.array([(1, 0, 0), (0, -1, 0), (0, 0, 1), (1, 1, 0), (1, -1, 1), (0, 1, 1)], float)
    o = (grid[:, None] - 8 * d).reshape(-1, 3)
    layers = scene.intersect_all(o, np.tile(d, (len(grid), 1)))
    assert (np.diff(layers.offsets) % 2 == 0).all()
    assert (layers.entering == (np.arange(len(layers.t)) % 2 == 0)).all()


def test_many_layers_on_one_ray():
    """More surfaces than a chunk has room for at first."""
    squares = [sr.Rectangle(corner=(-1, -1, z), edge_u=(2, 0, 0), edge_v=(0, 2, 0)) for z in range(700)]
    layers = sr.Scene(*squares).intersect_all([(0, 0, -1), (9, 9, 9), (0.5, 0, -1)], (0, 0, 1))
    assert layers.offsets.tolist() == [0, 700, 700, 1400]
    assert layers.t.tolist() == 2 * list(range(1, 701))
    assert layers.shape.tolist() == 2 * list(range(700))


def test_fine_features_far_from_the_origin():
    """Coordinates of 1e6, features of 1e-3: the same triangles are met as near the origin."""
    v, f = blob(4)
    far = 1e6 + np.round(v * 2**20) * 2.0**-30  # a blob of 1e-3 that is the same in both places, bit by bit
    near = far - 1e6
    rng = np.random.default_rng(12)
    o, d = random_rays(rng, 20_000)
    o, d = np.round(o * 2**20) * 2.0**-30, np.round(d * 2**20) * 2.0**-30
    a, b = sr.Scene(mesh(near, f)).intersect(o, d), sr.Scene(mesh(far, f)).intersect(o + 1e6, d)
    np.testing.assert_array_equal(a.hit, b.hit)
    np.testing.assert_array_equal(a.t, b.t)
    np.testing.assert_array_equal(a.primitive, b.primitive)
    # Leaving from a hit point does not meet the same triangle again.
    hit = b.hit
    away = b.normal[hit] + 0.5 * rng.normal(size=(hit.sum(), 3))
    away *= np.sign((away * b.normal[hit]).sum(-1))[:, None]
    again = sr.Scene(mesh(far, f)).intersect(b.position[hit] + 1e-9 * b.normal[hit], away)
    assert (again.primitive != b.primitive[hit]).all()


# ------------------------------------------------------------------------------------------- threads, memory, Ctrl-C


@pytest.mark.parametrize("threads", [1, 2, 7])
@pytest.mark.parametrize("n", [2049, 8192, 100_000, 278_950, 3_000_001])
def test_chunks_are_all_rays_and_short_in_the_end(n, threads):
    chunks = np.array(parallel.chunks_of(n, threads))
    sizes = np.diff(chunks, axis=1)[:, 0]
    np.testing.assert_array_equal(chunks[1:, 0], chunks[:-1, 1])
    assert (chunks[0, 0], chunks[-1, 1]) == (0, n)
    assert (chunks[:, 0] % 256 == 0).all()
    assert (np.diff(sizes) <= 0).all()
    assert sizes.max() <= parallel.MOST
    least = min(parallel.LEAST, max(parallel.FEW, n // (2 * threads)))
    assert sizes[-1] <= parallel.LEAST
    assert (sizes[:-1] > least - 256).all()
    assert len(chunks) >= min(2 * threads, n // parallel.FEW)  # everybody gets some
    assert sizes[0] == parallel.MOST or n < parallel.SHARE * threads * parallel.MOST
    assert np.diff(parallel.chunks_of(1000, 2, chunk=300), axis=1).ravel().tolist() == [300, 300, 300, 100]


def test_few_rays_do_not_wait_for_packets_to_be_compiled(monkeypatch):
    """They find the same; and where packets are at hand, they serve few rays as well."""
    monkeypatch.setattr(queries, "FEW_RAYS", 5000)
    at_hand = set()
    monkeypatch.setattr(queries, "is_compiled", at_hand.__contains__)
    rng = np.random.default_rng(31)
    o, d = random_rays(rng, 5000)
    scene = sr.Scene(mesh(*blob(3)), mesh(*blob(3, 0.5)))
    used = queries.asked(scene)._kernels
    for ask, by_packets in ((scene.intersect, queries.closest_of_few), (scene.occluded, queries.any_of_few)):
        few = ask(o[:4999], d[:4999])
        assert by_packets not in used
        many = ask(o, d)
        assert by_packets in used
        used.clear()
        at_hand.add(by_packets)
        again = ask(o[:4999], d[:4999])
        assert list(used) == [by_packets]
        for one in (few, again):
            if ask == scene.intersect:
                for name in ("t", "primitive", "shape", "item"):
                    np.testing.assert_array_equal(getattr(one, name), getattr(many, name)[:4999])
            else:
                np.testing.assert_array_equal(one, many[:4999])
        assert 0.1 < np.mean(many.hit if ask == scene.intersect else many) < 0.9


def test_threads_do_not_change_anything(big):
    rng = np.random.default_rng(13)
    o, d = random_rays(rng, 60_001)
    one, two = big.intersect(o, d, threads=1), big.intersect(o, d, threads=2)
    for name in ("t", "shape", "primitive", "item", "uv", "normal", "position"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
    np.testing.assert_array_equal(big.occluded(o, d, threads=1), big.occluded(o, d, threads=3))
    for a, b in zip(big.intersect_all(o, d, threads=1), big.intersect_all(o, d, threads=2), strict=True):
        np.testing.assert_array_equal(a, b)
    answers = {}
    callers = [threading.Thread(target=lambda k=k: answers.update({k: big.intersect(o, d).t})) for k in range(4)]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join()
    assert all((answers[k] == one.t).all() for k in range(4))


def test_two_million_rays_are_not_copied(ball):
    """Beside the answers, a few chunks: also where every number must be converted."""
    n = 2_000_000
    d = np.zeros((n, 3), np.float16)
    d[:, 2] = -1
    o = np.array([0, 0, 5], np.int16)
    for a, b in ((o, d), (np.broadcast_to(o, d.shape), d), (o, d.astype(np.float32)[:, ::-1])):
        tracemalloc.start()
        hits = ball.intersect(a, b)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert len(hits) == n
        assert peak < 20 * n + 4e6  # t, shape, primitive, item


def test_ctrl_c_in_the_middle():
    """A batch of a minute ends within a second or two of Ctrl-C, with `KeyboardInterrupt`."""
    code = """
import numpy as np, sightray as sr, signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # which is not there where the tests run in the background
scene = sr.Scene(*[sr.Sphere(center=(0, 0, z), radius=1 + z / 1000) for z in range(600)])
o, d = np.zeros((2_000_000, 3)) + (3, 0, -5), np.ones((2_000_000, 3)) * (-0.0001, 0, 1)
scene.count(o[:10], d[:10])
scene.intersect_all(o[:10], d[:10])  # so that no compiler is interrupted
print("ready", flush=True)
began = time.time()
try:
    scene.intersect_all(o - (2.9, 0, 0), d)
except KeyboardInterrupt:
    print("stopped", time.time() - began)
    assert scene.count(o[0], d[0]) >= 0
    sys.exit(7)
"""
    child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, env=os.environ)
    assert child.stdout.readline() == "ready\n"
    time.sleep(0.5)
    child.send_signal(signal.SIGINT)
    began = time.time()
    assert child.wait(20) == 7
    assert time.time() - began < 5


# ------------------------------------------------------------------------------------------------------ nearest, inside


def brute_closest(triangles, points):
    """Distance of each point to the nearest of all triangles."""
    out = np.full(len(points), INF)
    for triangle in triangles:
        near = trimesh.triangles.closest_point(np.broadcast_to(triangle, (len(points), 3, 3)), points)
        out = np.minimum(out, norm(near - points))
    return out


def test_closest_point_against_all_triangles():
    rng = np.random.default_rng(14)
    (v, f), (w, g) = blob(1), blob(2, 2.0)
    move = sr.Transform.translate(1, 1, -2) @ sr.Transform.rotate((1, 0, 2), 70) @ sr.Transform.scale(0.3, 1.5, -0.8)
    scene = sr.Scene(mesh(v, f), mesh(w, g, transform=move), sr.PointLight(position=(9, 9, 9)))
    points = np.concatenate([rng.normal(size=(300, 3)) * 2, rng.normal(size=(50, 3)) * 1e4, v[:20]])
    triangles = np.concatenate([v[f], move.point(w)[g]])
    near = scene.closest_point(points)
    np.testing.assert_allclose(near.distance, brute_closest(triangles, points), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(norm(near.point - points), near.distance, rtol=1e-9, atol=1e-12)
    corners = triangles[near.primitive + np.where(near.shape == 1, len(f), 0)]
    weights = np.column_stack([1 - near.uv.sum(axis=1), near.uv])
    assert (weights > -1e-12).all()
    np.testing.assert_allclose(np.einsum("nk,nkd->nd", weights, corners), near.point, atol=1e-12)


def test_signed_distance_of_a_box_in_closed_form():
    rng = np.random.default_rng(15)
    half = np.array([0.5, 1.0, 2.0])
    box = trimesh.creation.box(extents=2 * half)
    points = rng.uniform(-3, 3, (5000, 3))
    q = np.abs(points) - half
    expected = norm(np.maximum(q, 0)) + np.minimum(q.max(axis=1), 0)
    scene = sr.Scene(mesh(box.vertices, box.faces))
    np.testing.assert_allclose(scene.signed_distance(points), expected, atol=1e-13)
    np.testing.assert_array_equal(scene.contains(points), expected < 0)
    far = sr.Scene(mesh(box.vertices * 2**-10 + 1e6, box.faces))
    np.testing.assert_allclose(far.signed_distance(points * 2**-10 + 1e6), expected * 2**-10, atol=1e-9)
    assert far.signed_distance((np.nan, 0, 0)) == INF
    assert not far.contains((INF, 0, 0))
    aligned = np.stack(np.meshgrid(*[np.linspace(-0.4, 0.4, 5)] * 3), axis=-1)  # rays from here meet symmetric edges
    assert scene.contains(aligned).all()


def test_inside_of_overlapping_bodies_cavities_and_either_orientation():
    def sphere(radius, shift=0.0):
        s = trimesh.creation.icosphere(subdivisions=3, radius=radius)
        return np.asarray(s.vertices) + np.array([shift, 0, 0]), np.asarray(s.faces)

    (v, f), (w, g) = sphere(1), sphere(1, 0.8)
    at = np.array([[0.4, 0, 0], [-0.8, 0, 0], [1.6, 0, 0], [0.4, 0.95, 0], [2, 0, 0]])
    both = sr.Scene(mesh(np.concatenate([v, w]), np.concatenate([f, g + len(v)])))
    apart = sr.Scene(mesh(v, f), mesh(w, g))
    for scene in (both, apart):
        assert scene.contains(at).tolist() == [True, True, True, False, False]
    v2, f2 = sphere(0.5)
    hollow = sr.Scene(mesh(np.concatenate([v, v2]), np.concatenate([f, f2[:, ::-1] + len(v)])))
    assert hollow.contains([[0, 0, 0], [0.7, 0, 0], [1.2, 0, 0]]).tolist() == [False, True, False]
    assert sr.Scene(mesh(v, f[:, ::-1])).contains((0, 0, 0))
    loose = mesh(v[f].reshape(-1, 3), np.arange(3 * len(f)).reshape(-1, 3))  # no shared vertices, as in STL files
    assert sr.Scene(loose).contains(at).tolist() == [True, True, False, False, False]


def test_inside_of_a_blob_against_trimesh():
    rng = np.random.default_rng(16)
    v, f = blob(3)
    points = rng.uniform(-1.3, 1.3, (3000, 3))
    t = triangle_hits(v, f, points, np.broadcast_to(rng.normal(size=3), points.shape))
    np.testing.assert_array_equal(sr.Scene(mesh(v, f)).contains(points), np.isfinite(t).sum(axis=1) % 2 == 1)


def test_what_has_no_inside_is_refused():
    v, f = blob(1)
    with pytest.raises(sr.SceneError, match=r"contains: object 1 'lid': got a mesh with 3 open edges; allowed: closed"):
        sr.Scene(mesh(v, f), mesh(v, f[1:], name="lid")).contains((0, 0, 0))
    flipped = f.copy()
    flipped[0] = flipped[0, ::-1]
    with pytest.raises(sr.SceneError, match=r"signed_distance: .* 3 open edges"):
        sr.Scene(mesh(v, flipped)).signed_distance((0, 0, 0))
    assert sr.Scene(mesh(v, f[1:])).closest_point((0, 0, 9)).distance > 7
    for verb in ("closest_point", "contains", "signed_distance"):
        with pytest.raises(sr.UnsupportedError, match=f"{verb}: object 1: got a Sphere"):
            getattr(sr.Scene(mesh(v, f), sr.Sphere()), verb)((0, 0, 0))


def test_the_guide_says_what_happens():
    page = Path(__file__).parents[2] / "docs" / "queries.md"
    text = page.read_text(encoding="utf-8").replace("```", "")
    examples = doctest.DocTestParser().get_doctest(text, {}, page.name, str(page), 0)
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    report: list[str] = []
    runner.run(examples, out=report.append)
    assert runner.tries > 15
    assert runner.failures == 0, "".join(report)


def test_queries_after_explain():
    """`explain` runs the same tables as plain Python; the machine code that stands in them must survive it."""
    code = """
import sightray as sr
scene = sr.Scene(sr.Sphere(), sr.PointLight(position=(4, 4, 4), intensity=30),
                 camera=sr.PerspectiveCamera(eye=(0, 0, 4), target=(0, 0, 0), width=8, height=8))
before = scene.intersect((0, 0, 4), (0, 0, -1)).t
sr.explain(scene, pixel=(4, 4))
assert scene.intersect((0, 0, 4), (0, 0, -1)).t == before == 3
"""
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


@pytest.mark.parametrize("others", [0, 6])
def test_holes_let_rays_through_however_many_items_there_are(others):
    """Few items are asked in packets and many are not; both see what a picture shows."""
    hole = sr.Cutout(material=sr.Lambert(), opacity=sr.Checker(even=1.0, odd=0.0, scale=2.0))
    corners, uvs = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 0), (1, 0), (1, 1), (0, 1)]
    sheet = sr.Mesh(vertices=corners, faces=[(0, 1, 2), (0, 2, 3)], uvs=uvs, material=hole)
    scene = sr.Scene(sheet, *[sr.Sphere(center=(9 + k, 0, 0), radius=0.1) for k in range(others)])
    o = np.random.default_rng(0).random((200, 3)) * (1, 1, 0) + (0, 0, 3)
    there = (np.floor(o[:, 0] * 2) + np.floor(o[:, 1] * 2)) % 2 == 0
    np.testing.assert_array_equal(np.isfinite(scene.intersect(o, (0, 0, -1)).t), there)
    np.testing.assert_array_equal(scene.occluded(o, (0, 0, -1)), there)


def netting(**options):
    """Something with holes of every kind: by a texture, by chance, and one in the other."""
    holes = sr.Checker(even=1.0, odd=0.2, scale=7.0)
    return sr.Cutout(material=sr.Cutout(material=sr.Lambert(), opacity=0.8), opacity=holes, **options)


@pytest.mark.parametrize("threshold", [None, 0.5])
def test_layers_see_the_holes_that_the_nearest_hit_sees(threshold):
    """All layers are the nearest hit, the nearest one behind it, and so on; `count` is their number."""
    rng = np.random.default_rng(21)
    v, f = blob(3)
    uvs = rng.uniform(0, 1, (len(v), 2))
    holey = mesh(v, f, uvs=uvs, material=netting(threshold=threshold))
    turned = sr.Transform.translate(0.5, 0, 1) @ sr.Transform.rotate((1, 2, 0), 40) @ sr.Transform.scale(1, 0.5, 2)
    scene = sr.Scene(holey, sr.Instance(of=holey, transform=turned), sr.Sphere(center=(0, 1, 0)),
                     sr.Sphere(center=(1, 0, 0), radius=0.7, material=netting(threshold=threshold)))  # fmt: skip
    o, d = random_rays(rng, 4000)
    layers, whole = scene.intersect_all(o, d), scene.replace(objects=[bare(x) for x in scene.objects]).count(o, d)
    number = np.diff(layers.offsets)
    assert 0.3 < number.sum() / whole.sum() < 0.9
    np.testing.assert_array_equal(scene.count(o, d), number)
    np.testing.assert_array_equal(scene.count(o, d, 0.9, t_min=0.3), [((0.3 < t) & (t < 0.9)).sum() for t in split(layers)])
    start, some, depth = np.zeros(400), slice(0, 400), 0
    while True:
        found = [scene.intersect(a, b, t_min=c) for a, b, c in zip(o[some], d[some], start, strict=True)]
        hit = np.array([x.hit for x in found])
        np.testing.assert_array_equal(hit, number[some] > depth)
        if not hit.any():
            break
        rows = layers.offsets[:400][hit] + depth
        start = np.array([x.t for x in found])  # of which the last digit may be another one in layers
        np.testing.assert_allclose(layers.t[rows], start[hit], rtol=1e-12)
        np.testing.assert_array_equal(layers.shape[rows], np.array([x.shape for x in found])[hit])
        np.testing.assert_array_equal(layers.primitive[rows], np.array([x.primitive for x in found])[hit])
        depth += 1
    assert depth >= 4


def bare(thing):
    """The same without holes."""
    inner = thing.replace(of=bare(thing.of)) if isinstance(thing, sr.Instance) else thing
    return inner if isinstance(thing, sr.Instance) else thing.replace(material=sr.Lambert())


def split(layers):
    """The values of t of each ray."""
    return np.split(layers.t, layers.offsets[1:-1])


# ------------------------------------------------------------------------------------------------------ fast precision


def test_fast_hits_are_those_of_single_precision(big):
    """Coherent and incoherent rays, other shapes and moved meshes beside: the same hits but for rounding."""
    rng = np.random.default_rng(22)
    v, f = blob(5)
    move = sr.Transform.translate(1.5, 0, 0) @ sr.Transform.scale(0.4, -0.6, 0.3)
    mixed = sr.Scene(mesh(v, f), mesh(v, f, transform=move), sr.Sphere(center=(-1.5, 0, 0), radius=0.4))
    side = (np.stack(np.meshgrid(np.arange(160), np.arange(160)), axis=-1).reshape(-1, 2) - 80) / 100
    eye = np.concatenate([side, np.full((len(side), 1), 4.0)], axis=1)
    o, d = random_rays(rng, 20_000)
    for scene in (big, mixed):
        for origins, directions in ((eye, (0.01, 0.02, -3)), (o, d), (o.astype(np.float32), d.astype(np.float32))):
            exact = scene.intersect(origins, directions)
            fast = scene.intersect(origins, directions, precision="fast")
            both = exact.hit & fast.hit
            assert both.mean() > 0.2
            assert (exact.hit != fast.hit).mean() < 1e-3
            assert (exact.primitive != fast.primitive).mean() < 5e-3
            assert (exact.shape != fast.shape)[both].mean() < 1e-3
            same = both & (exact.primitive == fast.primitive) & (exact.shape == fast.shape)
            speed = np.broadcast_to(norm(np.asarray(directions)), len(origins))
            away = np.abs(exact.t[same] - fast.t[same]) * speed[same]
            assert 0 < np.max(away)
            assert np.quantile(away, 0.99) < 2e-6
            assert away.max() < 1e-4
            np.testing.assert_allclose(fast.position[same], exact.position[same], atol=1e-6)
            two = scene.intersect(origins, directions, precision="fast", threads=2)
            np.testing.assert_array_equal(fast.t, two.t)
    np.testing.assert_array_equal(big.occluded(o, d, precision="fast"), big.occluded(o, d))


def test_fast_keeps_to_its_ends_and_to_what_is_no_ray(big):
    o, d = np.array([0.1, 0.2, 5]), np.array([0, 0, -1.0])
    t = float(big.intersect(o, d).t)
    ends = np.array([t - 1e-4, t + 1e-4, np.nan, -1.0, INF])
    assert big.intersect(o, d, ends, precision="fast").hit.tolist() == [False, True, False, False, True]
    behind = big.intersect(o, d, t_min=t + 1e-4, precision="fast")
    assert behind.t > t + 0.5
    assert not big.intersect([(np.nan, 0, 0), (1e200, 0, 0)], d, precision="fast").hit.any()


def test_fast_rays_seldom_slip_between_triangles():
    """From the middle of a closed body to its edges and vertices: at most one in ten thousand is lost."""
    rng = np.random.default_rng(23)
    v, f = blob(4)
    scene, n = sr.Scene(mesh(v, f)), 100_000
    o = 0.05 * rng.normal(size=(n, 3))
    d = edge_targets(rng, v, f, n) - o
    assert scene.intersect(o, d, precision="fast").hit.mean() > 0.9999
