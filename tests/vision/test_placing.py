"""Objects on a ground: overlap against brute force, resting poses against statics, dice against their distributions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation
from scipy.stats import kstest

import sightray as sr
from sightray.errors import FormatError
from sightray.formats.base import Limits
from sightray.formats.yaml_nodes import parse
from sightray.vision.dice import Dice
from sightray.vision.draws import Drawer
from sightray.vision.overlap import Solid, overlap
from sightray.vision.placing import Ground, Model, place
from sightray.vision.resting import resting


def hull_mesh(points: np.ndarray) -> sr.Mesh:
    """The convex hull of points as a closed mesh, wound outward."""
    hull = ConvexHull(points)
    faces = hull.simplices.copy()
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) < 0
    faces[inward] = faces[inward][:, [0, 2, 1]]
    return sr.Mesh(vertices=points, faces=faces)


def convex_overlap(p: np.ndarray, q: np.ndarray) -> bool:
    """Whether two convex bodies meet: separating axes (all normals of faces, all products of edges)."""
    hp, hq = ConvexHull(p), ConvexHull(q)
    edges = [np.unique(np.round(np.concatenate([pts[h.simplices[:, i]] - pts[h.simplices[:, i - 1]] for i in range(3)]), 12),
                       axis=0) for pts, h in ((p, hp), (q, hq))]  # fmt: skip
    products = np.cross(edges[0][:, None], edges[1][None]).reshape(-1, 3)
    axes = np.concatenate([hp.equations[:, :3], hq.equations[:, :3], products])
    axes = axes[np.linalg.norm(axes, axis=1) > 1e-9]
    a, b = p @ axes.T, q @ axes.T
    return bool(((a.min(0) <= b.max(0)) & (b.min(0) <= a.max(0))).all())


def test_overlap_of_convex_bodies_agrees_with_separating_axes():
    random = np.random.default_rng(7)
    bodies = [random.normal(size=(n, 3)) * scale for n, scale in ((4, 1), (8, 0.7), (12, (1.5, 0.2, 0.6)))]
    solids = [Solid(hull_mesh(points)) for points in bodies]
    counts = [0, 0]
    for k in range(300):
        i, j = random.integers(3, size=2)
        a, b = np.eye(4), np.eye(4)
        for m in (a, b):
            m[:3, :3] = Rotation.random(random_state=int(random.integers(1 << 30))).as_matrix() * random.uniform(
                0.5, 1.5
            )
            m[:3, 3] = random.normal(size=3) * 0.9
        p, q = (points @ m[:3, :3].T + m[:3, 3] for points, m in ((bodies[i], a), (bodies[j], b)))
        truth = convex_overlap(p, q)
        assert overlap(solids[i], a, solids[j], b) == truth, k
        counts[truth] += 1
    assert min(counts) > 40


def ring(radius: float, tube: float, n: int = 24, m: int = 12) -> sr.Mesh:
    """A torus about the y axis as a closed mesh."""
    u, v = np.meshgrid(np.arange(n) * 2 * np.pi / n, np.arange(m) * 2 * np.pi / m, indexing="ij")
    r = radius + tube * np.cos(v)
    points = np.stack([r * np.cos(u), tube * np.sin(v), r * np.sin(u)], axis=-1).reshape(-1, 3)
    at = np.arange(n * m).reshape(n, m)
    a, b, c, d = at, np.roll(at, -1, 0), np.roll(np.roll(at, -1, 0), -1, 1), np.roll(at, -1, 1)
    faces = np.concatenate([np.stack([a, c, b], -1), np.stack([a, d, c], -1)]).reshape(-1, 3)
    return sr.Mesh(vertices=points, faces=faces)


def test_rings_may_be_linked_without_touching_and_one_body_may_lie_in_another():
    outer, eye = Solid(ring(1.0, 0.2)), np.eye(4)
    upright = sr.Transform.translate(1.0, 0, 0) @ sr.Transform.rotate((1, 0, 0), 90)
    assert not overlap(outer, eye, outer, upright.matrix)  # linked: the boxes, even the hulls, meet
    assert overlap(outer, eye, outer, (sr.Transform.translate(0.1, 0, 0) @ sr.Transform.rotate((1, 0, 0), 90)).matrix)
    ball = Solid(hull_mesh(Rotation.random(60, random_state=1).apply([0.1, 0, 0])))
    assert not overlap(ball, eye, outer, eye)  # in the hole
    inside = sr.Transform.translate(1.0, 0, 0).matrix
    assert overlap(ball, inside, outer, eye)  # in the tube, no surface touches
    assert overlap(outer, eye, ball, inside)


def test_a_needle_through_a_board_is_seen_from_both_sides():
    """No vertex of one lies in the other, and no edge of the board meets the needle."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    board, needle = Solid(hull_mesh(corners * (1, 0.05, 1))), Solid(hull_mesh(corners * (0.01, 1, 0.01)))
    there = sr.Transform.translate(0.3, 0, 0.5).matrix
    assert overlap(board, np.eye(4), needle, there)
    assert overlap(needle, there, board, np.eye(4))
    assert not overlap(board, np.eye(4), needle, sr.Transform.translate(0.3, 1.06, 0.5).matrix)


