"""The three forms of the triangle test against one another and against NumPy's linear solver."""

from __future__ import annotations

import numpy as np
import pytest

from sightray._jit import kernel, native
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, advance, f64_put, vec3_at
from sightray.mathlib.triangle_tests import moeller_trumbore, triangle_by_linear_system, triangle_by_plane_and_edges
from sightray.mathlib.vec import Vec3

FORMS = (triangle_by_linear_system, triangle_by_plane_and_edges, moeller_trumbore)


@kernel
def ask_all(given: Table, out: Table, n: i64) -> None:
    for i in range(n):
        row = advance(given, 20 * i)
        a, b, c, o, d = vec3_at(row, 0), vec3_at(row, 4), vec3_at(row, 8), vec3_at(row, 12), vec3_at(row, 16)
        p = triangle_by_linear_system(a, b, c, o, d)
        q = triangle_by_plane_and_edges(a, b, c, o, d)
        r = moeller_trumbore(a, b, c, o, d)
        for k in range(3):
            h = p if k == 0 else q if k == 1 else r
            f64_put(out, 9 * i + 3 * k, h.t)
            f64_put(out, 9 * i + 3 * k + 1, h.u)
            f64_put(out, 9 * i + 3 * k + 2, h.v)


@pytest.mark.parametrize("compiled", [True, False])
def test_all_forms_solve_the_linear_system(compiled):
    rng = np.random.default_rng(5)
    n = 5000 if compiled else 300
    rows = np.zeros((n, 5, 4))
    rows[:, :, :3] = rng.normal(size=(n, 5, 3))
    a, b, c, o = (rows[:, k, :3] for k in range(4))
    weights = rng.dirichlet((1, 1, 1), n) + rng.choice([0, 0.4], (n, 1)) * rng.normal(size=(n, 3))
    weights /= weights.sum(axis=1, keepdims=True)
    rows[:, 4, :3] = np.einsum("nk,nkx->nx", weights, rows[:, :3, :3]) - o
    d = rows[:, 4, :3]
    out = np.zeros((n, 3, 3))
    (native(ask_all) if compiled else ask_all)(Table(rows), Table(out), n)

    u, v, t = np.linalg.solve(np.stack([b - a, c - a, -d], axis=2), (o - a)[..., None])[..., 0].T
    size = np.linalg.cond(np.stack([b - a, c - a, -d], axis=2))
    margin = np.minimum.reduce([u, v, 1 - u - v])
    sure = np.abs(margin) > 1e-14 * size
    for k in range(3):
        hit = np.isfinite(out[:, k, 0])
        assert (hit == (margin > 0))[sure].all()
        both = hit & (margin > 0)
        assert both.sum() > n // 3
        error = np.abs(out[both, k] - np.stack([t, u, v], axis=1)[both]).max(axis=1)
        assert (error < 1e-14 * size[both] + 1e-13).all()


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("x", "y"), [(0.25, 0.25), (0, 0), (1, 0), (0.5, 0.5), (0.5, 0)])
def test_points_inside_on_edges_and_corners(form, x, y):
    """The unit triangle from above: corners and edges belong to it."""
    hit = form(Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(x, y, 2), Vec3(0, 0, -1))
    assert tuple(hit) == (2, x, y)


@pytest.mark.parametrize("form", FORMS)
def test_a_ray_away_from_the_triangle_meets_it_at_negative_t_and_a_parallel_one_never(form):
    corners = Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)
    assert form(*corners, Vec3(0.2, 0.2, 3), Vec3(0, 0, 1)).t == -3
    assert form(*corners, Vec3(0.2, 0.2, 3), Vec3(1, 0, 0)).t == np.inf
    assert form(*corners, Vec3(0.2, 0.2, 0), Vec3(0, 0, 0)).t == np.inf
