"""Reinsertion: trees stay trees of the same leaves, every move is the best there is, and its gain is what was promised."""

from __future__ import annotations

import numpy as np
import pytest

import sightray as sr
from sightray._jit import native
from sightray.bvh import binned_sah, reinsertion
from sightray.bvh.binned_sah import build, divide
from sightray.bvh.bvh8 import CHILDREN, LEAF, STACK_WORDS
from sightray.bvh.collapse import COUNT, FIRST, HALVES, half_area
from sightray.bvh.refit import expected_cost, tree_cost
from sightray.bvh.reinsertion import adopt_halves, find_place, move, parent_of, reinsert, sibling_of
from sightray.bvh.triangles import build_mesh
from sightray.mathlib.lanes import F32x8
from sightray.mathlib.table import Table, aligned


def scattered(n, seed):
    """Boxes of all sizes, in builders' layout; most splits of them are poor."""
    rng = np.random.default_rng(seed)
    extent = np.minimum(np.exp(rng.normal(-3.0, 1.3, (n, 3))), 0.9)
    boxes = aligned((n, 8), np.float32)
    boxes[:, :3] = rng.uniform(-1.0, 0.0, (n, 3))
    boxes[:, 4:7] = -(boxes[:, :3] + extent)
    return boxes


def binary_tree(boxes, leaf_size=1, levels=48):
    """Ranges of a tree over boxes, which are permuted, with parents."""
    n = len(boxes)
    order, ranges = np.arange(n, dtype=np.int32), aligned((2 * n, 8), np.int64)
    used = native(divide)(Table(boxes), Table(order), n, leaf_size, leaf_size, levels, Table(ranges))
    fitting = aligned((used, 8), np.int64)
    fitting[:] = ranges[:used]
    for r in range(used):
        adopt_halves(Table(fitting), r)
    return fitting


def corners(ranges):
    return ranges.view(np.float32)[:, :8]


def surface(ranges):
    """The half surfaces of all ranges that have halves, added up."""
    return sum(half_area(F32x8(corners(ranges)[r])) for r in np.flatnonzero(ranges[:, HALVES]))


def leaves_of(ranges):
    """Items and boxes of all leaves that can be reached from the root, which must be a tree of tight boxes."""
    seen, todo, leaves = set(), [0], []
    while todo:
        r = todo.pop()
        assert r not in seen
        seen.add(r)
        lower = int(ranges[r, HALVES])
        if lower == 0:
            leaves.append((*ranges[r, [FIRST, COUNT]].tolist(), *corners(ranges)[r].tolist()))
            continue
        both = corners(ranges)[lower : lower + 2]
        np.testing.assert_array_equal(corners(ranges)[r], both.min(axis=0))
        todo += [lower, lower + 1]
    assert len(seen) == len(ranges)
    return sorted(leaves)


@pytest.mark.parametrize("leaf_size", [1, 2, 4])
@pytest.mark.parametrize("share", [0.0, 0.3])
def test_the_same_leaves_under_less_surface(leaf_size, share):
    for n, seed in ((3, 0), (9, 1), (70, 2), (900, 3)):
        boxes = scattered(n, seed)
        ranges = binary_tree(boxes, leaf_size)
        leaves, before, used = leaves_of(ranges), surface(ranges), len(ranges)
        result = aligned((used, 8), np.int64)
        moves = native(reinsert)(Table(ranges), used, share, Table(result))
        inner = np.flatnonzero(result[:, HALVES])
        assert leaves_of(result) == leaves
        assert (result[inner, HALVES] > inner).all()
        assert (result[:, COUNT] > 0).all()  # `collapse` asks whether there is anything
        if n == 900:
            assert moves > 20
            assert surface(result) < 0.95 * before
        else:
            assert surface(result) <= before * (1 + 1e-12)


def test_python_and_machine_code_move_the_same():
    ranges = binary_tree(scattered(40, 4))
    found = []
    for run in (reinsert, native(reinsert)):
        mine, result = aligned(ranges.shape, np.int64), aligned(ranges.shape, np.int64)
        mine[:] = ranges
        found.append((run(Table(mine), len(ranges), 0.1, Table(result)), result))
    assert found[0][0] == found[1][0] > 0
    np.testing.assert_array_equal(found[0][1], found[1][1])


def test_a_tree_that_gains_little_stays(monkeypatch):
    ranges = binary_tree(scattered(40, 4))
    before, result = ranges.copy(), aligned(ranges.shape, np.int64)
    monkeypatch.setattr(reinsertion, "WORTH", 1.0)
    assert reinsert(Table(ranges), len(ranges), 0.1, Table(result)) > 0
    np.testing.assert_array_equal(result, before)