def test_boxes_stand_for_shapes_that_are_no_meshes():
    ball = Solid(sr.Sphere(radius=1))
    assert overlap(ball, np.eye(4), ball, sr.Transform.translate(1.99, 0, 0).matrix)
    assert not overlap(ball, np.eye(4), ball, sr.Transform.translate(2.01, 0, 0).matrix)


def test_resting_bodies_do_not_tip_over():
    random = np.random.default_rng(9)
    shapes = [random.normal(size=(30, 3)) * s for s in ((1, 1, 1), (3, 1, 0.3), (0.2, 0.2, 2))]
    shapes.append(np.array([[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)], float))
    for points in shapes:
        center = ConvexHull(points).points[ConvexHull(points).vertices].mean(axis=0)
        for k in range(20):
            turn = resting(points, center, Rotation.random(random_state=k).as_matrix())
            np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-9)
            p, c = points @ turn.T, turn @ center
            low = p[:, 1].min()
            feet = p[p[:, 1] < low + 1e-7][:, [0, 2]]
            assert len(feet) >= 3
            hull = ConvexHull(feet)
            assert (hull.equations @ [*c[[0, 2]], 1] <= 1e-7).all()


def test_placed_bodies_stand_on_the_ground_and_do_not_meet():
    model, ground = Model(ring(0.15, 0.04)), Ground(0.5, (-0.6, -0.6), (0.6, 0.6))
    for turn in ("upright", "rest", "any"):
        placed = []
        for k in range(10):
            found = place(model, 1.0, turn, ground, placed, Dice(3, 0, f"{turn}{k}"))
            if found is not None:
                placed.append(found)
        assert len(placed) >= 6
        for k, one in enumerate(placed):
            points = model.solid.points @ one.matrix[:3, :3].T + one.matrix[:3, 3]
            assert abs(points[:, 1].min() - 0.5) < 1e-12
            middle = 0.5 * one.matrix[:3, :3] @ (model.solid.lower + model.solid.upper) + one.matrix[:3, 3]
            assert (np.abs(middle[[0, 2]]) <= 0.6).all()
            for other in placed[:k]:
                assert not brute_overlap(model, one.matrix, other.matrix)


def brute_overlap(model: Model, a: np.ndarray, b: np.ndarray) -> bool:
    """Every edge of each against every triangle of the other, by plain arithmetic."""
    mesh = model.solid.meshes[0]
    for m, n in ((a, b), (b, a)):
        p, q = (mesh.vertices @ t[:3, :3].T + t[:3, 3] for t in (m, n))
        corners = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        o, d = p[corners[:, 0]][:, None], (p[corners[:, 1]] - p[corners[:, 0]])[:, None]
        v0, v1, v2 = (q[mesh.faces[:, k]][None] for k in range(3))
        det = np.einsum("eti,eti->et", np.cross(d, v2 - v0), np.broadcast_to(v1 - v0, (o.shape[0], v1.shape[1], 3)))
        with np.errstate(divide="ignore", invalid="ignore"):
            u = np.einsum("eti,eti->et", np.cross(d, v2 - v0), o - v0) / det
            r = np.cross(o - v0, v1 - v0)
            v = np.einsum("eti,eti->et", np.broadcast_to(d, r.shape), r) / det
            t = np.einsum("eti,eti->et", np.broadcast_to(v2 - v0, r.shape), r) / det
            if ((u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0) & (t <= 1)).any():
                return True
    return False


