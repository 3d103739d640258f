"""The trees against asking every triangle and every item: nothing is lost, no ray slips between two triangles."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh

import sightray as sr
from sightray._jit import kernel, native
from sightray.accelerators.bvh import any_item, closest_item, pack_items
from sightray.bvh import binned_sah
from sightray.bvh import collapse as collapsing
from sightray.bvh.binned_sah import Bvh8, build, divide
from sightray.bvh.bvh8 import CHILDREN, LEAF, STACK_WORDS
from sightray.bvh.collapse import COUNT, HALVES, collapse, half_area, plan_ranges
from sightray.bvh.shadow_order import order_children
from sightray.bvh.triangles import (
    BLOCKS,
    MESH_WORDS,
    any_triangle,
    build_mesh,
    closest_triangle,
    meet_triangle,
    pack_mesh,
    shear,
)
from sightray.mathlib.hit import is_hit, miss
from sightray.mathlib.lanes import F32x8
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Space, Table, aligned, f64_at, f64_put, i64_put, table_at
from sightray.mathlib.vec import Vec3
from sightray.scene.compile import Compiled

# ---------------------------------------------------------------------------------------------------- asking the tables


@kernel
def vec3_of(rows: Table, index: i64) -> Vec3:
    return Vec3(f64_at(rows, index), f64_at(rows, index + 1), f64_at(rows, index + 2))


@kernel
def trace_mesh(mesh: Table, rays: Table, n: i64, t_min: f64, t_max: f64, out: Table) -> None:
    """For each ray: t, triangle, u, v of the closest hit, and whether there is any."""
    for i in range(n):
        o, d = vec3_of(rays, 6 * i), vec3_of(rays, 6 * i + 3)
        hit = closest_triangle(mesh, o, d, t_min, t_max)
        f64_put(out, 5 * i, hit.t)
        f64_put(out, 5 * i + 1, float(hit.prim))
        f64_put(out, 5 * i + 2, hit.u)
        f64_put(out, 5 * i + 3, hit.v)
        f64_put(out, 5 * i + 4, 1.0 if any_triangle(mesh, o, d, t_min, t_max) else 0.0)


@kernel
def ask_every_triangle(mesh: Table, blocks: i64, rays: Table, n: i64, t_min: f64, t_max: f64, out: Table) -> None:
    """The smallest t of the double-precision test over all triangles, for each ray."""
    for i in range(n):
        o, d = vec3_of(rays, 6 * i), vec3_of(rays, 6 * i + 3)
        s = shear(d)
        best = miss()
        for lane in range(4 * blocks):
            hit = meet_triangle(mesh, lane // 4, lane % 4, o, s, t_min, t_max)
            if is_hit(hit) and hit.t < best.t:
                best = hit
        f64_put(out, i, best.t)


def pack(vertices, faces):
    space = Space()
    row = space.row(MESH_WORDS)
    pack_mesh(space, row, build_mesh(np.asarray(vertices, np.float64), np.asarray(faces, np.int32)))
    return space, row


def trace(row, o, d, t_min=0.0, t_max=math.inf, run=None):
    rays = np.ascontiguousarray(np.concatenate(np.broadcast_arrays(o, d), axis=1), np.float64)
    out = np.empty((len(rays), 5))
    (run or native(trace_mesh))(row, Table(rays), len(rays), t_min, t_max, Table(out))
    return out


def ask_all(row, n_blocks, o, d, t_min=0.0, t_max=math.inf):
    rays = np.ascontiguousarray(np.concatenate(np.broadcast_arrays(o, d), axis=1), np.float64)
    out = np.empty(len(rays))
    native(ask_every_triangle)(row, n_blocks, Table(rays), len(rays), t_min, t_max, Table(out))
    return out


def compare(vertices, faces, o, d):
    """Assert that the tree finds exactly the nearest of all triangles; what it finds."""
    _space, row = pack(vertices, faces)
    blocks = len(table_at(row, BLOCKS).view(np.float32)) // 48
    found, expected = trace(row, o, d), ask_all(row, blocks, o, d)
    np.testing.assert_array_equal(found[:, 0], expected)
    np.testing.assert_array_equal(found[:, 4], np.isfinite(expected))
    assert (found[np.isinf(expected), 1] == -1).all()
    return found


def soup(rng, n, size=0.2):
    centers = rng.uniform(-1, 1, (n, 1, 3))
    return (centers + size * rng.normal(size=(n, 3, 3))).reshape(-1, 3), np.arange(3 * n).reshape(-1, 3)


def targets(rng, vertices, faces, n):
    """Points inside triangles, on edges, and vertices: a third each."""
    w = rng.dirichlet((1, 1, 1), n)
    w[: n // 3] = np.eye(3)[rng.integers(0, 3, n // 3)]
    w[n // 3 : 2 * n // 3, 0] = 0
    w /= w.sum(axis=1, keepdims=True)
    corners = np.asarray(vertices)[np.asarray(faces)[rng.integers(0, len(faces), n)]]
    return np.einsum("nk,nkd->nd", w, corners)


# ------------------------------------------------------------------------------------------------------------ triangles


def moller_trumbore_extended(vertices, faces, o, d):
    """Nearest hit in 80-bit arithmetic, and whether the ray keeps clear of all edges: an independent oracle."""
    a, b, c = (np.asarray(vertices, np.longdouble)[faces[:, k]] for k in range(3))
    best, clear = np.full(len(o), np.inf), np.ones(len(o), bool)
    for i in range(len(o)):
        di, s = d[i].astype(np.longdouble), o[i] - a
        p, q = np.cross(di, c - a), np.cross(s, b - a)
        det = ((b - a) * p).sum(1)
        u, v, t = (s * p).sum(1) / det, (di * q).sum(1) / det, ((c - a) * q).sum(1) / det
        margin = np.minimum(np.minimum(u, v), 1 - u - v)
        clear[i] = not ((abs(margin) < 1e-9) & (t > -1e-9)).any() and not (abs(t[margin > -1e-9]) < 1e-9).any()
        best[i] = np.min(t, initial=np.inf, where=(margin >= 0) & (t > 0))
    return best, clear


def test_closest_hit_is_exact_against_extended_precision():
    rng = np.random.default_rng(1)
    vertices, faces = soup(rng, 300)
    o, d = rng.uniform(-2, 2, (1500, 3)), rng.normal(size=(1500, 3))
    expected, clear = moller_trumbore_extended(vertices, faces, o, d)
    _space, row = pack(vertices, faces)
    found = trace(row, o, d)
    assert clear.mean() > 0.99
    assert 0.1 < np.isfinite(expected[clear]).mean() < 1.0
    np.testing.assert_allclose(found[clear, 0], expected[clear], rtol=1e-12)

    # The barycentric weights give the same point as the ray.
    hit = np.isfinite(found[:, 0])
    a, b, c = (vertices[faces[found[hit, 1].astype(int), k]] for k in range(3))
    u, v = found[hit, 2:3], found[hit, 3:4]
    np.testing.assert_allclose((1 - u - v) * a + u * b + v * c, o[hit] + found[hit, :1] * d[hit], atol=1e-12)


@pytest.mark.parametrize("distance", [0.0, 1.0, 1e3, 1e6, 1e11])
@pytest.mark.parametrize("offset", [0.0, 1e6])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e6])
def test_nothing_is_lost_at_edges_and_vertices(distance, offset, scale):
    rng = np.random.default_rng(2)
    ball = trimesh.creation.icosphere(subdivisions=2)
    vertices = ball.vertices * scale + offset
    p = targets(rng, vertices, ball.faces, 1500)
    o = p + rng.normal(size=p.shape) * scale * max(distance, 0.1)
    compare(vertices, ball.faces, o, (p - o) * rng.uniform(0.1, 10.0, (len(p), 1)))


def test_small_features_of_a_huge_scene():
    """Triangles of a millimetre at both ends of a scene of a thousand kilometres."""
    rng = np.random.default_rng(3)
    vertices, faces = soup(rng, 120, size=1e-3)
    vertices = np.concatenate([vertices * 2e-2 - 1e6, vertices * 2e-2 + 1e6])
    faces = np.concatenate([faces, faces + len(faces) * 3])
    p = targets(rng, vertices, faces, 400)
    found = compare(vertices, faces, p + rng.normal(size=p.shape), -rng.normal(size=p.shape))
    o = p + rng.normal(size=p.shape) * 0.05
    found = compare(vertices, faces, o, p - o)
    assert np.isfinite(found[:, 0]).mean() > 0.4  # on edges it is a toss-up


def test_needles_and_slivers():
    rng = np.random.default_rng(4)
    n = 200
    start, along = rng.uniform(-1, 1, (n, 1, 3)), rng.normal(size=(n, 1, 3))
    width = 10.0 ** rng.uniform(-12, -3, (n, 1, 1)) * rng.normal(size=(n, 1, 3))
    vertices = np.concatenate([start, start + along, start + 0.5 * along + width], axis=1).reshape(-1, 3)
    faces = np.arange(3 * n).reshape(-1, 3)
    p = targets(rng, vertices, faces, 2000)
    o = p + rng.normal(size=p.shape)
    compare(vertices, faces, o, p - o)


def test_axis_aligned_rays_on_a_grid():
    """Directions with zeros of both signs, along box faces, through vertices and edges."""
    g = np.linspace(-1, 1, 9)
    vertices = np.stack(np.meshgrid(g, g, [0.0, 0.5], indexing="ij"), -1).reshape(-1, 3)
    cell = lambda i, j, k: (i * 9 + j) * 2 + k  # noqa: E731
    faces = [
        face
        for i in range(8) for j in range(8) for k in range(2)
        for face in ((cell(i, j, k), cell(i + 1, j, k), cell(i, j + 1, k)),
                     (cell(i + 1, j, k), cell(i + 1, j + 1, k), cell(i, j + 1, k)))
    ]  # fmt: skip
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-1, 1, 33), np.linspace(-1, 1, 33)))
    for zero in (0.0, -0.0):
        found = compare(vertices, np.array(faces), np.stack([x, y, np.full_like(x, 3.0)], 1), [[zero, zero, -2.0]])
        np.testing.assert_array_equal(found[:, 0], 1.25)
        compare(vertices, np.array(faces), np.stack([np.full_like(x, -3.0), x, y], 1), [[1.0, zero, zero]])
        compare(vertices, np.array(faces), np.stack([x, y, y * 0], 1), [[0.3, zero, -1.0]])


def test_icosphere_is_watertight():
    rng = np.random.default_rng(5)
    ball = trimesh.creation.icosphere(subdivisions=4)
    _space, row = pack(ball.vertices, ball.faces)
    p = targets(rng, ball.vertices, ball.faces, 100_000)
    inside = rng.normal(size=p.shape)
    inside *= 0.8 * rng.uniform(size=(len(p), 1)) / np.linalg.norm(inside, axis=1, keepdims=True)
    assert np.isfinite(trace(row, inside, p - inside)).all()
    for distance in (1.0, 1e3, 1e6):
        outside = p * (1.0 + distance) + 0.2 * rng.normal(size=p.shape)
        aim = 0.9 * p - outside  # through an edge or vertex to a point inside
        assert np.isfinite(trace(row, outside, aim)).all()


def test_range_is_open_and_direction_sets_the_unit():
    _space, row = pack([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    o, d = np.array([[0.25, 0.25, 8.0]]), np.array([[0.0, 0.0, -2.0]])
    np.testing.assert_allclose(trace(row, o, d)[0], [4.0, 0, 0.25, 0.25, 1])
    for t_min, t_max in ((4.0, 9.0), (0.0, 4.0), (9.0, 1.0), (math.nan, 9.0), (0.0, math.nan)):
        assert trace(row, o, d, t_min, t_max)[0].tolist() == [math.inf, -1, 0, 0, 0]
    assert trace(row, o, d, 3.9999999999, 4.0000000001)[0, 0] == 4.0
    assert trace(row, o, -d, -math.inf, math.inf)[0, 0] == -4.0
    for scale in (1e-60, 1e-6, 1e6, 1e60):
        np.testing.assert_allclose(trace(row, o, d * scale)[0, 0], 4.0 / scale)


def test_senseless_rays_miss():
    rng = np.random.default_rng(6)
    _space, row = pack(*soup(rng, 40))
    for bad in (math.nan, math.inf, -math.inf):
        rays = np.repeat(rng.normal(size=(1, 6)), 6, axis=0)
        rays[np.arange(6), np.arange(6)] = bad
        assert np.isinf(trace(row, rays[:, :3], rays[:, 3:])[:, 0]).all()
    assert np.isinf(trace(row, np.zeros((1, 3)), np.zeros((1, 3)))[0, 0])


@pytest.mark.parametrize("n", [0, 1, 3, 4, 5, 40])
def test_python_and_machine_code_agree(n):
    rng = np.random.default_rng(7)
    vertices, faces = soup(rng, max(n, 1))
    _space, row = pack(vertices, faces[:n])
    o = rng.uniform(-2, 2, (60, 3))
    d = np.concatenate([targets(rng, vertices, faces[: max(n, 1)], 171)[114:] - o[:57], np.eye(3)])  # inside
    slow, fast = trace(row, o, d, run=trace_mesh), trace(row, o, d)
    np.testing.assert_array_equal(slow[:, [1, 4]], fast[:, [1, 4]])
    np.testing.assert_allclose(slow, fast, rtol=1e-11, atol=1e-12)
    assert n == 0 or np.isfinite(fast[:, 0]).any()


# -------------------------------------------------------------------------------------------------------------- builder


def walk(tree: Bvh8, lower, upper):
    """Check a tree's structure; how high a ray's stack gets at most, and the sizes of its leaves."""
    nodes, codes = tree.nodes, tree.nodes.view(np.int32)[:, CHILDREN : CHILDREN + 8]
    seen, sizes, height = [], [], 0
    todo = [(0, 0)]
    visited = set()
    while todo:
        node, below = todo.pop()
        assert node not in visited
        visited.add(node)
        height = max(height, below + 8)
        for k in range(8):
            code = int(codes[node, k])
            low, high = nodes[node, k:48:16].astype(float), nodes[node, 8 + k : 48 : 16].astype(float)
            if code == 0:
                assert (low == np.inf).all()
                assert (high == -np.inf).all()
                continue
            if code < LEAF:
                todo.append((code, below + np.count_nonzero(codes[node]) - 1))
                inner = codes[code] != 0
                below_low, below_high = nodes[code, :48].reshape(3, 2, 8)[:, :, inner].transpose(1, 0, 2)
                assert (below_low.min(axis=1) == low).all()
                assert (below_high.max(axis=1) == high).all()
                continue
            first, count = (code - LEAF) >> 3, code & 7
            items = tree.order[first : first + count]
            # The traversal allows for 16 units of rounding; boxes use up one.
            slack = 2.0**-24
            assert (low - slack <= ((lower[items] - tree.center) * tree.scale).min(axis=0)).all()
            assert (high + slack >= ((upper[items] - tree.center) * tree.scale).max(axis=0)).all()
            seen.append(items)
            sizes.append(count)
    assert sorted(np.concatenate([*seen, np.arange(0)])) == list(range(len(lower)))
    assert visited == set(range(len(nodes)))
    assert nodes.ctypes.data % 64 == 0
    return height, sizes


@pytest.mark.parametrize("n", [0, 1, 2, 4, 5, 9, 64, 65, 1000])
@pytest.mark.parametrize("leaf_size", [1, 2, 4])
def test_tree_holds_every_item_once_in_boxes_that_contain_it(n, leaf_size):
    rng = np.random.default_rng(n)
    lower = rng.normal(size=(n, 3))
    upper = lower + rng.exponential(size=(n, 3))
    _, sizes = walk(build(lower, upper, leaf_size), lower, upper)
    assert max(sizes, default=0) <= leaf_size
    if n > 8:
        assert np.mean(sizes) > 0.5 * leaf_size


def exponential(n):
    p = np.outer(2.0 ** -np.arange(n), [1, 1, 1])
    return p, p


def concentric(n):
    p = np.outer(np.arange(1, n + 1), [1, 1, 1.0])
    return -p, p


def nested_by_doubling(n):
    """Boxes that grow from one corner: each split cuts off few."""
    p = np.outer(1.5 ** np.arange(n), [1.0, 0.3, 0.0])
    return p * 0, p


@pytest.mark.parametrize("n", [40, 900])
@pytest.mark.parametrize("boxes", [exponential, concentric, nested_by_doubling, lambda n: (np.ones((n, 3)),) * 2])
def test_degenerate_boxes_make_bounded_trees(boxes, n):
    lower, upper = boxes(n)
    height, _ = walk(build(lower, upper, 1), lower, upper)
    assert height <= STACK_WORDS


def test_a_tree_that_is_too_deep_is_built_anew(monkeypatch):
    """Boxes of which each split cuts off few make a deep tree; halving makes one that is as flat as can be."""
    lower, upper = nested_by_doubling(60)
    monkeypatch.setattr(binned_sah, "runnable", lambda function, n: function)
    deep, _ = walk(build(lower, upper, 1), lower, upper)
    monkeypatch.setattr(collapsing, "STACK_WORDS", deep - 1)
    flat, _ = walk(build(lower, upper, 1), lower, upper)
    assert flat < deep
    assert 7 * 25 + 8 <= STACK_WORDS  # 2^26 items, halved again and again: at most 26 levels


def least_cost(ranges, r, places):
    """C(r, i) of Ylitie, Karras and Laine (2017), straight from its definition."""
    area = half_area(F32x8(ranges[r, :4].view(np.float32)))
    lower = int(ranges[r, HALVES])
    if lower == 0:
        return area
    if places == 1:
        return area + min(least_cost(ranges, lower, k) + least_cost(ranges, lower + 1, 8 - k) for k in range(1, 8))
    shared = [least_cost(ranges, lower, k) + least_cost(ranges, lower + 1, places - k) for k in range(1, places)]
    return min(*shared, least_cost(ranges, r, places - 1))


def test_nodes_of_eight_cost_the_least():
    """The surfaces of all nodes and leaves add up to the least sum that any choice of nodes has."""
    rng = np.random.default_rng(12)
    for n in (9, 14, 23):
        boxes = aligned((n, 8), np.float32)
        corner = rng.uniform(-1, 0.6, (n, 3))
        boxes[:, :3], boxes[:, 4:7] = corner, -corner - rng.uniform(0, 0.4, (n, 3))
        order, ranges = np.arange(n, dtype=np.int32), aligned((2 * n, 8), np.int64)
        used = divide(Table(boxes), Table(order), n, 1, 1, 48, Table(ranges))
        plans, nodes = aligned((used, 8), np.int64), aligned((used, 64), np.float32)
        plan_ranges(Table(ranges), used, Table(plans))
        filled = collapse(Table(ranges), Table(plans), 1, Table(nodes))
        total = half_area(F32x8(ranges[0, :4].view(np.float32)))
        for node in nodes[:filled]:
            low, high = node[:48].reshape(3, 2, 8).astype(float).transpose(1, 2, 0)
            e = (high - low)[node.view(np.int32)[CHILDREN : CHILDREN + 8] > 0]
            total += (e[:, 0] * e[:, 1] + e[:, 1] * e[:, 2] + e[:, 2] * e[:, 0]).sum()
        np.testing.assert_allclose(total, least_cost(ranges, 0, 1), rtol=1e-6)
        assert ranges[0, COUNT] == n


def test_any_hit_rays_visit_first_what_stops_most_for_its_cost():
    """Lanes ascend by probability over cost, recomputed here from the triangles themselves."""
    rng = np.random.default_rng(13)
    vertices = rng.uniform(-1, 1, (900, 3)) * rng.uniform(0.02, 1.0, (900, 1))
    faces = rng.integers(0, 900, (700, 3)).astype(np.int32)
    mesh = build_mesh(vertices, faces)
    nodes, codes = mesh.tree.nodes.astype(float), mesh.tree.nodes.view(np.int32)[:, CHILDREN : CHILDREN + 8]
    corner = (vertices[faces] - mesh.tree.center) * mesh.tree.scale
    areas = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1) / 2

    def worth(node):
        """Probability that a node stops a ray that meets it, and what that costs."""
        low, high = nodes[node, :48].reshape(3, 2, 8).transpose(1, 2, 0)
        there = codes[node] > 0
        assert (np.diff(there.astype(int)) >= 0).all()  # empty lanes first
        e = np.where(there[:, None], high - low, 0)
        h = e[:, 0] * e[:, 1] + e[:, 1] * e[:, 2] + e[:, 2] * e[:, 0]
        whole = high[there].max(axis=0) - low[there].min(axis=0)
        q = np.minimum(h / (whole[0] * whole[1] + whole[1] * whole[2] + whole[2] * whole[0]), 1)
        p, cost = np.zeros(8), np.ones(8)
        for lane in np.flatnonzero(there):
            code = int(codes[node, lane])
            if code < LEAF:
                p[lane], cost[lane] = worth(code)
            else:
                numbers = mesh.numbers[code - LEAF]
                p[lane] = min(areas[numbers[numbers >= 0]].sum() / h[lane], 1)
        assert (np.diff((p / cost)[there]) >= -1e-5).all()
        left = np.concatenate([[1], np.cumprod(1 - (q * p)[::-1])])
        return 1 - left[-1], 1 + (left[:-1] * (q * cost)[::-1]).sum()

    worth(0)
    again = [mesh.tree.nodes.copy() for _ in range(2)]
    for nodes_again, run in zip(again, (order_children, native(order_children)), strict=True):
        nodes_again[:, :56] = nodes_again.reshape(-1, 8, 8)[:, :7, ::-1].reshape(-1, 56)
        run(Table(nodes_again), len(nodes), Table(mesh.blocks), 48, Table(aligned((len(nodes), 2), np.float64)))
    np.testing.assert_array_equal(*(a.view(np.int32) for a in again))


def test_coincident_triangles_are_found():
    vertices, faces = np.eye(3), np.tile([[0, 1, 2]], (100, 1))
    rng = np.random.default_rng(8)
    o = rng.normal(size=(300, 3)) + 1.0
    found = compare(vertices, faces, o, targets(rng, vertices, faces, 300) - o)
    assert np.isfinite(found[:, 0]).mean() > 0.4


def test_builder_in_python_and_machine_code_agree():
    results = []
    for compiled in (lambda function: function, native):
        boxes = aligned((50, 8), np.float32)
        corner = np.random.default_rng(10).uniform(-1, 0.9, (50, 3))
        boxes[:, :3], boxes[:, 4:7] = corner, -corner - 0.1
        order, ranges = np.arange(50, dtype=np.int32), aligned((100, 8), np.int64)
        used = compiled(divide)(Table(boxes), Table(order), 50, 4, 4, 48, Table(ranges))
        plans, nodes = aligned((used, 8), np.int64), aligned((64, 64), np.float32)
        compiled(plan_ranges)(Table(ranges), used, Table(plans))
        filled = compiled(collapse)(Table(ranges), Table(plans), 4, Table(nodes))
        results.append((np.array([used, filled]), order, ranges, plans, nodes.view(np.int32)))
    for slow, fast in zip(*results, strict=True):
        np.testing.assert_array_equal(slow, fast)


def test_unbounded_boxes_are_refused():
    with pytest.raises(ValueError, match="finite boxes"):
        build(np.zeros((2, 3)), np.array([[1, 1, 1], [1, np.nan, 1.0]]))


# ---------------------------------------------------------------------------------------------------------------- items


@kernel
def trace_items(tree: Table, rays: Table, n: i64, t_min: f64, t_max: f64, t: Table, items: Table) -> None:
    for i in range(n):
        o, d = vec3_of(rays, 6 * i), vec3_of(rays, 6 * i + 3)
        hit = closest_item(tree, o, d, t_min, t_max)
        f64_put(t, i, hit.t)
        i64_put(items, 2 * i, hit.item)
        i64_put(items, 2 * i + 1, 1 if any_item(tree, o, d, t_min, t_max) else 0)


class _Captured:
    """Stands in for an accelerator and keeps what it is given."""

    merges_meshes = False

    def build_scene(self, space, items, lower, upper, things):
        self.items, self.lower, self.upper = items, lower, upper
        return space.row(8)


def test_items_against_single_spheres():
    """A tree over spheres and planes finds what the formulas say, far from the origin too."""
    rng = np.random.default_rng(11)
    for offset in (0.0, 1e6):
        center, radius = rng.uniform(-5, 5, (150, 3)) + offset, rng.uniform(0.05, 0.5, 150)
        spheres = [sr.Sphere(center=tuple(c), radius=r) for c, r in zip(center.tolist(), radius.tolist(), strict=True)]
        floor = sr.Plane(point=(0, offset - 6, 0), normal=(0, 1, 0))
        captured = _Captured()
        compiled = Compiled(sr.Scene(floor, *spheres), captured)
        tree = pack_items(compiled.tables.space, captured.items, captured.lower, captured.upper)
        compiled.tables.prepare(trace_items)
        o, d = rng.uniform(-8, 8, (2000, 3)) + offset, rng.normal(size=(2000, 3))
        rays, t, items = np.concatenate([o, d], axis=1), np.empty(2000), np.empty((2000, 2), np.int64)
        native(trace_items)(tree, Table(rays), 2000, 0.0, math.inf, Table(t), Table(items))

        expected = np.full((2000, 151), np.inf)
        with np.errstate(invalid="ignore", divide="ignore"):
            s = (offset - 6 - o[:, 1]) / d[:, 1]
            expected[:, 0] = np.where(s > 0, s, np.inf)
            f = o[:, None] - center
            a, b = (d * d).sum(1)[:, None], np.einsum("nkd,nd->nk", f, d)
            root = np.sqrt(a * (radius**2 - ((f - (b / a)[..., None] * d[:, None]) ** 2).sum(-1)))
            near, far = (-b - root) / a, (-b + root) / a
            expected[:, 1:] = np.where(near > 0, near, np.where(far > 0, far, np.inf))
        np.testing.assert_allclose(t, expected.min(axis=1), rtol=1e-6 if offset else 1e-9)
        hit = np.isfinite(t)
        assert (items[hit, 0] == expected.argmin(axis=1)[hit]).all()
        assert (items[~hit, 0] == -1).all()
        assert (items[:, 1] == hit).all()


@pytest.mark.parametrize("leaf_size", [1, 2, 4])
@pytest.mark.parametrize("threads", [2, 5])
def test_several_threads_build_the_tree_of_one(monkeypatch, leaf_size, threads):
    """The same nodes and the same order of items to the last bit; many items lie in one place, some far away."""
    rng = np.random.default_rng(14)
    n = 5000
    low = rng.uniform(-1, 1, (n, 3))
    low[:700] = 0.25
    low[700:900] = 50 * rng.normal(size=(200, 3))
    high = low + rng.uniform(0, 0.1, (n, 3))
    alone = build(low, high, leaf_size)
    monkeypatch.setattr(binned_sah, "SHARED_FROM", 1000)
    monkeypatch.setattr(binned_sah, "core_count", lambda: threads)
    together = build(low, high, leaf_size)
    assert np.array_equal(alone.order, together.order)
    assert alone.nodes[:, :56].tobytes() == together.nodes[:, :56].tobytes()
    parts = binned_sah.divide_items(boxes_of(low, high), np.arange(n, dtype=np.int32), leaf_size, 48)
    assert parts[parts[:, HALVES] == 0, COUNT].sum() == n
    assert parts[parts[:, HALVES] == 0, COUNT].max() <= leaf_size


def test_the_limit_of_levels_holds_within_the_parts_of_threads(monkeypatch):
    """Items of which every split takes off but one: as deep as levels are allowed by area, then halved."""
    n = 3000
    low = np.outer(0.9 ** np.arange(n), [1.0, 1.0, 1.0])
    heights = []
    for shared_from in (1 << 30, 1000):
        monkeypatch.setattr(binned_sah, "SHARED_FROM", shared_from)
        monkeypatch.setattr(binned_sah, "core_count", lambda: 2)
        ranges = binned_sah.divide_items(boxes_of(low, low), np.arange(n, dtype=np.int32), 1, 20)
        levels = np.zeros(len(ranges), np.int64)
        for r in np.flatnonzero(ranges[:, HALVES]):
            levels[ranges[r, HALVES] : ranges[r, HALVES] + 2] = levels[r] + 1
        heights.append(levels.max())
    assert heights[0] == heights[1]
    assert heights[0] > 20


def boxes_of(low, high):
    """Boxes as the builder takes them."""
    boxes = aligned((len(low), 8), np.float32)
    boxes[:, :3], boxes[:, 4:7] = low, -high
    return boxes