def plain_tree(ranges, r=0):
    """The tree as nested tuples: (number, lower, upper) or (number,)."""
    lower = int(ranges[r, HALVES])
    return (r, plain_tree(ranges, lower), plain_tree(ranges, lower + 1)) if lower else (r,)


def without(tree, x):
    """The tree after the range x and its parent are gone."""
    if len(tree) == 1:
        return tree
    for half, other in ((1, 2), (2, 1)):
        if tree[half][0] == x:
            return tree[other]
    return (tree[0], without(tree[1], x), without(tree[2], x))


def find(tree, x):
    """The part of the tree below the range x, if it is there."""
    if tree[0] == x or len(tree) == 1:
        return tree if tree[0] == x else None
    return find(tree[1], x) or find(tree[2], x)


def with_sibling(tree, part, y):
    """The tree with a part put beside y, below a new parent."""
    if tree[0] == y:
        return (-1, tree, part)
    return tree if len(tree) == 1 else (tree[0], *(with_sibling(half, part, y) for half in tree[1:]))


def cost(tree, boxes):
    """The box of a tree, and the half surfaces of all that has halves."""
    if len(tree) == 1:
        return boxes[tree[0]], 0.0
    (a, below_a), (b, below_b) = cost(tree[1], boxes), cost(tree[2], boxes)
    box = np.minimum(a, b)
    return box, below_a + below_b + half_area(F32x8(box))


def numbers(tree):
    return [tree[0]] + [r for half in tree[1:] for r in numbers(half)]


def test_no_place_is_better_and_moves_save_what_they_should():
    """Against all places for all ranges, from the definition: nested tuples, nothing pruned."""
    moved = 0
    for seed in range(6):
        ranges = binary_tree(scattered(11, 10 + seed), levels=2 * (seed % 2))  # halves as they lie are poor trees
        table, boxes = Table(ranges), corners(ranges).copy()
        tree = plain_tree(ranges)
        before = cost(tree, boxes)[1]
        for x in range(1, len(ranges)):
            part, rest = find(tree, x), without(tree, x)
            gains = {y: before - cost(with_sibling(rest, part, y), boxes)[1] for y in numbers(rest)}
            del gains[sibling_of(x)]
            found = find_place(table, x)
            place, most = found.sibling, max(gains.values(), default=0.0)
            assert (place >= 0) == (most > 1e-9)
            if place >= 0:
                np.testing.assert_allclose([gains[place], found.gain], most, rtol=1e-6)
                changed = aligned(ranges.shape, np.int64)
                changed[:] = ranges
                move(Table(changed), x, place)
                np.testing.assert_allclose(before - surface(changed), most, rtol=1e-6)
                assert leaves_of(changed) == leaves_of(ranges)
                assert all(parent_of(Table(changed), h) == r for r in np.flatnonzero(changed[:, HALVES])
                           for h in changed[r, HALVES] + np.arange(2))  # fmt: skip
                moved += 1
    assert moved > 20


def height(nodes):
    """What a ray's stack must hold at most."""
    codes, todo, most = nodes.view(np.int32)[:, CHILDREN : CHILDREN + 8], [(0, 0)], 0
    while todo:
        node, below = todo.pop()
        children = codes[node][codes[node] > 0]
        most = max(most, below + 8)
        todo += [(int(c), below + len(children) - 1) for c in children if c < LEAF]
    return most


def nested(n):
    """Boxes within one another, which cost least as a chain."""
    boxes = aligned((n, 8), np.float32)
    boxes[:, 4:7] = -np.outer(0.99 ** np.arange(n), [1.0, 0.9, 0.8])
    return boxes


def test_a_tree_that_moves_make_too_deep_is_built_without_them(monkeypatch):
    n = 600
    monkeypatch.setattr(binned_sah, "MOVED_FROM", n)
    nodes, order = binned_sah.build_tree(nested(n), 1)
    assert 8 < height(nodes) <= STACK_WORDS
    codes = nodes.view(np.int32)[:, CHILDREN : CHILDREN + 8]
    assert sorted((codes[codes >= LEAF] - LEAF) >> 3) == sorted(order) == list(range(n))
    monkeypatch.setattr(binned_sah, "TRIES", ((48, True),))
    assert len(binned_sah.build_tree(nested(n), 1)[0]) == 0


def heavy(n):
    """Boxes of all sizes about the same place: there is no end of places that are nearly as good."""
    rng = np.random.default_rng(6)
    middle, half = rng.uniform(0, 1, (n, 3)), np.exp(rng.normal(-2, 2, (n, 1)))
    scale = 1 / (2 + 2 * half.max())
    boxes = aligned((n, 8), np.float32)
    boxes[:, :3], boxes[:, 4:7] = (middle - half) * scale, -(middle + half) * scale
    return boxes