def test_dice_are_even_and_depend_on_seed_frame_and_place_alone():
    numbers = [Dice(1, k, "x").unit() for k in range(4000)]
    assert kstest(numbers, "uniform").pvalue > 1e-3
    assert kstest([Dice(1, 0, f"{k}").normal() for k in range(4000)], "norm").pvalue > 1e-3
    assert np.bincount([Dice(2, k).integer(1, 3) for k in range(3000)]).tolist()[0] == 0
    assert min(np.bincount([Dice(2, k).integer(1, 3) for k in range(3000)])[1:]) > 900
    assert Dice(1, 2, "a").unit() == Dice(1, 2, "a").unit() == 0.6423054318023198
    assert len({Dice(s, f, w).unit() for s in (0, 1) for f in (0, 1) for w in "ab"}) == 8
    turned = np.array([Rotation.from_quat(np.roll(Dice(5, k).turn(), -1)).apply([0, 0, 1]) for k in range(3000)])
    assert kstest(turned[:, 1], "uniform", args=(-1, 2)).pvalue > 1e-3


def drawn(text: str, frame: int = 0):
    return Drawer(Path("r.yaml")).draw(parse(text, Path("r.yaml"), Limits()), Dice(0, frame)).plain()


def test_draws_keep_their_bounds_and_plain_values():
    for k in range(200):
        values = drawn("""
            a: {uniform: [2, 3]}
            b: {uniform: [[0, 10], [1, 20]]}
            c: {log_uniform: [0.1, 10]}
            d: {integers: [4, 6]}
            e: {choice: [x, {type: Lambert, albedo: {uniform: [0, 1]}}], weights: [1, 3]}
            f: {hsv: [[0, 120], [0.5, 1], [0.2, 0.9]]}
            g: {around: {center: [1, 2, 3], distance: [2, 4], elevation: 30}}
            h: [{repeat: {integers: [0, 3]}, of: {normal: [5, 0.1]}}, last]
            i: {type: Plane, normal: [0, 1, 0]}
        """, k)  # fmt: skip
        assert 2 <= values["a"] < 3
        assert 0 <= values["b"][0] < 1
        assert 10 <= values["b"][1] < 20
        assert 0.1 <= values["c"] < 10
        assert values["d"] in (4, 5, 6)
        assert values["e"] == "x" or 0 <= values["e"]["albedo"] < 1
        assert 0.2 <= max(values["f"]) <= 0.9
        assert values["f"][2] == min(values["f"])  # from red to green there is no blue
        away = np.subtract(values["g"], [1, 2, 3])
        assert 2 <= np.linalg.norm(away) <= 4
        np.testing.assert_allclose(away[1], np.linalg.norm(away) / 2)
        assert len(values["h"]) <= 4
        assert values["h"][-1] == "last"
        assert values["i"] == {"type": "Plane", "normal": [0, 1, 0]}
    shares = np.mean([drawn("e: {choice: [0, 1], weights: [1, 3]}", k)["e"] for k in range(2000)])
    assert abs(shares - 0.75) < 4 * np.sqrt(0.75 * 0.25 / 2000)


@pytest.mark.parametrize(("text", "said"), [
    ("a: {uniform: [3, 2]}", "uniform: 3 is above 2"),
    ("a: {uniform: 3}", "uniform: expected"),
    ("a: {log_uniform: [0, 2]}", "allowed: numbers above 0"),
    ("a: {choice: []}", "choice: expected a list"),
    ("a: {choice: [1, 2], weights: [1]}", "expected a list of 2"),
    ("a: {uniform: [0, 1], max: 3}", "'max' beside 'uniform'"),
    ("\na: [{repeat: -1, of: 3}]", "r.yaml:2: repeat: got -1"),
    ("a: {around: {azimuth: 3}}", "distance must be there"),
])  # fmt: skip
def test_bad_draws_are_told(text, said):
    with pytest.raises(FormatError, match=said):
        drawn(text)