def test_the_work_is_bounded(monkeypatch):
    """No search sees more ranges than it may, and when as many as there may be have been seen nothing moves any more."""
    ranges = binary_tree(heavy(3000))
    most = [find_place(Table(ranges), x).looks for x in range(1, len(ranges), 300)]
    assert reinsertion.MOST_LOOKS <= max(most) <= reinsertion.MOST_LOOKS + reinsertion.ROOM + STACK_WORDS
    moves = []
    for looks in (0, 2, 96):
        monkeypatch.setattr(reinsertion, "LOOKS", looks)
        ranges = binary_tree(heavy(20))
        moves.append(reinsert(Table(ranges), len(ranges), 0.0, Table(aligned(ranges.shape, np.int64))))
    assert 0 == moves[0] < moves[1] < moves[2]
    ranges = binary_tree(heavy(20))
    assert reinsert(Table(ranges), len(ranges), 1e9, Table(aligned(ranges.shape, np.int64))) == 0  # all are too small


def test_ranges_so_deep_that_rays_cannot_follow_stay():
    """In a chain whose leaves lie here and there in turns, any of them would better be beside one of its own side."""
    levels = STACK_WORDS + 20
    ranges = aligned((2 * levels + 1, 8), np.int64)
    for r in range(2 * levels, -1, -1):
        x, y = r // 2 % 2 * 0.9, 1e-4 * r
        corners(ranges)[r] = [x, y, 0.0, 0.0, -x - 0.02, -y - 0.02, -0.02, 0.0]
        if r % 2 == 0 and r < 2 * levels:
            ranges[r, HALVES] = r + 1
            corners(ranges)[r] = corners(ranges)[r + 1 : r + 3].min(axis=0)
            adopt_halves(Table(ranges), r)
    assert find_place(Table(ranges), 2 * (STACK_WORDS - 10) + 1).sibling >= 0
    assert find_place(Table(ranges), 2 * (STACK_WORDS + 10) + 1).sibling == -1


def city(rng, streets):
    """Houses of all heights on one ground, 12 triangles each."""
    corner = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    sides = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
    sides += [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    at = np.stack(np.meshgrid(np.arange(streets), np.arange(streets)), -1).reshape(-1, 2)
    n = len(at)
    size = np.column_stack([rng.uniform(0.3, 0.9, (n, 2)), rng.exponential(2.0, n)])
    vertices = corner * size[:, None] + np.column_stack([at, np.zeros(n)])[:, None]
    ground = np.array([[-1, -1, 0], [streets + 1, -1, 0], [streets + 1, streets + 1, 0], [-1, streets + 1, 0]])
    faces = np.array(sides) + 8 * np.arange(n)[:, None, None]
    last = 8 * n + np.array([[0, 1, 2], [0, 2, 3]])
    return np.concatenate([vertices.reshape(-1, 3), ground]), np.concatenate([faces.reshape(-1, 3), last])


def test_rays_find_the_same_and_visit_less(monkeypatch):
    """Hits to the last bit, and in a tree of less expected cost, for items and triangles."""
    monkeypatch.setattr(binned_sah, "MOVED_FROM", 100)
    rng = np.random.default_rng(7)
    vertices, faces = city(rng, 16)
    middle, radius = rng.uniform(-9, 9, (400, 3)), np.exp(rng.normal(-1, 0.8, 400))
    o, d = rng.uniform(-1, 17, (4000, 3)), rng.normal(size=(4000, 3))
    found, costs = [], []
    for tries in (binned_sah.TRIES, ((48, False),)):
        monkeypatch.setattr(binned_sah, "TRIES", tries)
        mesh = sr.Mesh(vertices=vertices, faces=faces)
        balls = [sr.Sphere(center=c, radius=r) for c, r in zip(middle, radius, strict=True)]
        hits = [sr.Scene(*shapes).intersect(o, d) for shapes in ((mesh,), balls)]
        found.append([h.t for h in hits] + [h.primitive for h in hits])
        items = build(middle - radius[:, None], middle + radius[:, None], 1).nodes
        costs.append((expected_cost(build_mesh(vertices, faces)), native(tree_cost)(Table(items), len(items))))
    for a, b in zip(*found, strict=True):
        np.testing.assert_array_equal(a, b)
    assert costs[0][0] < 0.93 * costs[1][0]
    assert costs[0][1] < 0.985 * costs[1][1]
